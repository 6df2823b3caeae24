// Gradients with respect to logits from those with respect to blended motions. Same computation as `softmax_backward`
// in `artgs::articulation::assignment::block`, the adjoint of weights in `artgs::articulation::model::warp` and
// `centre_regulariser` in `artgs::articulation::assignment::centres`.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> params: array<f32>;
@group(0) @binding(2) var<storage, read> motions: array<vec4f>;
@group(0) @binding(3) var<storage, read> lengths: array<f32>;
// Of each part: mean of its Gaussians, gradient with respect to the mean.
@group(0) @binding(4) var<storage, read> part_means: array<vec4f>;
@group(0) @binding(5) var<storage, read> soft: array<f32>;
@group(0) @binding(6) var<storage, read> inputs: array<f32>;
@group(0) @binding(7) var<storage, read> outputs: array<f32>;
// With respect to the unit blend as input, with respect to the sum of weighted motions as output.
@group(0) @binding(8) var<storage, read_write> d_motions: array<vec4f>;
@group(0) @binding(9) var<storage, read_write> d_outputs: array<f32>;
// With respect to squared distances, `[K][n]`.
@group(0) @binding(10) var<storage, read_write> d_distances: array<f32>;

@compute @workgroup_size(GROUP)
fn softmax_back(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group.x * GROUP + lane;
    let n = step.n;
    if i >= n {
        return;
    }
    let d_real = d_motions[2u * i] / lengths[i];
    let d_dual = d_motions[2u * i + 1u] / lengths[i];
    d_motions[2u * i] = d_real;
    d_motions[2u * i + 1u] = d_dual;
    let x = vec3f(params[3u * i], params[3u * i + 1u], params[3u * i + 2u]);
    let opacity = 1.0 / (1.0 + exp(-params[at_logit(n, i)]));
    let towards = 2u * step.pose * step.parts;
    var mean = 0.0;
    for (var k = 0u; k < step.parts; k++) {
        var d = dot(motions[towards + 2u * k], d_real) + dot(motions[towards + 2u * k + 1u], d_dual);
        if has(step.flags, CENTRE) {
            d += opacity * dot(part_means[2u * k + 1u].xyz, x - part_means[2u * k].xyz);
        }
        mean += soft[k * n + i] * d;
        d_distances[k * n + i] = d;
    }
    for (var k = 0u; k < step.parts; k++) {
        let d_logit = soft[k * n + i] * (d_distances[k * n + i] - mean) * step.inverse_temperature;
        let norm = inputs[(4u * k + 3u) * n + i];
        let stretch = exp(step.shift_weight * outputs[2u * k * n + i]);
        d_distances[k * n + i] = -stretch * d_logit;
        d_outputs[2u * k * n + i] = -step.shift_weight * norm * norm * stretch * d_logit;
        d_outputs[(2u * k + 1u) * n + i] = step.shift_weight * d_logit;
    }
}
