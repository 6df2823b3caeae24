//! The numbers of a step, as the kernels read them.

use artgs::fit::{DepthMode, LossConfig, SplatRates};
use artgs_core::Camera;
use bytemuck::{Pod, Zeroable};

/// Bytes between the numbers of two steps; devices want multiples of 256.
pub(crate) const STRIDE: usize = 512;

pub(crate) const DOUBLE_ALPHA: u32 = 1;
pub(crate) const DEPTH: u32 = 2;
pub(crate) const DEPTH_ACCUMULATED: u32 = 4;
pub(crate) const SSIM: u32 = 16;
pub(crate) const EXACT_WARP: u32 = 32;
pub(crate) const ROTATE_SH: u32 = 64;
pub(crate) const ARTICULATED: u32 = 128;
pub(crate) const LEARN_JOINTS: u32 = 256;
pub(crate) const WEIGHTED: u32 = 512;
pub(crate) const HARD: u32 = 1024;
pub(crate) const GUMBEL: u32 = 2048;
pub(crate) const CENTRE: u32 = 4096;
pub(crate) const CHAMFER: u32 = 8192;

/// Twin of `Step` in `common.wgsl`; see there for what the fields mean.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Step {
    rows: [[f32; 4]; 3],
    eye: [f32; 3],
    near: f32,
    focal: [f32; 2],
    principal: [f32; 2],
    limits: [f32; 4],
    pub(crate) background: [f32; 3],
    blur: f32,
    pub(crate) size: [u32; 2],
    pub(crate) tiles: [u32; 2],
    pub(crate) rect: [u32; 4],
    pub(crate) n: u32,
    pub(crate) sh_stride: u32,
    pub(crate) sh_degree: u32,
    pub(crate) parts: u32,
    pub(crate) pose: u32,
    pub(crate) slot: u32,
    pub(crate) capacity: u32,
    pub(crate) flags: u32,
    l1_step: f32,
    ssim_step: f32,
    depth_step: f32,
    mask_step: f32,
    depth_unit: f32,
    depth_count: f32,
    pub(crate) entropy_step: f32,
    pub(crate) chunks: u32,
    rates: [f32; 4],
    sh_rates: [f32; 2],
    corrections: [f32; 2],
    betas: [f32; 2],
    eps: f32,
    pub(crate) joint_rate: f32,
    pub(crate) joint_corrections: [f32; 2],
    pub(crate) length_unit: f32,
    pub(crate) scale_factor: f32,
    pub(crate) origin: [f32; 3],
    pub(crate) coordinate_scale: f32,
    pub(crate) noise: [u32; 2],
    pub(crate) assign_corrections: [f32; 2],
    pub(crate) assign_rate: f32,
    pub(crate) inverse_temperature: f32,
    pub(crate) shift_weight: f32,
    pub(crate) centre_scale: f32,
    pub(crate) learning_levels: u32,
    pub(crate) levels: u32,
    pub(crate) hidden: u32,
    pub(crate) chamfer_share: f32,
}

impl Step {
    /// What a camera makes of the world. Gaussians nearer than `near` are not drawn; `blur` widens them, square pixels.
    pub(crate) fn view(camera: &Camera, near: f32, blur: f32) -> Self {
        let k = &camera.intrinsics;
        let m = camera.world_to_camera.matrix().as_mat3();
        let t = camera.world_to_camera.translation.as_vec3();
        let row = |i: usize| m.row(i).extend(t[i]).to_array();
        // Centred: 1.3 tan(fov / 2). In general the image plus 30 % of its half width on each side.
        let limits = |f: f64, c: f64, size: u32| {
            let size = f64::from(size);
            [(-c - 0.15 * size) / f, (size - c + 0.15 * size) / f].map(|x| x as f32)
        };
        let ([x0, x1], [y0, y1]) = (limits(k.fx, k.cx, k.width), limits(k.fy, k.cy, k.height));
        Self {
            rows: [row(0), row(1), row(2)],
            eye: camera.position().as_vec3().to_array(),
            near,
            focal: [k.fx as f32, k.fy as f32],
            principal: [k.cx as f32, k.cy as f32],
            limits: [x0, x1, y0, y1],
            blur,
            size: [k.width, k.height],
            tiles: [k.width, k.height].map(|n| n.div_ceil(16)),
            ..Self::default()
        }
    }

    /// Weights of the loss for a photograph with so many pixels inside its mask that lack a depth; `depth_per_unit` counts of
    /// depth make a scene unit, if it has depth.
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
        let usable = config.depth > 0.0 && (count > artgs::fit::loss::MIN_VALID_DEPTHS || !accumulated);
        if let (Some(per_unit), true) = (depth_per_unit, usable) {
            self.depth_step = config.depth / count as f32;
            self.depth_count = 1.0 / per_unit;
            self.flags |= DEPTH | if accumulated { DEPTH_ACCUMULATED } else { 0 };
        }
    }

    /// The same, but Gaussians stay as they are.
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

/// The numbers of consecutive steps, [`STRIDE`] bytes each.
pub(crate) fn bytes(steps: &[Step]) -> Vec<u8> {
    let mut out = vec![0; steps.len() * STRIDE];
    for (to, step) in out.chunks_exact_mut(STRIDE).zip(steps) {
        to[..size_of::<Step>()].copy_from_slice(bytemuck::bytes_of(step));
    }
    out
}
