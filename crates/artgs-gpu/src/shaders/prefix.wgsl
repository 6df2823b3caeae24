// Prefix sums within a workgroup of `THREADS` threads.

var<workgroup> prefix_sums: array<u32, THREADS>;

// Exclusive prefix sum of one value per thread; the last element of `prefix_sums` is the total.
fn exclusive(lane: u32, value: u32) -> u32 {
    prefix_sums[lane] = value;
    workgroupBarrier();
    for (var reach = 1u; reach < THREADS; reach *= 2u) {
        var left = 0u;
        if lane >= reach {
            left = prefix_sums[lane - reach];
        }
        workgroupBarrier();
        prefix_sums[lane] += left;
        workgroupBarrier();
    }
    return prefix_sums[lane] - value;
}
