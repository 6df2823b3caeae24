// Gradients with respect to the motion of a part, summed over a range of Gaussians in a fixed order.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> labels: array<u32>;
@group(0) @binding(2) var<storage, read> d_motions: array<vec4f>;
// `[K][n]`, where parts are weighted.
@group(0) @binding(3) var<storage, read> weights: array<f32>;
@group(0) @binding(4) var<storage, read_write> partial: array<vec4f>;

var<workgroup> reals: array<vec4f, WIDE_GROUP>;
var<workgroup> duals: array<vec4f, WIDE_GROUP>;

@compute @workgroup_size(WIDE_GROUP)
fn sum_motions(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let each = (step.n + step.chunks - 1u) / step.chunks;
    let end = min((group.x + 1u) * each, step.n);
    var real = vec4f(0.0);
    var dual = vec4f(0.0);
    let weighted = has(step.flags, WEIGHTED);
    for (var i = group.x * each + lane; i < end; i += WIDE_GROUP) {
        if weighted {
            let w = weights[group.y * step.n + i];
            real += w * d_motions[2u * i];
            dual += w * d_motions[2u * i + 1u];
        } else if labels[i] == group.y {
            real += d_motions[2u * i];
            dual += d_motions[2u * i + 1u];
        }
    }
    reals[lane] = real;
    duals[lane] = dual;
    workgroupBarrier();
    for (var reach = WIDE_GROUP / 2u; reach > 0u; reach /= 2u) {
        if lane < reach {
            reals[lane] += reals[lane + reach];
            duals[lane] += duals[lane + reach];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        let at = 2u * (group.y * step.chunks + group.x);
        partial[at] = reals[0];
        partial[at + 1u] = duals[0];
    }
}
