// Structural similarity, first half: its value and its derivatives by the blurred mean, square and product, for one
// channel of a tile of windows. Same computation as `artgs::fit::ssim`.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> image: array<u32>;
@group(0) @binding(2) var<storage, read> frame: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> slopes: array<f32>;
@group(0) @binding(4) var<storage, read_write> sums: array<vec4f>;

// Pixels of a tile and half a window around it: rendering and training image.
var<workgroup> pixels: array<vec2f, REACH * REACH>;
// Blurred along rows: x, y, x^2 + y^2, x y.
var<workgroup> rows: array<vec4f, REACH * TILE>;
var<workgroup> similarities: array<f32, TILE_PIXELS>;

@compute @workgroup_size(TILE, TILE)
fn slope(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let channel = group.z;
    let corner = vec2i(step.rect.xy + group.xy * TILE);
    let size = vec2i(step.size);
    for (var k = lane; k < REACH * REACH; k += TILE_PIXELS) {
        let at = corner + vec2i(i32(k % REACH), i32(k / REACH)) - HALF;
        var pair = vec2f(0.0);
        if all(at >= vec2i(0)) && all(at < size) {
            let p = u32(at.y * size.x + at.x);
            pair = vec2f(frame[p][channel], image_color(p)[channel]);
        }
        pixels[k] = pair;
    }
    workgroupBarrier();
    for (var k = lane; k < REACH * TILE; k += TILE_PIXELS) {
        let begin = k / TILE * REACH + k % TILE;
        var sum = vec4f(0.0);
        for (var tap = 0u; tap < TAPS; tap++) {
            let v = pixels[begin + tap];
            sum += WINDOW[tap] * vec4f(v.x, v.y, v.x * v.x + v.y * v.y, v.x * v.y);
        }
        rows[k] = sum;
    }
    workgroupBarrier();
    var m = vec4f(0.0);
    for (var tap = 0u; tap < TAPS; tap++) {
        m += WINDOW[tap] * rows[(local.y + tap) * TILE + local.x];
    }
    let product = m.x * m.y;
    let squares = m.x * m.x + m.y * m.y;
    let a1 = 2.0 * product + SSIM_C1;
    let a2 = 2.0 * (m.w - product) + SSIM_C2;
    let r1 = 1.0 / (squares + SSIM_C1);
    let r2 = 1.0 / (m.z - squares + SSIM_C2);
    let value = a1 * a2 * r1 * r2;
    let window = step.rect.xy + group.xy * TILE + local.xy;
    let inside = all(window < step.rect.zw);
    if inside {
        let area = step.size.x * step.size.y;
        let at = 3u * channel * area + window.y * step.size.x + window.x;
        slopes[at] = 2.0 * (m.y * (a2 - a1) * r1 * r2 + m.x * value * (r2 - r1));
        slopes[at + area] = -(value * r2);
        slopes[at + 2u * area] = 2.0 * a1 * r1 * r2;
    }
    similarities[lane] = select(0.0, value, inside);
    workgroupBarrier();
    for (var reach = TILE_PIXELS / 2u; reach > 0u; reach /= 2u) {
        if lane < reach {
            similarities[lane] += similarities[lane + reach];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        let across = (step.rect.z - step.rect.x + TILE - 1u) / TILE;
        let down = (step.rect.w - step.rect.y + TILE - 1u) / TILE;
        sums[(channel * down + group.y) * across + group.x] = vec4f(similarities[0], 0.0, 0.0, 0.0);
    }
}
