// One Adam update of frames and perceptron of the learned assignment. Same computation as the update in
// `artgs::articulation::assignment::centres`.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> control: array<u32>;
@group(0) @binding(2) var<storage, read> d_frames: array<vec4f>;
@group(0) @binding(3) var<storage, read> d_layers: array<f32>;
@group(0) @binding(4) var<storage, read> part_means: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> values: array<f32>;
@group(0) @binding(6) var<storage, read_write> first: array<f32>;
@group(0) @binding(7) var<storage, read_write> second: array<f32>;

fn update(i: u32, g: f32) {
    let m = first[i] + ADAM_GAIN_1 * (g - first[i]);
    let v = second[i] + ADAM_GAIN_2 * (g * g - second[i]);
    first[i] = m;
    second[i] = v;
    let corrections = step.assign_corrections;
    values[i] -= step.assign_rate * (m / corrections.x) / (sqrt(v / corrections.y) + ADAM_EPSILON);
}

// Gradient with respect to a unit quaternion, given that with respect to the rows of its matrix.
fn rows_adjoint(q: vec4f, x: vec3f, y: vec3f, z: vec3f) -> vec4f {
    let turn = vec3f(z.y - y.z, x.z - z.x, y.x - x.y);
    let sxy = x.y + y.x;
    let sxz = x.z + z.x;
    let syz = y.z + z.y;
    return 2.0 * vec4f(
        dot(q.yzw, turn),
        q.x * turn.x + q.z * sxy + q.w * sxz - 2.0 * q.y * (y.y + z.z),
        q.x * turn.y + q.y * sxy + q.w * syz - 2.0 * q.z * (x.x + z.z),
        q.x * turn.z + q.y * sxz + q.z * syz - 2.0 * q.w * (x.x + y.y),
    );
}

fn update_frame(k: u32) {
    var sums: array<vec3f, FRAME_SUMS>;
    for (var c = 0u; c < step.chunks; c++) {
        for (var q = 0u; q < FRAME_SUMS; q++) {
            sums[q] += d_frames[FRAME_SUMS * (k * step.chunks + c) + q].xyz;
        }
    }
    let f = FRAME * k;
    let turn = turn_of(vec4f(values[f + 6u], values[f + 7u], values[f + 8u], values[f + 9u]));
    var d_centre = -(matrix(conjugate(turn.unit)) * sums[0]);
    if has(step.flags, CENTRE) {
        let centre = vec3f(values[f], values[f + 1u], values[f + 2u]);
        d_centre += 2.0 * step.centre_scale * (centre - part_means[2u * k].xyz);
    }
    let d_unit = rows_adjoint(turn.unit, sums[2], sums[3], sums[4]);
    let d_raw = (d_unit - turn.unit * dot(turn.unit, d_unit)) / turn.length;
    for (var a = 0u; a < 3u; a++) {
        update(f + a, d_centre[a]);
        update(f + 3u + a, sums[1][a]);
    }
    for (var c = 0u; c < 4u; c++) {
        update(f + 6u + c, d_raw[c]);
    }
}

@compute @workgroup_size(PART_GROUP)
fn update_assignment(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    if control[OVERFLOW] != 0u {
        return;
    }
    let i = group.x * PART_GROUP + lane;
    if i < step.parts {
        update_frame(i);
        return;
    }
    let inputs = 4u * step.parts + FEATURES * step.levels + 3u;
    let total = step.hidden * (inputs + 1u) + 2u * step.parts * (step.hidden + 1u);
    let p = i - step.parts;
    if p >= total {
        return;
    }
    var g = 0.0;
    for (var c = 0u; c < step.chunks; c++) {
        g += d_layers[c * total + p];
    }
    update(FRAME * step.parts + p, g);
}
