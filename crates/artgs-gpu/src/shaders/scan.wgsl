// Where the intersections of each Gaussian begin, in order of depth: an exclusive prefix sum in three dispatches.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> order: array<u32>;
@group(0) @binding(2) var<storage, read> counts: array<u32>;
@group(0) @binding(3) var<storage, read_write> sums: array<u32>;
@group(0) @binding(4) var<storage, read_write> starts: array<u32>;
@group(0) @binding(5) var<storage, read_write> control: array<u32>;
@group(0) @binding(6) var<storage, read_write> arguments: array<u32>;

const THREADS: u32 = WIDE_GROUP;
// Elements of a thread.
const EACH: u32 = BLOCK / THREADS;

// Intersections of the Gaussian at a rank of the order of depth.
fn count_at(rank: u32) -> u32 {
    if rank >= step.n {
        return 0u;
    }
    return counts[order[rank]];
}

@compute @workgroup_size(THREADS)
fn reduce_blocks(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let begin = group.x * BLOCK + lane * EACH;
    var sum = 0u;
    for (var k = 0u; k < EACH; k++) {
        sum += count_at(begin + k);
    }
    _ = exclusive(lane, sum);
    if lane == THREADS - 1u {
        sums[group.x] = prefix_sums[lane];
    }
}

@compute @workgroup_size(THREADS)
fn scan_sums(@builtin(local_invocation_index) lane: u32) {
    let blocks = (step.n + BLOCK - 1u) / BLOCK;
    var before = 0u;
    for (var begin = 0u; begin < blocks; begin += THREADS) {
        let i = begin + lane;
        var value = 0u;
        if i < blocks {
            value = sums[i];
        }
        let prefix = exclusive(lane, value);
        if i < blocks {
            sums[i] = before + prefix;
        }
        before += prefix_sums[THREADS - 1u];
        workgroupBarrier();
    }
    if lane == 0u {
        control[NEEDED] = max(control[NEEDED], before);
        if before > step.capacity {
            control[OVERFLOW] = 1u;
        }
        // After an overflow nothing is drawn and nothing changes until the host has enlarged the buffers.
        let total = select(before, 0u, control[OVERFLOW] != 0u);
        control[TOTAL] = total;
        set_arguments(BY_BLOCK, (total + BLOCK - 1u) / BLOCK);
        set_arguments(BY_INTERSECTION, (total + WIDE_GROUP - 1u) / WIDE_GROUP);
    }
}

@compute @workgroup_size(THREADS)
fn apply(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let begin = group.x * BLOCK + lane * EACH;
    var sum = 0u;
    for (var k = 0u; k < EACH; k++) {
        sum += count_at(begin + k);
    }
    var at = sums[group.x] + exclusive(lane, sum);
    for (var k = 0u; k < EACH; k++) {
        let rank = begin + k;
        if rank < step.n {
            starts[order[rank]] = at;
            at += count_at(rank);
        }
    }
}
