// Projects Gaussians and counts the tiles of each. Same computation as `artgs_raster::project` and the warp before it.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> params: array<f32>;
@group(0) @binding(2) var<storage, read> labels: array<u32>;
@group(0) @binding(3) var<storage, read> motions: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> flats: array<Flat>;
@group(0) @binding(5) var<storage, read_write> keys: array<u32>;
@group(0) @binding(6) var<storage, read_write> order: array<u32>;
@group(0) @binding(7) var<storage, read_write> counts: array<u32>;

// False if it is too near, too faint, degenerate or outside the image.
fn flatten(i: u32, out: ptr<function, Flat>) -> bool {
    let at = placed(i);
    let depth = dot(step.row_z.xyz, at.mean) + step.row_z.w;
    let logit = params[at_logit(step.n, i)];
    let log2_opacity = log2(1.0 / (1.0 + exp(-logit)));
    let reach = log2_opacity - LOG2_CUT;
    if !(depth > step.near && finite(depth) && reach >= 0.0) {
        return false;
    }
    let c = chain_of(i, at);
    let center = step.focal * c.ratio + step.principal;
    if !(c.determinant > 0.0 && finite(c.determinant) && finite(center.x) && finite(center.y)) {
        return false;
    }
    // alpha >= 1/255 within the Mahalanobis distance sqrt(2 ln(255 opacity)); the slack covers rounding.
    let distance_squared = 2.0 * LN_2 * (reach + SLACK);
    let extent = sqrt(distance_squared * c.covariance.xz) + SLACK_PIXELS;
    let size = vec2f(step.size);
    if any(center + extent < vec2f(0.5)) || any(center - extent > size - 0.5) {
        return false;
    }
    let inverse = LOG2_E / c.determinant;
    let sh = at_sh(step.n, step.sh_stride, i);
    let color = sh_color(step.sh_degree, to_frame(i, normalize(at.mean - step.eye)), sh);
    (*out).center = center;
    (*out).xx = -0.5 * inverse * c.covariance.z;
    (*out).xy = inverse * c.covariance.y;
    (*out).yy = -0.5 * inverse * c.covariance.x;
    (*out).log2_opacity = log2_opacity;
    (*out).depth = depth;
    (*out).discriminant = LOG2_E * inverse;
    (*out).rgb = max(color, vec3f(0.0));
    (*out).half_x = extent.x;
    (*out).half_y = extent.y;
    return true;
}

@compute @workgroup_size(WIDE_GROUP)
fn project(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group_index(group) * WIDE_GROUP + lane;
    if i >= step.n {
        return;
    }
    var flat: Flat;
    let drawn = flatten(i, &flat);
    order[i] = i;
    if !drawn {
        keys[i] = NOT_DRAWN;
        counts[i] = 0u;
        return;
    }
    flats[i] = flat;
    // Positive floats are ordered as their bits are.
    keys[i] = bitcast<u32>(flat.depth);
    let rows = tile_rows(flat);
    var count = 0u;
    for (var row = rows.x; row < rows.y; row++) {
        let columns = tile_columns(flat, row, rows);
        count += columns.y - columns.x;
    }
    counts[i] = count;
}
