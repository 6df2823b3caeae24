// Stable radix sort of pairs by `DIGIT_BITS` bits of their keys. Same computation as `artgs_raster::sort`. Every thread
// owns consecutive pairs and a column of counters, so nothing is atomic and the order is that of the input.

@group(0) @binding(0) var<uniform> digit: Digit;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
@group(0) @binding(3) var<storage, read> values: array<u32>;
@group(0) @binding(4) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(5) var<storage, read_write> values_out: array<u32>;
@group(0) @binding(6) var<storage, read_write> histogram: array<u32>;

const THREADS: u32 = GROUP;
// Pairs of a thread.
const EACH: u32 = BLOCK / THREADS;
// Threads that sum the counters of one digit.
const THREADS_PER_DIGIT: u32 = THREADS / DIGITS;

// Pairs with each digit that each thread owns, digit by digit.
var<workgroup> counters: array<u32, DIGITS * THREADS>;
var<workgroup> partial: array<u32, THREADS>;
var<workgroup> digit_starts: array<u32, DIGITS>;

fn block_count() -> u32 {
    return (lengths[0] + BLOCK - 1u) / BLOCK;
}

fn digit_of(key: u32) -> u32 {
    return (key >> digit.shift) & (DIGITS - 1u);
}

fn count_own(block: u32, lane: u32) {
    for (var d = 0u; d < DIGITS; d++) {
        counters[d * THREADS + lane] = 0u;
    }
    let begin = block * BLOCK + lane * EACH;
    let end = min(begin + EACH, lengths[0]);
    for (var i = begin; i < end; i++) {
        counters[digit_of(keys[i]) * THREADS + lane] += 1u;
    }
    workgroupBarrier();
    var sum = 0u;
    for (var k = 0u; k < DIGITS; k++) {
        sum += counters[lane * DIGITS + k];
    }
    partial[lane] = sum;
    workgroupBarrier();
}

@compute @workgroup_size(THREADS)
fn count(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = group_index(group);
    let blocks = block_count();
    count_own(block, lane);
    if lane < DIGITS && block < blocks {
        var sum = 0u;
        for (var k = 0u; k < THREADS_PER_DIGIT; k++) {
            sum += partial[lane * THREADS_PER_DIGIT + k];
        }
        histogram[lane * blocks + block] = sum;
    }
}

// One workgroup: exclusive prefix sum of the histogram.
@compute @workgroup_size(THREADS)
fn scan_digits(@builtin(local_invocation_index) lane: u32) {
    let length = DIGITS * block_count();
    var before = 0u;
    for (var start = 0u; start < length; start += BLOCK) {
        var sum = 0u;
        for (var k = 0u; k < EACH; k++) {
            let i = start + lane * EACH + k;
            if i < length {
                sum += histogram[i];
            }
        }
        var at = before + exclusive(lane, sum);
        before += prefix_sums[THREADS - 1u];
        for (var k = 0u; k < EACH; k++) {
            let i = start + lane * EACH + k;
            if i < length {
                let own = histogram[i];
                histogram[i] = at;
                at += own;
            }
        }
        workgroupBarrier();
    }
}

@compute @workgroup_size(THREADS)
fn scatter(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = group_index(group);
    let blocks = block_count();
    count_own(block, lane);
    var at = exclusive(lane, partial[lane]);
    for (var k = 0u; k < DIGITS; k++) {
        let i = lane * DIGITS + k;
        let own = counters[i];
        counters[i] = at;
        at += own;
    }
    workgroupBarrier();
    if lane < DIGITS && block < blocks {
        digit_starts[lane] = histogram[lane * blocks + block] - counters[lane * THREADS];
    }
    workgroupBarrier();
    let begin = block * BLOCK + lane * EACH;
    let end = min(begin + EACH, lengths[0]);
    for (var i = begin; i < end; i++) {
        let key = keys[i];
        let d = digit_of(key);
        let place = counters[d * THREADS + lane];
        counters[d * THREADS + lane] = place + 1u;
        keys_out[digit_starts[d] + place] = key;
        values_out[digit_starts[d] + place] = values[i];
    }
}
