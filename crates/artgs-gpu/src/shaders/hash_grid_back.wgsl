// Gradients of the entries of the hash grid. Same computation as `HashGrid::backward` in
// `artgs::articulation::assignment::hash_grid`.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> levels: array<Level>;
@group(0) @binding(2) var<storage, read> inputs: array<f32>;
@group(0) @binding(3) var<storage, read> d_inputs: array<f32>;
// Bits of the largest gradient of each level.
@group(0) @binding(4) var<storage, read_write> largest: array<atomic<u32>>;
// Lower and upper word for each feature of each entry.
@group(0) @binding(5) var<storage, read_write> sums: array<atomic<u32>>;

var<workgroup> maxima: array<f32, GROUP>;

fn gradient_of(level: u32, i: u32) -> vec2f {
    let row = 4u * step.parts + FEATURES * level;
    let g = vec2f(d_inputs[row * step.n + i], d_inputs[(row + 1u) * step.n + i]);
    // A Gaussian that is not finite must not affect the grid.
    return select(vec2f(0.0), g, vec2<bool>(finite(g.x), finite(g.y)));
}

@compute @workgroup_size(GROUP)
fn find_largest(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    var most = 0.0;
    if group.y < step.learning_levels {
        for (var i = group.x * GROUP + lane; i < step.n; i += groups.x * GROUP) {
            let g = abs(gradient_of(group.y, i));
            most = max(most, max(g.x, g.y));
        }
    }
    maxima[lane] = most;
    workgroupBarrier();
    for (var reach = GROUP / 2u; reach > 0u; reach /= 2u) {
        if lane < reach {
            maxima[lane] = max(maxima[lane], maxima[lane + reach]);
        }
        workgroupBarrier();
    }
    if lane == 0u {
        // Floats that are not negative are ordered as their bits are.
        atomicMax(&largest[group.y], bitcast<u32>(maxima[0]));
    }
}

// Adds a number, given in units of the upper word.
fn add(at: u32, value: f32) {
    let size = abs(value);
    let whole = floor(size);
    var high = u32(whole);
    var low = u32((size - whole) * 4294967296.0);
    if value < 0.0 {
        high = ~high;
        low = ~low + 1u;
        high += select(0u, 1u, low == 0u);
    }
    if low != 0u {
        let before = atomicAdd(&sums[at], low);
        high += select(0u, 1u, before + low < before);
    }
    if high != 0u {
        atomicAdd(&sums[at + 1u], high);
    }
}

@compute @workgroup_size(GROUP)
fn scatter_gradients(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group.x * GROUP + lane;
    if i >= step.n || group.y >= step.learning_levels {
        return;
    }
    let most = bitcast<f32>(atomicLoad(&largest[group.y]));
    let g = gradient_of(group.y, i);
    if !usable(most) || all(g == vec2f(0.0)) {
        return;
    }
    let level = levels[group.y];
    let at = (4u * step.parts + FEATURES * step.levels) * step.n + i;
    let cell = cell_of(level, vec3f(inputs[at], inputs[at + step.n], inputs[at + 2u * step.n]));
    let scaled = g * units_per_gradient(most);
    for (var corner = 0u; corner < 8u; corner++) {
        let offset = offset_of(corner);
        let entry = entry_of(level, cell.low + offset);
        let part = weight_of(cell, offset) * scaled;
        add(4u * entry, part.x);
        add(4u * entry + 2u, part.y);
    }
}
