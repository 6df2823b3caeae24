// One-sided Chamfer distance from moved Gaussians to targets in a uniform grid. Same computation as
// `artgs::published::chamfer` and its call in `artgs::fit::deform`: only motions and weights get gradients.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> params: array<f32>;
@group(0) @binding(2) var<storage, read> labels: array<u32>;
@group(0) @binding(3) var<storage, read> motions: array<vec4f>;
@group(0) @binding(4) var<uniform> grids: array<Grid, 2>;
// Where the points of each cell begin, x fastest, and one past the last; both states one after the other.
@group(0) @binding(5) var<storage, read> cells: array<u32>;
@group(0) @binding(6) var<storage, read> points: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> d_motions: array<vec4f>;
// Sums of squared distances over workgroups.
@group(0) @binding(8) var<storage, read_write> squares: array<f32>;
@group(0) @binding(9) var<storage, read_write> part_terms: array<PartTerms>;

// Nearest point so far, squared distance in w.
fn nearest_in(best: vec4f, x: vec3f, begin: u32, end: u32) -> vec4f {
    var nearest = best;
    for (var k = cells[begin]; k < cells[end]; k++) {
        let y = points[k].xyz;
        let square = dot(x - y, x - y);
        if square < nearest.w {
            nearest = vec4f(y, square);
        }
    }
    return nearest;
}

// Searches rings of cells around that of `x`, or around the nearest one to it, until no nearer point is possible:
// outside ring `r`, points are at least `r` cell sides from `x`, plus the distance of `x` from the grid.
fn nearest_of(grid: Grid, x: vec3f) -> vec4f {
    let size = vec3i(grid.size);
    let cell = (x - grid.origin) / grid.side;
    let own = vec3i(clamp(floor(cell), vec3f(0.0), vec3f(size - 1)));
    let outside = x - clamp(x, grid.origin, grid.origin + grid.side * vec3f(size));
    var best = vec4f(x, LARGEST);
    let last = max(size.x, max(size.y, size.z));
    for (var r = 0; r < last; r++) {
        let low = max(own - r, vec3i(0));
        let high = min(own + r, size - 1);
        for (var z = low.z; z <= high.z; z++) {
            for (var y = low.y; y <= high.y; y++) {
                let row = grid.begin + u32((z * size.y + y) * size.x);
                if abs(z - own.z) == r || abs(y - own.y) == r {
                    best = nearest_in(best, x, row + u32(low.x), row + u32(high.x) + 1u);
                } else {
                    if own.x - r >= 0 {
                        best = nearest_in(best, x, row + u32(own.x - r), row + u32(own.x - r) + 1u);
                    }
                    if own.x + r < size.x {
                        best = nearest_in(best, x, row + u32(own.x + r), row + u32(own.x + r) + 1u);
                    }
                }
            }
        }
        // A little less than the bound, because of rounding in the choice of cells.
        let reach = 0.999 * f32(r) * grid.side;
        if best.w <= reach * reach + dot(outside, outside) {
            break;
        }
    }
    return best;
}

// Adds the gradient of the distance between a Gaussian and its target to the gradient of its motion; returns the
// squared distance.
fn pulled(i: u32) -> f32 {
    let at = placed(i).mean;
    if !(finite(at.x) && finite(at.y) && finite(at.z)) {
        return 0.0;
    }
    let nearest = nearest_of(grids[step.pose], at);
    let pull = 2.0 * step.chamfer_share * (at - nearest.xyz);
    let d = motion_adjoint(motion_of(i), canonical(i).mean, pull, vec4f(0.0));
    d_motions[2u * i] += d.r;
    d_motions[2u * i + 1u] += d.s;
    return nearest.w;
}

var<workgroup> own: array<f32, GROUP>;

// Sum over the threads of a workgroup, in `own[0]`.
fn sum_up(lane: u32, value: f32) {
    own[lane] = value;
    workgroupBarrier();
    for (var reach = GROUP / 2u; reach > 0u; reach /= 2u) {
        if lane < reach {
            own[lane] += own[lane + reach];
        }
        workgroupBarrier();
    }
}

@compute @workgroup_size(GROUP)
fn chamfer(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group.x * GROUP + lane;
    var square = 0.0;
    if i < step.n && has(step.flags, CHAMFER) && grids[step.pose].count > 0u {
        square = pulled(i);
    }
    sum_up(lane, square);
    if lane == 0u {
        squares[group.x] = own[0];
    }
}

// One workgroup.
@compute @workgroup_size(GROUP)
fn sum_chamfer(@builtin(local_invocation_index) lane: u32) {
    var sum = 0.0;
    for (var k = lane; k < (step.n + GROUP - 1u) / GROUP; k += GROUP) {
        sum += squares[k];
    }
    sum_up(lane, sum);
    if lane == 0u {
        part_terms[step.slot].chamfer = step.chamfer_share * own[0];
    }
}
