// One Adam update of every entry of the levels that learn. Same computation as `HashGrid::adam_step`, which visits only
// entries with a gradient and updates the others when it reads them.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> control: array<u32>;
@group(0) @binding(2) var<storage, read> levels: array<Level>;
@group(0) @binding(3) var<storage, read> largest: array<u32>;
@group(0) @binding(4) var<storage, read_write> sums: array<vec4u>;
@group(0) @binding(5) var<storage, read_write> table: array<vec2f>;
// First moments, second moments.
@group(0) @binding(6) var<storage, read_write> moments: array<vec4f>;

// The number that two words hold, in units of the upper one.
fn number_of(words: vec2u) -> f32 {
    var low = words.x;
    var high = words.y;
    let negative = (high & 0x80000000u) != 0u;
    if negative {
        high = ~high;
        low = ~low + 1u;
        high += select(0u, 1u, low == 0u);
    }
    let size = f32(high) + f32(low) / 4294967296.0;
    return select(size, -size, negative);
}

@compute @workgroup_size(WIDE_GROUP)
fn update_grid(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    if group.y >= step.learning_levels {
        return;
    }
    let level = levels[group.y];
    let most = bitcast<f32>(largest[group.y]);
    let corrections = step.assign_corrections;
    for (var e = group.x * WIDE_GROUP + lane; e < level.size; e += groups.x * WIDE_GROUP) {
        let i = level.begin + e;
        let words = sums[i];
        if any(words != vec4u(0u)) {
            sums[i] = vec4u(0u);
        }
        let before = moments[i];
        if control[OVERFLOW] != 0u || (all(words == vec4u(0u)) && all(before == vec4f(0.0))) {
            continue;
        }
        var g = vec2f(0.0);
        if usable(most) {
            g = vec2f(number_of(words.xy), number_of(words.zw)) / units_per_gradient(most);
        }
        var m = ADAM_BETA_1 * before.xy + ADAM_GAIN_1 * g;
        var v = ADAM_BETA_2 * before.zw + ADAM_GAIN_2 * g * g;
        m = select(m, vec2f(0.0), abs(m) < vec2f(FLUSH));
        v = select(v, vec2f(0.0), v < vec2f(FLUSH));
        moments[i] = vec4f(m, v);
        table[i] -= step.assign_rate * (m / corrections.x) / (sqrt(v) * inverseSqrt(corrections.y) + ADAM_EPSILON);
    }
}
