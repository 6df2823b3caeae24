// Term that pulls centres to the opacity-weighted means of their parts. Same computation as `centre_regulariser` in
// `artgs::articulation::assignment::centres`.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> params: array<f32>;
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<storage, read> values: array<f32>;
// `[K][chunks]`: weighted sums of positions, and the weight.
@group(0) @binding(4) var<storage, read_write> masses: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> part_means: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> part_terms: array<PartTerms>;

var<workgroup> own: array<vec4f, GROUP>;

@compute @workgroup_size(GROUP)
fn sum_masses(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let n = step.n;
    let each = (n + step.chunks - 1u) / step.chunks;
    var end = min((group.x + 1u) * each, n);
    if !has(step.flags, CENTRE) {
        end = 0u;
    }
    var sum = vec4f(0.0);
    for (var i = group.x * each + lane; i < end; i += GROUP) {
        let mass = weights[group.y * n + i] / (1.0 + exp(-params[at_logit(n, i)]));
        sum += mass * vec4f(params[3u * i], params[3u * i + 1u], params[3u * i + 2u], 1.0);
    }
    own[lane] = sum;
    workgroupBarrier();
    for (var reach = GROUP / 2u; reach > 0u; reach /= 2u) {
        if lane < reach {
            own[lane] += own[lane + reach];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        masses[group.y * step.chunks + group.x] = own[0];
    }
}

// One workgroup.
@compute @workgroup_size(GROUP)
fn pull_centres(@builtin(local_invocation_index) lane: u32) {
    var loss = 0.0;
    for (var k = lane; k < step.parts && has(step.flags, CENTRE); k += GROUP) {
        var total = vec4f(0.0);
        for (var c = 0u; c < step.chunks; c++) {
            total += masses[k * step.chunks + c];
        }
        let mass = total.w + OPACITY_FLOOR;
        let mean = total.xyz / mass;
        let centre = vec3f(values[FRAME * k], values[FRAME * k + 1u], values[FRAME * k + 2u]);
        let gap = centre - mean;
        loss += step.centre_scale * dot(gap, gap);
        part_means[2u * k] = vec4f(mean, 0.0);
        part_means[2u * k + 1u] = vec4f(-2.0 * step.centre_scale * gap / mass, 0.0);
    }
    own[lane] = vec4f(loss);
    workgroupBarrier();
    for (var reach = GROUP / 2u; reach > 0u; reach /= 2u) {
        if lane < reach {
            own[lane] += own[lane + reach];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        part_terms[step.slot].centre = own[0].x;
    }
}
