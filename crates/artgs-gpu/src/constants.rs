//! Constants of the kernels. The host needs most of them too; those that `artgs` or `artgs_raster` define are taken from there.

use crate::shared::shared_constants;
use artgs::low_level::kernel_constants as training;
use artgs_raster::low_level as raster;
use std::f32::consts;

shared_constants! {
    // Bits of `Step::flags`.
    /// Colours of images are multiplied by alpha twice.
    DOUBLE_ALPHA: u32 = 1;
    /// There is a depth term.
    DEPTH: u32 = 1 << 1;
    /// The depth term compares accumulated depth, not depth divided by alpha.
    DEPTH_ACCUMULATED: u32 = 1 << 2;
    /// There is a term of structural similarity.
    SSIM: u32 = 1 << 3;
    /// Gradients pass through the rotation of the warp.
    EXACT_WARP: u32 = 1 << 4;
    /// Harmonics turn with their parts.
    ROTATE_SH: u32 = 1 << 5;
    /// Gaussians move with parts.
    ARTICULATED: u32 = 1 << 6;
    /// Motions of parts are optimised.
    LEARN_JOINTS: u32 = 1 << 7;
    /// Parts are weighted: `motions` holds the blended motion of every Gaussian and the rotation of its heaviest part.
    WEIGHTED: u32 = 1 << 8;
    /// Weights are 1 for the heaviest part and 0 for the others.
    HARD: u32 = 1 << 9;
    /// Gumbel noise is added to logits.
    GUMBEL: u32 = 1 << 10;
    /// Centres are pulled to the means of their parts.
    CENTRE: u32 = 1 << 11;
    /// There is a Chamfer term.
    CHAMFER: u32 = 1 << 12;

    // Bits of `Layer::flags`.
    /// Biases are added.
    LAYER_BIAS: u32 = 1;
    /// Negative sums become 0.
    LAYER_RELU: u32 = 1 << 1;
    /// Sums become 0 where the gate is not positive: the gradient of a ReLU.
    LAYER_GATE: u32 = 1 << 2;

    // Values of `Joint::model`.
    MODEL_FREE: u32 = 0;
    MODEL_PRISMATIC: u32 = 1;
    MODEL_HINGE: u32 = 2;
    MODEL_SCREW: u32 = 3;

    // Words of `control`.
    /// Number of intersections to draw.
    TOTAL: u32 = 0;
    /// Not 0 after the intersections exceeded the buffers; then no step changes anything.
    OVERFLOW: u32 = 1;
    /// Largest number of intersections so far.
    NEEDED: u32 = 2;
    /// Number of buckets.
    BUCKETS: u32 = 3;
    /// Length of `control`.
    CONTROL_WORDS: u32 = 8;

    // Entries of `arguments`, four words each: numbers of workgroups of indirect dispatches.
    /// For each block of intersections of the sort.
    BY_BLOCK: u32 = 0;
    /// For each `WIDE_GROUP` intersections.
    BY_INTERSECTION: u32 = 1;
    /// For each bucket.
    BY_BUCKET: u32 = 2;

    // Sizes of dispatches.
    /// Most workgroups along the first axis of a dispatch.
    ROW: u32 = 1 << 15;
    /// Threads of a workgroup of kernels that need many registers.
    GROUP: u32 = 128;
    /// Threads of a workgroup of kernels that need few registers.
    WIDE_GROUP: u32 = 256;
    /// Threads of a workgroup of kernels that work on parts.
    PART_GROUP: u32 = 64;
    /// Pairs that a workgroup of the sort, or elements that a workgroup of the prefix sum, handles.
    BLOCK: u32 = 2048;
    /// Bits of a key that one pass of the sort looks at.
    DIGIT_BITS: u32 = 4;
    /// Values of these bits.
    DIGITS: u32 = 1 << DIGIT_BITS;
    /// Rows of a layer that a thread computes.
    LAYER_ROWS: u32 = 4;
    /// Rows and columns of the tile of a product of matrices that a workgroup computes.
    PRODUCT_SIDE: u32 = 16;

    // Layout of arrays.
    /// Floats of a Gaussian without its harmonics.
    PLAIN: u32 = 11;
    /// Floats per part of a learned assignment: centre, log scales, quaternion.
    FRAME: u32 = training::ASSIGN_FRAME as u32;
    /// Vectors per part that `sum_frames` writes for a range of Gaussians.
    FRAME_SUMS: u32 = 5;
    /// Features of a level of the hash grid.
    FEATURES: u32 = training::HASH_FEATURES as u32;

    // Projection and blending, see `artgs_raster`.
    TILE: u32 = raster::TILE as u32;
    TILE_PIXELS: u32 = TILE * TILE;
    LOG2_CUT: f32 = raster::LOG2_CUT;
    ALPHA_MAX: f32 = raster::ALPHA_MAX;
    TRANSMITTANCE_MIN: f32 = raster::TRANSMITTANCE_MIN;
    SLACK: f32 = raster::SLACK;
    SLACK_PIXELS: f32 = raster::SLACK_PIXELS;
    QUATERNION_MIN: f32 = raster::QUATERNION_MIN;
    RADIUS_DEVIATIONS: f32 = raster::RADIUS_DEVIATIONS;
    RADIUS_SPREAD_MIN: f32 = raster::RADIUS_SPREAD_MIN;
    LN_2: f32 = consts::LN_2;
    LOG2_E: f32 = consts::LOG2_E;

    // Spherical harmonics, see `artgs_raster`.
    SH_C0: f32 = raster::SH_C0;
    SH_C1: f32 = raster::SH_C1;
    SH_C20: f32 = raster::SH_C2[0];
    SH_C21: f32 = raster::SH_C2[1];
    SH_C22: f32 = raster::SH_C2[2];
    SH_C30: f32 = raster::SH_C3[0];
    SH_C31: f32 = raster::SH_C3[1];
    SH_C32: f32 = raster::SH_C3[2];
    SH_C33: f32 = raster::SH_C3[3];
    SH_C34: f32 = raster::SH_C3[4];

    // Losses, see `artgs::fit`.
    SSIM_C1: f32 = training::SSIM_C1;
    SSIM_C2: f32 = training::SSIM_C2;
    /// Weights of the window of structural similarity along one axis.
    TAPS: u32 = training::SSIM_TAPS as u32;
    /// Least alpha by which depth is divided.
    MIN_ALPHA: f32 = training::MIN_ALPHA;
    /// Least alpha, of 255, of a pixel whose depth is that of the object.
    COVERED: u32 = training::COVERED as u32;

    /// Least length of a sum of motions that is divided by it.
    MOTION_LENGTH_MIN: f32 = training::MOTION_LENGTH_MIN as f32;

    // Optimisers of motions and membership, see `artgs`.
    ADAM_BETA_1: f32 = training::ADAM_BETA[0] as f32;
    ADAM_BETA_2: f32 = training::ADAM_BETA[1] as f32;
    /// 1 - `ADAM_BETA_1`.
    ADAM_GAIN_1: f32 = (1.0 - training::ADAM_BETA[0]) as f32;
    /// 1 - `ADAM_BETA_2`.
    ADAM_GAIN_2: f32 = (1.0 - training::ADAM_BETA[1]) as f32;
    ADAM_EPSILON: f32 = training::ADAM_EPSILON as f32;
    /// Moments of the hash grid below this are set to 0.
    FLUSH: f32 = training::HASH_FLUSH;
    /// Gradients of the hash grid below this count as 0.
    NEGLIGIBLE: f32 = training::HASH_NEGLIGIBLE;
    HASH_PRIME_Y: u32 = training::HASH_PRIMES[0];
    HASH_PRIME_Z: u32 = training::HASH_PRIMES[1];
    /// Added to the total opacity of a part before it is divided by.
    OPACITY_FLOOR: f32 = training::OPACITY_FLOOR as f32;
}
