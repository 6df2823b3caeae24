// One workgroup: frames as `encode` reads them; resets the largest gradients of the last step.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> values: array<f32>;
@group(0) @binding(2) var<storage, read_write> frames: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> largest: array<u32>;

@compute @workgroup_size(PART_GROUP)
fn make_frames(@builtin(local_invocation_index) lane: u32) {
    for (var l = lane; l < step.levels; l += PART_GROUP) {
        largest[l] = 0u;
    }
    for (var k = lane; k < step.parts; k += PART_GROUP) {
        let f = FRAME * k;
        let turn = turn_of(vec4f(values[f + 6u], values[f + 7u], values[f + 8u], values[f + 9u]));
        var rows = matrix(conjugate(turn.unit));
        frames[4u * k] = vec4f(values[f], values[f + 1u], values[f + 2u], 0.0);
        for (var a = 0u; a < 3u; a++) {
            frames[4u * k + 1u + a] = vec4f(rows[a], exp(-values[f + 3u + a]) / step.scale_factor);
        }
    }
}
