// The loss of a rendering against a training image and its gradient. Same computation as `artgs::fit::loss` and the
// second half of `artgs::fit::ssim`. The backward pass of blending starts from its output.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> image: array<u32>;
@group(0) @binding(2) var<storage, read> measured: array<u32>;
@group(0) @binding(3) var<storage, read> frame: array<vec4f>;
@group(0) @binding(4) var<storage, read> frame_depth: array<f32>;
@group(0) @binding(5) var<storage, read> slopes: array<f32>;
@group(0) @binding(6) var<storage, read_write> d_frame: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> remainders: array<f32>;
@group(0) @binding(8) var<storage, read_write> sums: array<vec4f>;

// Slopes of one channel around a tile, and their blur along rows.
var<workgroup> around: array<vec3f, REACH * REACH>;
var<workgroup> rows: array<vec3f, REACH * TILE>;
// Absolute and squared colour difference, depth term, difference of alpha.
var<workgroup> terms: array<vec4f, TILE_PIXELS>;

// Blur of the three slopes of a channel at a pixel: by mean, by square, by product. Only windows in `rect` have slopes.
fn blurred(channel: u32, corner: vec2i, local: vec2u, lane: u32) -> vec3f {
    let area = step.size.x * step.size.y;
    workgroupBarrier();
    for (var k = lane; k < REACH * REACH; k += TILE_PIXELS) {
        let at = corner + vec2i(i32(k % REACH), i32(k / REACH)) - HALF;
        var v = vec3f(0.0);
        if all(at >= vec2i(step.rect.xy)) && all(at < vec2i(step.rect.zw)) {
            let p = 3u * channel * area + u32(at.y) * step.size.x + u32(at.x);
            v = vec3f(slopes[p], slopes[p + area], slopes[p + 2u * area]);
        }
        around[k] = v;
    }
    workgroupBarrier();
    for (var k = lane; k < REACH * TILE; k += TILE_PIXELS) {
        let begin = k / TILE * REACH + k % TILE;
        var sum = vec3f(0.0);
        for (var tap = 0u; tap < TAPS; tap++) {
            sum += WINDOW[tap] * around[begin + tap];
        }
        rows[k] = sum;
    }
    workgroupBarrier();
    var out = vec3f(0.0);
    for (var tap = 0u; tap < TAPS; tap++) {
        out += WINDOW[tap] * rows[(local.y + tap) * TILE + local.x];
    }
    return out;
}

fn depth_count(p: u32) -> u32 {
    return (measured[p / 2u] >> (16u * (p % 2u))) & 0xffffu;
}

// Depth term of a pixel; adds its gradient with respect to depth and alpha.
fn depth_term(p: u32, alpha: f32, by_depth: ptr<function, f32>, by_alpha: ptr<function, f32>) -> f32 {
    if !has(step.flags, DEPTH) {
        return 0.0;
    }
    let count = depth_count(p);
    let covered = (image[p] >> 24u) >= COVERED;
    let unit = step.depth_unit;
    let wanted = f32(count) * step.depth_count;
    if has(step.flags, DEPTH_ACCUMULATED) {
        if count == 0u && covered {
            return 0.0;
        }
        let r = (frame_depth[p] - select(0.0, wanted, covered)) / unit;
        *by_depth = step.depth_step * signum(r) / (unit * (1.0 + abs(r)));
        return log(1.0 + abs(r));
    }
    if count == 0u || !covered || alpha <= MIN_ALPHA {
        return 0.0;
    }
    let z = frame_depth[p] / alpha;
    let r = (z - wanted) / unit;
    let slope = step.depth_step * signum(r) / (unit * (1.0 + abs(r)) * alpha);
    *by_depth = slope;
    *by_alpha -= slope * z;
    return log(1.0 + abs(r));
}

@compute @workgroup_size(TILE, TILE)
fn compare(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let pixel = group.xy * TILE + local.xy;
    let inside = all(pixel < step.size);
    let p = pixel.y * step.size.x + pixel.x;
    var shown = vec4f(0.0);
    var target_color = vec3f(0.0);
    if inside {
        shown = frame[p];
        target_color = image_color(p);
    }
    let d = shown.xyz - target_color;
    var by_color = step.l1_step * vec3f(signum(d.x), signum(d.y), signum(d.z));
    // Windows reach half their size beyond the rectangle. The condition is the same for the whole workgroup.
    let corner = vec2i(group.xy * TILE);
    let in_reach = all(corner + i32(TILE) + HALF > vec2i(step.rect.xy)) && all(corner - HALF < vec2i(step.rect.zw));
    if has(step.flags, SSIM) && in_reach {
        for (var channel = 0u; channel < 3u; channel++) {
            let s = blurred(channel, corner, local.xy, lane);
            by_color[channel] += step.ssim_step * (s.x + 2.0 * shown[channel] * s.y + target_color[channel] * s.z);
        }
    }
    var found = vec4f(0.0);
    if inside {
        let mask = shown.w - image_alpha(p);
        var by_alpha = step.mask_step * signum(mask);
        var by_depth = 0.0;
        let depth = depth_term(p, shown.w, &by_depth, &by_alpha);
        found = vec4f(dot(abs(d), vec3f(1.0)), dot(d, d), depth, abs(mask));
        d_frame[p] = vec4f(by_color, by_depth);
        remainders[p] = by_depth * frame_depth[p] - by_alpha * (1.0 - shown.w) + dot(by_color, shown.xyz);
    }
    terms[lane] = found;
    workgroupBarrier();
    for (var reach = TILE_PIXELS / 2u; reach > 0u; reach /= 2u) {
        if lane < reach {
            terms[lane] += terms[lane + reach];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        sums[group.y * step.tiles.x + group.x] = terms[0];
    }
}
