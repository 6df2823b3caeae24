// Blends the Gaussians of a tile front to back. Same computation as `forward` in `artgs_raster::blend`. It stores the
// sums of every pixel at the beginning of every bucket, so that the backward pass can handle buckets in parallel.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> flats: array<Flat>;
@group(0) @binding(2) var<storage, read> ranges: array<vec2u>;
@group(0) @binding(3) var<storage, read> list: array<u32>;
@group(0) @binding(4) var<storage, read> bucket_starts: array<u32>;
@group(0) @binding(5) var<storage, read_write> frame: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> frame_depth: array<f32>;
@group(0) @binding(7) var<storage, read_write> bucket_sums: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> bucket_depth: array<f32>;
@group(0) @binding(9) var<storage, read_write> tile_ends: array<u32>;

const BATCH: u32 = 64u;

struct Drawn {
    center: vec2f,
    xx: f32,
    xy: f32,
    yy: f32,
    log2_opacity: f32,
    pad: vec2f,
    color: vec4f,
}

var<workgroup> batch: array<Drawn, BATCH>;
var<workgroup> unfinished: atomic<u32>;
var<workgroup> any_unfinished: u32;
var<workgroup> end: atomic<u32>;

@compute @workgroup_size(TILE, TILE)
fn blend(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let tile = group.y * step.tiles.x + group.x;
    let pixel = group.xy * TILE + local.xy;
    let inside = pixel.x < step.size.x && pixel.y < step.size.y;
    let at = vec2f(pixel) + 0.5;
    let range = ranges[tile];
    let first_bucket = bucket_starts[tile];
    var t = 1.0;
    var sum = vec4f(0.0);
    var last = 0u;
    if lane == 0u {
        atomicStore(&end, 0u);
    }
    for (var begin = range.x; begin < range.y; begin += BATCH) {
        if lane == 0u {
            atomicStore(&unfinished, 0u);
        }
        let filled = min(BATCH, range.y - begin);
        if lane < filled {
            let flat = flats[list[begin + lane]];
            let color = vec4f(flat.rgb, flat.depth);
            batch[lane] = Drawn(flat.center, flat.xx, flat.xy, flat.yy, flat.log2_opacity, vec2f(0.0), color);
        }
        workgroupBarrier();
        for (var k = 0u; k < filled; k++) {
            let place = begin - range.x + k;
            if place % BUCKET == 0u && place > 0u {
                let slot = (first_bucket + place / BUCKET) * TILE_PIXELS + lane;
                bucket_sums[slot] = vec4f(sum.xyz, t);
                bucket_depth[slot] = sum.w;
            }
            let g = batch[k];
            let d = at - g.center;
            let e = g.log2_opacity + g.xx * d.x * d.x + g.xy * d.x * d.y + g.yy * d.y * d.y;
            if e >= LOG2_CUT && t >= TRANSMITTANCE_MIN {
                let weight = min(exp2(e), ALPHA_MAX) * t;
                t -= weight;
                sum += weight * g.color;
                last = place + 1u;
            }
        }
        if inside && t >= TRANSMITTANCE_MIN {
            atomicStore(&unfinished, 1u);
        }
        workgroupBarrier();
        if lane == 0u {
            any_unfinished = atomicLoad(&unfinished);
        }
        if workgroupUniformLoad(&any_unfinished) == 0u {
            break;
        }
    }
    if inside {
        atomicMax(&end, last);
        let p = pixel.y * step.size.x + pixel.x;
        frame[p] = vec4f(sum.xyz + t * step.background, 1.0 - t);
        frame_depth[p] = sum.w;
    }
    workgroupBarrier();
    if lane == 0u {
        tile_ends[tile] = atomicLoad(&end);
    }
}
