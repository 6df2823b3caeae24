// What all kernels share: the numbers of a step, and where things lie in the flat arrays.

struct Step {
    // Rows of the world-to-camera rotation; the translation in w.
    row_x: vec4f,
    row_y: vec4f,
    row_z: vec4f,
    eye: vec3f,
    near: f32,
    focal: vec2f,
    principal: vec2f,
    // Range of x / z and y / z in which the Jacobian follows the point: least x, most x, least y, most y.
    limits: vec4f,
    background: vec3f,
    blur: f32,
    size: vec2u,
    tiles: vec2u,
    // Windows of structural similarity are centred in here: first column and row, one past the last ones.
    rect: vec4u,
    n: u32,
    // Floats of harmonics of one Gaussian, and the degree in use.
    sh_stride: u32,
    sh_degree: u32,
    parts: u32,
    pose: u32,
    // Place of this step in the results of its batch.
    slot: u32,
    capacity: u32,
    flags: u32,
    // Gradients per unit of what is summed over pixels.
    l1_step: f32,
    ssim_step: f32,
    depth_step: f32,
    mask_step: f32,
    depth_unit: f32,
    // Scene units of one count of depth.
    depth_count: f32,
    entropy_step: f32,
    chunks: u32,
    // Means, rotations, log scales, logit opacities.
    rates: vec4f,
    // Constant harmonic, other harmonics; corrections of both moments.
    sh_rates: vec2f,
    corrections: vec2f,
    beta1: f32,
    beta2: f32,
    eps: f32,
    joint_rate: f32,
    // Bias corrections `1 - beta^t` of the motions.
    joint_corrections: vec2f,
    length_unit: f32,
    // Factor on the scales of parts.
    scale_factor: f32,
    // Coordinates that hash grid and perceptron see: `(x - origin) coordinate_scale`.
    origin: vec3f,
    coordinate_scale: f32,
    // Seed of the noise of this step.
    noise: vec2u,
    // Bias corrections `1 - beta^t` of a learnt membership.
    assign_corrections: vec2f,
    assign_rate: f32,
    inverse_temperature: f32,
    shift_weight: f32,
    // Pull of the centres over the number of their coordinates.
    centre_scale: f32,
    // Levels of the hash grid that learn, and all of them.
    learning_levels: u32,
    levels: u32,
    hidden: u32,
    // Weight of the Chamfer term over the number of Gaussians.
    chamfer_share: f32,
}

const DOUBLE_ALPHA: u32 = 1u;
const DEPTH: u32 = 2u;
const DEPTH_ACCUMULATED: u32 = 4u;
const SSIM: u32 = 16u;
const EXACT_WARP: u32 = 32u;
const ROTATE_SH: u32 = 64u;
const ARTICULATED: u32 = 128u;
const LEARN_JOINTS: u32 = 256u;
// Parts are weighted: `motions` holds the blended motion of every Gaussian and the rotation of its heaviest part.
const WEIGHTED: u32 = 512u;
const HARD: u32 = 1024u;
const GUMBEL: u32 = 2048u;
const CENTRE: u32 = 4096u;
const CHAMFER: u32 = 8192u;
// Numbers per part: centre, log scales, quaternion.
const FRAME: u32 = 10u;
const FEATURES: u32 = 2u;

// Words of `control`.
const TOTAL: u32 = 0u;
const OVERFLOW: u32 = 1u;
const NEEDED: u32 = 2u;
const BUCKETS: u32 = 3u;

// Gaussians are drawn where their alpha is at least 1/255: base-2 exponent of that cut.
const LOG2_CUT: f32 = -7.9943534;
const LN_2: f32 = 0.69314718;
const LOG2_E: f32 = 1.442695;
// What footprints are widened by, in log2(alpha) and in pixels, so that rounding loses no pixel.
const SLACK: f32 = 1e-3;
const SLACK_PIXELS: f32 = 0.01;
const TILE: u32 = 16u;
const TILE_PIXELS: u32 = 256u;
// Largest alpha of one Gaussian in one pixel; held there, it has no gradient.
const ALPHA_MAX: f32 = 0.99;
// A pixel is finished once its transmittance is below this; the Gaussian that takes it there still counts.
const TRANSMITTANCE_MIN: f32 = 1e-4;
const NOT_DRAWN: u32 = 0xffffffffu;
const LARGEST: f32 = 3.0e38;
// Workgroups along the first axis of a dispatch at most.
const ROW: u32 = 32768u;

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
    return 11u * n + stride * i;
}

// A Gaussian on the image:
// `log2(alpha) = log2_opacity + xx dx^2 + xy dx dy + yy dy^2` with `dx`, `dy` from the centre to the pixel.
struct Flat {
    center: vec2f,
    xx: f32,
    xy: f32,
    yy: f32,
    log2_opacity: f32,
    depth: f32,
    // `4 xx yy - xy^2`, without the cancellation.
    discriminant: f32,
    rgb: vec3f,
    // Half extents in pixels of the region where alpha reaches 1/255.
    half_x: f32,
    half_y: f32,
    pad_a: f32,
    pad_b: f32,
    pad_c: f32,
}

fn exponent(flat: Flat, d: vec2f) -> f32 {
    return flat.log2_opacity + flat.xx * d.x * d.x + flat.xy * d.x * d.y + flat.yy * d.y * d.y;
}

// Whether a number is one, by its bits: compilers may take for granted that there are no others.
fn finite(v: f32) -> bool {
    return (bitcast<u32>(v) & 0x7f800000u) != 0x7f800000u;
}

// -1, 0 or 1.
fn signum(v: f32) -> f32 {
    return select(0.0, 1.0, v > 0.0) - select(0.0, 1.0, v < 0.0);
}
