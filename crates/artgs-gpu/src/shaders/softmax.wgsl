// Weights of the parts from logits, and the motions they blend to. Same computation as the second half of
// `Model::forward` in `artgs::articulation::assignment::block` and `Blend` in `artgs::articulation::model::warp`.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> inputs: array<f32>;
// Rows `(a_k, b_k)` interleaved.
@group(0) @binding(2) var<storage, read> outputs: array<f32>;
@group(0) @binding(3) var<storage, read> motions: array<vec4f>;
// `[K][n]`, before and after the choice of one part.
@group(0) @binding(4) var<storage, read_write> soft: array<f32>;
@group(0) @binding(5) var<storage, read_write> weights: array<f32>;
// Of each Gaussian: real and dual part over the length of the former, rotation of the heaviest part.
@group(0) @binding(6) var<storage, read_write> blended: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> lengths: array<f32>;

// Random bits of four numbers: the generator pcg4d of Jarzynski and Olano.
fn random_bits(key: vec4u) -> u32 {
    var v = key * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> vec4u(16u);
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v.x;
}

// Gumbel(0, 1) noise of random bits. Near 1 the logarithm is a series: devices round it to an absolute error.
fn gumbel(bits: u32) -> f32 {
    let uniform_number = (f32(bits >> 9u) + 0.5) / 8388608.0;
    let rest = (f32(8388607u - (bits >> 9u)) + 0.5) / 8388608.0;
    let series = rest * (1.0 + rest * (0.5 + rest * (1.0 / 3.0 + rest * 0.25)));
    return -log(select(-log(uniform_number), series, rest < 0.02));
}

@compute @workgroup_size(GROUP)
fn softmax(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group.x * GROUP + lane;
    let n = step.n;
    if i >= n {
        return;
    }
    var highest = -LARGEST;
    for (var k = 0u; k < step.parts; k++) {
        let norm = inputs[(4u * k + 3u) * n + i];
        let a = outputs[2u * k * n + i];
        let b = outputs[(2u * k + 1u) * n + i];
        var logit = -norm * norm * exp(step.shift_weight * a) + step.shift_weight * b;
        if has(step.flags, GUMBEL) {
            logit += gumbel(random_bits(vec4u(i, k, step.noise)));
        }
        let scaled = logit * step.inverse_temperature;
        highest = max(highest, scaled);
        soft[k * n + i] = scaled;
    }
    var sum = 0.0;
    for (var k = 0u; k < step.parts; k++) {
        let value = exp(soft[k * n + i] - highest);
        sum += value;
        soft[k * n + i] = value;
    }
    var heaviest = 0u;
    var most = -1.0;
    for (var k = 0u; k < step.parts; k++) {
        let value = soft[k * n + i] / sum;
        soft[k * n + i] = value;
        if value > most {
            heaviest = k;
            most = value;
        }
    }
    let towards = 2u * step.pose * step.parts;
    var real = vec4f(0.0);
    var dual = vec4f(0.0);
    for (var k = 0u; k < step.parts; k++) {
        let chosen = select(0.0, 1.0, k == heaviest);
        let w = select(soft[k * n + i], chosen, has(step.flags, HARD));
        weights[k * n + i] = w;
        real += w * motions[towards + 2u * k];
        dual += w * motions[towards + 2u * k + 1u];
    }
    let size = max(length(real), MOTION_LENGTH_MIN);
    blended[3u * i] = real / size;
    blended[3u * i + 1u] = dual / size;
    blended[3u * i + 2u] = motions[towards + 2u * heaviest];
    lengths[i] = size;
}
