//! Uniforms and results of a step.

use crate::constants::{DEPTH, DEPTH_ACCUMULATED, DOUBLE_ALPHA, SSIM};
use crate::shared::shared_struct;
use artgs::fit::{DepthMode, LossConfig, SplatRates};
use artgs_core::Camera;
use artgs_raster::low_level::{TILE, jacobian_limits};

/// Bytes between the uniforms of two steps; devices need multiples of 256.
pub(crate) const STRIDE: usize = 512;

shared_struct! {
    /// The uniform of a step, the same for all kernels.
    pub(crate) struct Step {
        /// Rows of the world-to-camera rotation; the translation in w.
        row_x: [f32; 4],
        row_y: [f32; 4],
        row_z: [f32; 4],
        eye: [f32; 3],
        near: f32,
        focal: [f32; 2],
        principal: [f32; 2],
        /// Range of x / z and y / z in which the Jacobian follows the point: least x, most x, least y, most y.
        limits: [f32; 4],
        pub(crate) background: [f32; 3],
        blur: f32,
        pub(crate) size: [u32; 2],
        pub(crate) tiles: [u32; 2],
        /// Windows of structural similarity are centred in here: first column and row, one past the last ones.
        pub(crate) rect: [u32; 4],
        /// Number of Gaussians.
        pub(crate) n: u32,
        /// Floats of harmonics of one Gaussian, and the degree in use.
        pub(crate) sh_stride: u32,
        pub(crate) sh_degree: u32,
        pub(crate) parts: u32,
        /// Index of the state of the image.
        pub(crate) pose: u32,
        /// Place of this step in the results of its batch.
        pub(crate) slot: u32,
        /// Number of intersections that the buffers hold.
        pub(crate) capacity: u32,
        pub(crate) flags: u32,
        /// Gradients per unit of what is summed over pixels.
        l1_step: f32,
        ssim_step: f32,
        depth_step: f32,
        mask_step: f32,
        depth_unit: f32,
        /// Scene units of one count of depth.
        depth_count: f32,
        pub(crate) entropy_step: f32,
        /// Number of ranges of Gaussians that are summed in parallel.
        pub(crate) chunks: u32,
        /// Of means, rotations, log scales, logit opacities.
        rates: [f32; 4],
        /// Of the constant harmonic and of the others.
        sh_rates: [f32; 2],
        /// Of both moments.
        corrections: [f32; 2],
        betas: [f32; 2],
        eps: f32,
        pub(crate) joint_rate: f32,
        /// Bias corrections `1 - beta^t` of the motions.
        pub(crate) joint_corrections: [f32; 2],
        pub(crate) length_unit: f32,
        /// Factor on the scales of parts.
        pub(crate) scale_factor: f32,
        /// Coordinates that hash grid and perceptron see: `(x - origin) coordinate_scale`.
        pub(crate) origin: [f32; 3],
        pub(crate) coordinate_scale: f32,
        /// Seed of the noise of this step.
        pub(crate) noise: [u32; 2],
        /// Bias corrections `1 - beta^t` of a learned membership.
        pub(crate) assign_corrections: [f32; 2],
        pub(crate) assign_rate: f32,
        pub(crate) inverse_temperature: f32,
        pub(crate) shift_weight: f32,
        /// Pull of the centres over the number of their coordinates.
        pub(crate) centre_scale: f32,
        /// Levels of the hash grid that learn, and all of them.
        pub(crate) learning_levels: u32,
        pub(crate) levels: u32,
        pub(crate) hidden: u32,
        /// Weight of the Chamfer term over the number of Gaussians.
        pub(crate) chamfer_share: f32,
    }
}

const _: () = assert!(size_of::<Step>() <= STRIDE, "the uniforms of steps do not overlap");

shared_struct! {
    /// Results of a step: sums over pixels, windows and Gaussians.
    pub(crate) struct Outcome {
        /// Absolute and squared colour difference, depth term, difference of alpha.
        pub(crate) sums: [f32; 4],
        pub(crate) similarity: f32,
        pub(crate) entropy: f32,
        pub(crate) intersections: f32,
        /// 1 if the buffers held all intersections, else 0.
        pub(crate) complete: f32,
    }
}

shared_struct! {
    /// Loss terms of a step that act on parts alone.
    pub(crate) struct PartTerms {
        pub(crate) chamfer: f32,
        pub(crate) centre: f32,
    }
}

impl Step {
    /// The fields of a camera. Gaussians nearer than `near` are not drawn; `blur` is added to their variances, square pixels.
    pub(crate) fn view(camera: &Camera, near: f32, blur: f32) -> Self {
        let k = &camera.intrinsics;
        let m = camera.world_to_camera.matrix().as_mat3();
        let t = camera.world_to_camera.translation.as_vec3();
        let row = |i: usize| m.row(i).extend(t[i]).to_array();
        let [[x0, x1], [y0, y1]] = jacobian_limits(k);
        Self {
            row_x: row(0),
            row_y: row(1),
            row_z: row(2),
            eye: camera.position().as_vec3().to_array(),
            near,
            focal: [k.fx as f32, k.fy as f32],
            principal: [k.cx as f32, k.cy as f32],
            limits: [x0, x1, y0, y1],
            blur,
            size: [k.width, k.height],
            tiles: [k.width, k.height].map(|n| n.div_ceil(TILE as u32)),
            ..Self::default()
        }
    }

    /// Weights of the loss for an image. `without_depth` is the number of pixels inside the mask without a depth;
    /// `depth_per_unit` is the number of depth counts per scene unit, if the image has depth.
    pub(crate) fn losses(
        &mut self,
        config: &LossConfig,
        depth_unit: f32,
        depth_per_unit: Option<f32>,
        without_depth: usize,
    ) {
        let area = self.size[0] as usize * self.size[1] as usize;
        let accumulated = config.depth_mode == DepthMode::Accumulated;
        let count = if accumulated { area - without_depth } else { area };
        self.l1_step = (1.0 - config.ssim) / (3 * area) as f32;
        self.ssim_step = -config.ssim / (3 * area) as f32;
        self.mask_step = config.mask / area as f32;
        if config.ssim > 0.0 {
            self.flags |= SSIM;
        }
        if config.double_alpha {
            self.flags |= DOUBLE_ALPHA;
        }
        self.depth_unit = depth_unit;
        let usable = config.depth > 0.0 && (count > artgs::low_level::MIN_VALID_DEPTHS || !accumulated);
        if let (Some(per_unit), true) = (depth_per_unit, usable) {
            self.depth_step = config.depth / count as f32;
            self.depth_count = 1.0 / per_unit;
            self.flags |= DEPTH | if accumulated { DEPTH_ACCUMULATED } else { 0 };
        }
    }

    /// The same with learning rates of 0.
    pub(crate) fn without_rates(self) -> Self {
        Self { rates: [0.0; 4], sh_rates: [0.0; 2], joint_rate: 0.0, assign_rate: 0.0, ..self }
    }

    /// Learning rates, and the corrections of Adam at its update `count` (from 1).
    pub(crate) fn update(&mut self, rates: &SplatRates, adam: &artgs::fit::AdamConfig, count: usize) {
        self.rates = [rates.means, rates.rotations, rates.log_scales, rates.logit_opacities];
        self.sh_rates = [rates.sh_dc, rates.sh_rest];
        self.corrections = adam.corrections(count);
        self.betas = [adam.beta1, adam.beta2];
        self.eps = adam.eps;
    }
}

/// The uniforms of consecutive steps, [`STRIDE`] bytes each.
pub(crate) fn bytes(steps: &[Step]) -> Vec<u8> {
    let mut out = vec![0; steps.len() * STRIDE];
    for (to, step) in out.chunks_exact_mut(STRIDE).zip(steps) {
        to[..size_of::<Step>()].copy_from_slice(bytemuck::bytes_of(step));
    }
    out
}
