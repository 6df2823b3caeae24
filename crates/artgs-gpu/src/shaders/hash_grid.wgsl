// Multi-resolution hash encoding of positions. Same computation as `artgs::articulation::assignment::hash_grid`. Needs
// `step`.

struct Cell {
    low: vec3u,
    fraction: vec3f,
}

fn cell_of(level: Level, point: vec3f) -> Cell {
    let position = point * level.scale + 0.5;
    let low = floor(position);
    return Cell(bitcast<vec3u>(vec3i(low)), position - low);
}

fn offset_of(corner: u32) -> vec3u {
    return vec3u(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
}

fn entry_of(level: Level, p: vec3u) -> u32 {
    var key = p.x + p.y * level.stride_y + p.z * level.stride_z;
    if level.hashed != 0u {
        key = p.x ^ (p.y * HASH_PRIME_Y) ^ (p.z * HASH_PRIME_Z);
    }
    if (level.size & (level.size - 1u)) == 0u {
        return level.begin + (key & (level.size - 1u));
    }
    return level.begin + key % level.size;
}

fn weight_of(cell: Cell, corner: vec3u) -> f32 {
    let along = select(vec3f(1.0) - cell.fraction, cell.fraction, corner == vec3u(1u));
    return along.x * along.y * along.z;
}

// Units of the sums of a level: gradients are summed as 64-bit integers of two words, so that their order does not
// matter. A point adds at most the largest gradient to an entry, its corners together, and all points together at most
// `n` times that, which is 2^30 in the upper word: nothing overflows. The lower word reaches 2^-62 of it.
fn units_per_gradient(largest: f32) -> f32 {
    return 1073741824.0 / (f32(step.n) * largest);
}

// Whether the gradients of a level are large enough to count and finite.
fn usable(largest: f32) -> bool {
    return largest > NEGLIGIBLE && largest * f32(step.n) < LARGEST;
}
