// What all kernels use. Constants and the structs that the host knows (`Step` and others) come before this, from
// `constants.rs` and from `shared_struct!`.

const NOT_DRAWN: u32 = 0xffffffffu;
const LARGEST: f32 = 3.0e38;

// Number of a workgroup of a dispatch that may have more than one row.
fn group_index(group: vec3u) -> u32 {
    return group.y * ROW + group.x;
}

fn has(flags: u32, flag: u32) -> bool {
    return (flags & flag) != 0u;
}

// Parameters lie one kind after the other: means, rotations, log scales, logit opacities, harmonics.
fn at_rotation(n: u32, i: u32) -> u32 {
    return 3u * n + 4u * i;
}

fn at_log_scale(n: u32, i: u32) -> u32 {
    return 7u * n + 3u * i;
}

fn at_logit(n: u32, i: u32) -> u32 {
    return 10u * n + i;
}

fn at_sh(n: u32, stride: u32, i: u32) -> u32 {
    return PLAIN * n + stride * i;
}

// `log2(alpha)` at an offset from the centre.
fn exponent(flat: Flat, d: vec2f) -> f32 {
    return flat.log2_opacity + flat.xx * d.x * d.x + flat.xy * d.x * d.y + flat.yy * d.y * d.y;
}

// True if a number is finite. Compilers may assume that all numbers are, so it looks at the bits.
fn finite(v: f32) -> bool {
    return (bitcast<u32>(v) & 0x7f800000u) != 0x7f800000u;
}

// -1, 0 or 1.
fn signum(v: f32) -> f32 {
    return select(0.0, 1.0, v > 0.0) - select(0.0, 1.0, v < 0.0);
}
