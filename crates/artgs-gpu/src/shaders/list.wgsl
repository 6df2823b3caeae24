// Begin and end of the list of each tile after the sort by tile, and its buckets: ranges that one workgroup of the
// backward pass handles.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> tiles_of: array<u32>;
@group(0) @binding(2) var<storage, read> places: array<u32>;
@group(0) @binding(3) var<storage, read> owners: array<u32>;
@group(0) @binding(4) var<storage, read_write> control: array<u32>;
@group(0) @binding(5) var<storage, read_write> ranges: array<vec2u>;
@group(0) @binding(6) var<storage, read_write> list: array<u32>;
@group(0) @binding(7) var<storage, read_write> bucket_starts: array<u32>;
@group(0) @binding(8) var<storage, read_write> bucket_tiles: array<u32>;
@group(0) @binding(9) var<storage, read_write> arguments: array<u32>;

const THREADS: u32 = WIDE_GROUP;

@compute @workgroup_size(THREADS)
fn delimit(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group_index(group) * THREADS + lane;
    let total = control[TOTAL];
    if i >= total {
        return;
    }
    list[i] = owners[places[i]];
    let tile = tiles_of[i];
    if i == 0u || tiles_of[i - 1u] != tile {
        ranges[tile].x = i;
    }
    if i + 1u == total || tiles_of[i + 1u] != tile {
        ranges[tile].y = i + 1u;
    }
}

fn buckets_of(tile: u32) -> u32 {
    let range = ranges[tile];
    return (range.y - range.x + BUCKET - 1u) / BUCKET;
}

// One workgroup: an exclusive prefix sum over tiles.
@compute @workgroup_size(THREADS)
fn count_buckets(@builtin(local_invocation_index) lane: u32) {
    let tiles = step.tiles.x * step.tiles.y;
    var before = 0u;
    for (var begin = 0u; begin < tiles; begin += THREADS) {
        let tile = begin + lane;
        var own = 0u;
        if tile < tiles {
            own = buckets_of(tile);
        }
        let prefix = exclusive(lane, own);
        if tile < tiles {
            bucket_starts[tile] = before + prefix;
        }
        before += prefix_sums[THREADS - 1u];
        workgroupBarrier();
    }
    if lane == 0u {
        control[BUCKETS] = before;
        set_arguments(BY_BUCKET, before);
    }
}

@compute @workgroup_size(THREADS)
fn name_buckets(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = group_index(group) * THREADS + lane;
    if tile >= step.tiles.x * step.tiles.y {
        return;
    }
    let begin = bucket_starts[tile];
    let count = buckets_of(tile);
    for (var k = 0u; k < count; k++) {
        bucket_tiles[begin + k] = tile;
    }
}
