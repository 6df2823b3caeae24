// Gradients with respect to the frame of a part, summed over a range of Gaussians in a fixed order. Same computation as
// `frame_backward` in `artgs::articulation::assignment::block`.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> params: array<f32>;
@group(0) @binding(2) var<storage, read> frames: array<vec4f>;
@group(0) @binding(3) var<storage, read> inputs: array<f32>;
@group(0) @binding(4) var<storage, read> d_inputs: array<f32>;
@group(0) @binding(5) var<storage, read> d_distances: array<f32>;
// `[K][chunks][5]`: with respect to the vector before scaling, to log scales, and the products of the former with `x -
// centre`, row by row.
@group(0) @binding(6) var<storage, read_write> partial: array<vec4f>;

var<workgroup> sums: array<array<vec3f, FRAME_SUMS>, GROUP>;

@compute @workgroup_size(GROUP)
fn sum_frames(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let n = step.n;
    let each = (n + step.chunks - 1u) / step.chunks;
    let end = min((group.x + 1u) * each, n);
    let f = 4u * group.y;
    let inverse_scale = vec3f(frames[f + 1u].w, frames[f + 2u].w, frames[f + 3u].w);
    var own: array<vec3f, FRAME_SUMS>;
    for (var i = group.x * each + lane; i < end; i += GROUP) {
        let at = f * n + i;
        let local = vec3f(inputs[at], inputs[at + n], inputs[at + 2u * n]);
        let norm = inputs[at + 3u * n];
        var radial = 2.0 * d_distances[group.y * n + i];
        if norm > 0.0 {
            radial += d_inputs[at + 3u * n] / norm;
        }
        let d_local = vec3f(d_inputs[at], d_inputs[at + n], d_inputs[at + 2u * n]) + local * radial;
        let d_rotated = d_local * inverse_scale;
        let y = vec3f(params[3u * i], params[3u * i + 1u], params[3u * i + 2u]) - frames[f].xyz;
        own[0] += d_rotated;
        own[1] -= local * d_local;
        own[2] += d_rotated.x * y;
        own[3] += d_rotated.y * y;
        own[4] += d_rotated.z * y;
    }
    sums[lane] = own;
    workgroupBarrier();
    for (var reach = GROUP / 2u; reach > 0u; reach /= 2u) {
        if lane < reach {
            for (var q = 0u; q < FRAME_SUMS; q++) {
                sums[lane][q] += sums[lane + reach][q];
            }
        }
        workgroupBarrier();
    }
    if lane < FRAME_SUMS {
        partial[FRAME_SUMS * (group.y * step.chunks + group.x) + lane] = vec4f(sums[0][lane], 0.0);
    }
}
