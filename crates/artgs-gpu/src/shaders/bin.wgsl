// Lists of the Gaussians of every tile, front to back. Same computation as `artgs_raster::bin`.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> flats: array<Flat>;
@group(0) @binding(2) var<storage, read_write> counts: array<u32>;
@group(0) @binding(3) var<storage, read> starts: array<u32>;
@group(0) @binding(4) var<storage, read> control: array<u32>;
@group(0) @binding(5) var<storage, read_write> tiles_of: array<u32>;
@group(0) @binding(6) var<storage, read_write> places: array<u32>;
@group(0) @binding(7) var<storage, read_write> owners: array<u32>;
@group(0) @binding(8) var<storage, read_write> ranges: array<vec2u>;

fn write(at: u32, tile: u32, owner: u32) {
    tiles_of[at] = tile;
    places[at] = at;
    owners[at] = owner;
}

// Writes the intersections of every Gaussian at its offset of the prefix sum; clears the lists of the last rendering.
@compute @workgroup_size(WIDE_GROUP)
fn emit(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group) * WIDE_GROUP + lane;
    let threads = groups.x * groups.y * WIDE_GROUP;
    for (var tile = i; tile <= step.tiles.x * step.tiles.y; tile += threads) {
        ranges[tile] = vec2u(0u);
    }
    if i >= step.n || control[TOTAL] == 0u {
        return;
    }
    if counts[i] == 0u {
        return;
    }
    let flat = flats[i];
    let start = starts[i];
    let end = start + counts[i];
    var at = start;
    let rows = tile_rows(flat);
    for (var row = rows.x; row < rows.y; row++) {
        let columns = tile_columns(flat, row, rows);
        for (var column = columns.x; column < columns.y && at < end; column++) {
            write(at, row * step.tiles.x + column, i);
            at += 1u;
        }
    }
    // The kernel that counted may have been compiled to different rounding. Unused entries get a tile after the last
    // one.
    counts[i] = at - start;
    for (; at < end; at++) {
        write(at, step.tiles.x * step.tiles.y, i);
    }
}
