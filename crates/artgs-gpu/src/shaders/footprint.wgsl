// Which tiles a Gaussian touches. Same computation as `Grid` and `Ellipse` in `artgs_raster::bin`, in whole tiles.
// Needs `step`.

// First tile along an axis with a pixel centre in `low ..= high`, and one past the last.
fn tile_range(low: f32, high: f32, size: u32) -> vec2u {
    let most = f32(size);
    let first = u32(ceil(clamp(low - 0.5, 0.0, most)));
    // One past the last pixel: truncation is the floor of what is not negative.
    let end = u32(clamp(high + 0.5, 0.0, most));
    if first >= end {
        return vec2u(0u);
    }
    return vec2u(first / TILE, (end - 1u) / TILE + 1u);
}

fn tile_rows(flat: Flat) -> vec2u {
    return tile_range(flat.center.y - flat.half_y, flat.center.y + flat.half_y, step.size.y);
}

// Tiles of a row that the ellipse touches in which alpha reaches 1/255; `rows` are all rows it touches.
fn tile_columns(flat: Flat, row: u32, rows: vec2u) -> vec2u {
    let whole = tile_range(flat.center.x - flat.half_x, flat.center.x + flat.half_x, step.size.x);
    // One row or column of tiles: the bounding box gives the range.
    if rows.y - rows.x <= 1u || whole.y - whole.x <= 1u {
        return whole;
    }
    let inverse = -0.5 / flat.xx;
    let slope = flat.xy * inverse;
    let reach = 2.0 * inverse * (flat.log2_opacity - LOG2_CUT + SLACK);
    let curvature = flat.discriminant * inverse * inverse;
    // Height of the rightmost point over the centre; the leftmost one is its mirror image.
    let peak = -0.5 * flat.xy / flat.yy * flat.half_x;
    let top = f32(row * TILE) + 0.5;
    let low = max(top - flat.center.y, -flat.half_y);
    let high = min(top + f32(TILE - 1u) - flat.center.y, flat.half_y);
    if low > high {
        return vec2u(0u);
    }
    // The right border is concave in dy: over an interval it is farthest at the point nearest to its peak.
    let l = clamp(-peak, low, high);
    let r = clamp(peak, low, high);
    let left = max(slope * l - sqrt(max(reach - curvature * l * l, 0.0)), -flat.half_x);
    let right = min(slope * r + sqrt(max(reach - curvature * r * r, 0.0)), flat.half_x);
    return tile_range(flat.center.x + left - SLACK_PIXELS, flat.center.x + right + SLACK_PIXELS, step.size.x);
}
