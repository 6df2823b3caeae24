// Inputs of the perceptron for every Gaussian, `[4 K + 2 L + 3][n]`: position in the frame of each part and its length,
// hash features, coordinates. Same computation as the first half of `Model::forward` in
// `artgs::articulation::assignment::block`.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> params: array<f32>;
// Of each part: centre; rows of the rotation with the inverse scale along each.
@group(0) @binding(2) var<storage, read> frames: array<vec4f>;
@group(0) @binding(3) var<storage, read> levels: array<Level>;
@group(0) @binding(4) var<storage, read> table: array<vec2f>;
@group(0) @binding(5) var<storage, read_write> inputs: array<f32>;

@compute @workgroup_size(GROUP)
fn encode(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group.x * GROUP + lane;
    let n = step.n;
    if i >= n {
        return;
    }
    let x = vec3f(params[3u * i], params[3u * i + 1u], params[3u * i + 2u]);
    if group.y < step.parts {
        let f = 4u * group.y;
        let y = x - frames[f].xyz;
        let rotated = vec3f(dot(frames[f + 1u].xyz, y), dot(frames[f + 2u].xyz, y), dot(frames[f + 3u].xyz, y));
        let local = rotated * vec3f(frames[f + 1u].w, frames[f + 2u].w, frames[f + 3u].w);
        let at = f * n + i;
        inputs[at] = local.x;
        inputs[at + n] = local.y;
        inputs[at + 2u * n] = local.z;
        inputs[at + 3u * n] = sqrt(dot(local, local));
        return;
    }
    let coordinates = (x - step.origin) * step.coordinate_scale;
    let l = group.y - step.parts;
    let at = (4u * step.parts + FEATURES * l) * n + i;
    if l == step.levels {
        inputs[at] = coordinates.x;
        inputs[at + n] = coordinates.y;
        inputs[at + 2u * n] = coordinates.z;
        return;
    }
    let level = levels[l];
    let cell = cell_of(level, coordinates);
    var sum = vec2f(0.0);
    for (var corner = 0u; corner < 8u; corner++) {
        let offset = offset_of(corner);
        sum += weight_of(cell, offset) * table[entry_of(level, cell.low + offset)];
    }
    inputs[at] = sum.x;
    inputs[at + n] = sum.y;
}
