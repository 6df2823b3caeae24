// Adjoint of blending. Same computation as `backward` in `artgs_raster::blend`. One workgroup handles one bucket of a
// tile. Every thread holds a Gaussian and its sums in registers. The pixels move from thread to thread, one thread per
// tick, with their transmittance and remainder. No sum is shared, so nothing is atomic. `transfer_by_memory.wgsl` or
// `transfer_by_subgroup.wgsl` moves the pixels.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> flats: array<Flat>;
@group(0) @binding(2) var<storage, read> ranges: array<vec2u>;
@group(0) @binding(3) var<storage, read> list: array<u32>;
@group(0) @binding(4) var<storage, read> places: array<u32>;
@group(0) @binding(5) var<storage, read> bucket_starts: array<u32>;
@group(0) @binding(6) var<storage, read> bucket_tiles: array<u32>;
@group(0) @binding(7) var<storage, read> bucket_sums: array<vec4f>;
@group(0) @binding(8) var<storage, read> bucket_depth: array<f32>;
@group(0) @binding(9) var<storage, read> d_frame: array<vec4f>;
@group(0) @binding(10) var<storage, read> remainders: array<f32>;
@group(0) @binding(11) var<storage, read> tile_ends: array<u32>;
@group(0) @binding(12) var<storage, read> control: array<u32>;
@group(0) @binding(13) var<storage, read_write> cells: array<vec4f>;

// Of every pixel: gradients of colour and depth, transmittance, and remainder. The remainder is the sum of `w_j v_j`
// over the Gaussians behind, plus `v_T T`.
var<workgroup> pixel_gradients: array<vec4f, TILE_PIXELS>;
var<workgroup> transmittances: array<f32, TILE_PIXELS>;
var<workgroup> tile_remainders: array<f32, TILE_PIXELS>;

// A pixel between two threads.
struct Pixel {
    t: f32,
    rest: f32,
}

fn load_pixel(p: u32, tile: u32, bucket: u32, first: bool) {
    let pixel = vec2u(tile % step.tiles.x, tile / step.tiles.x) * TILE + vec2u(p % TILE, p / TILE);
    pixel_gradients[p] = vec4f(0.0);
    transmittances[p] = 0.0;
    tile_remainders[p] = 0.0;
    if pixel.x >= step.size.x || pixel.y >= step.size.y {
        return;
    }
    let at = pixel.y * step.size.x + pixel.x;
    let v = d_frame[at];
    var t = 1.0;
    var rest = remainders[at];
    if !first {
        let slot = bucket * TILE_PIXELS + p;
        let sum = bucket_sums[slot];
        t = sum.w;
        rest -= dot(v, vec4f(sum.xyz, bucket_depth[slot]));
    }
    pixel_gradients[p] = v;
    transmittances[p] = t;
    tile_remainders[p] = rest;
}

@compute @workgroup_size(BUCKET)
fn blend_back(@builtin(workgroup_id) group: vec3u, @builtin(LANE) lane: u32) {
    let bucket = group_index(group);
    if bucket >= control[BUCKETS] {
        return;
    }
    let tile = bucket_tiles[bucket];
    let range = ranges[tile];
    let begin = (bucket - bucket_starts[tile]) * BUCKET;
    let i = range.x + begin + lane;
    let has_gaussian = i < range.y;
    var first_sums = vec4f(0.0);
    var second_sums = vec4f(0.0);
    var color_sums = vec4f(0.0);
    // Behind the last Gaussian of every pixel all sums are 0.
    if begin < tile_ends[tile] {
        for (var p = lane; p < TILE_PIXELS; p += BUCKET) {
            load_pixel(p, tile, bucket, begin == 0u);
        }
        var flat: Flat;
        flat.log2_opacity = -1000.0;
        if has_gaussian {
            flat = flats[list[i]];
        }
        let color = vec4f(flat.rgb, flat.depth);
        let corner = vec2f(vec2u(tile % step.tiles.x, tile / step.tiles.x) * TILE) + 0.5;
        workgroupBarrier();
        var pixel_state: Pixel;
        for (var tick = 0u; tick < TILE_PIXELS + BUCKET - 1u; tick++) {
            let p = tick - lane;
            let has_pixel = tick >= lane && p < TILE_PIXELS;
            pixel_state = receive(pixel_state, p, has_pixel, lane);
            if has_pixel && pixel_state.t >= TRANSMITTANCE_MIN {
                let d = corner + vec2f(f32(p % TILE), f32(p / TILE)) - flat.center;
                let e = exponent(flat, d);
                if e >= LOG2_CUT {
                    let v = pixel_gradients[p];
                    let raw = exp2(e);
                    let alpha = min(raw, ALPHA_MAX);
                    let weight = alpha * pixel_state.t;
                    let value = dot(v, color);
                    pixel_state.rest -= weight * value;
                    let d_alpha = pixel_state.t * value - pixel_state.rest / (1.0 - alpha);
                    let g = select(0.0, alpha * d_alpha, raw <= ALPHA_MAX);
                    pixel_state.t -= weight;
                    first_sums += g * vec4f(1.0, d.x, d.y, d.x * d.x);
                    second_sums += vec4f(g * vec2f(d.x * d.y, d.y * d.y), weight * v.x, weight * v.y);
                    color_sums += vec4f(weight * v.z, weight * v.w, 0.0, 0.0);
                }
            }
            send(pixel_state, p, has_pixel);
        }
    }
    if has_gaussian {
        let at = 3u * places[i];
        cells[at] = first_sums;
        cells[at + 1u] = second_sums;
        cells[at + 2u] = color_sums;
    }
}
