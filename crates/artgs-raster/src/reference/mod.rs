//! A slow rasteriser in f64 without tiles, and its derivatives by finite differences: the reference of the tests.

mod project;

use crate::limits;
use crate::{Colors, Frame, FrameGrad, RenderOptions, SplatGrads, SplatView};
use artgs_core::Camera;
use glam::{DVec2, DVec3};
use project::{Flat, Raw};

#[cfg(test)]
pub(crate) use project::harmonic;

const ALPHA_MAX: f64 = limits::ALPHA_MAX as f64;
const ALPHA_MIN: f64 = 1.0 / 255.0;
const TRANSMITTANCE_MIN: f64 = limits::TRANSMITTANCE_MIN as f64;
const STEP: f64 = 1e-5;

/// A rendering with the margins of its decisions.
#[derive(Clone, Debug)]
pub struct Checked {
    /// The rendering.
    pub frame: Frame,
    /// Smallest relative distance of any decision of the pixel (alpha cut, alpha cap, stop) from flipping, `[height * width]`.
    /// Where it is tiny, another correct implementation may decide otherwise and differ by up to 1/255.
    pub margin: Vec<f64>,
}

/// The Gaussians that contribute to each pixel, front to back.
struct Plan {
    flats: Vec<Option<Flat>>,
    members: Vec<Vec<u32>>,
    margin: Vec<f64>,
}

/// Renders every pixel by blending all Gaussians in order of depth.
pub fn render(splats: SplatView<'_>, camera: &Camera, options: &RenderOptions) -> Frame {
    render_checked(splats, camera, options).frame
}

/// [`render`] with the margins of its decisions.
pub fn render_checked(splats: SplatView<'_>, camera: &Camera, options: &RenderOptions) -> Checked {
    let plan = Plan::new(&read(&splats, options), camera, options);
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let size = width * height;
    let mut frame = Frame { width, height, rgb: vec![0.0; 3 * size], depth: vec![0.0; size], alpha: vec![0.0; size] };
    for p in 0..size {
        let (color, depth, alpha) = plan.blend(p, width, options, None);
        for c in 0..3 {
            frame.rgb[c * size + p] = color[c] as f32;
        }
        frame.depth[p] = depth as f32;
        frame.alpha[p] = alpha as f32;
    }
    Checked { frame, margin: plan.margin }
}

/// Derivatives of `sum(d_frame * frame)` by central differences of step 1e-5, with fixed decisions (order of
/// depth, alpha cut, stop, clamp of colours). Every field of the result is filled.
pub fn gradients(splats: SplatView<'_>, camera: &Camera, options: &RenderOptions, d_frame: &FrameGrad) -> SplatGrads {
    let mut raws = read(&splats, options);
    let plan = Plan::new(&raws, camera, options);
    let width = camera.intrinsics.width as usize;
    let half = DVec2::new(f64::from(camera.intrinsics.width), f64::from(camera.intrinsics.height)) / 2.0;
    let mut pixels = vec![Vec::new(); raws.len()];
    for (p, members) in plan.members.iter().enumerate() {
        members.iter().for_each(|&i| pixels[i as usize].push(p));
    }
    let loss = |i: usize, flat: &Flat| -> f64 {
        pixels[i].iter().map(|&p| dot(d_frame, p, plan.blend(p, width, options, Some((i, flat))))).sum()
    };
    let mut grads = SplatGrads::default();
    for i in 0..raws.len() {
        let mut slope = |pick: &dyn Fn(&mut Raw) -> &mut f64| {
            let center = *pick(&mut raws[i]);
            let mut side = |step: f64| {
                *pick(&mut raws[i]) = center + step;
                raws[i].project(camera, options).map_or(0.0, |flat| loss(i, &flat))
            };
            let value = (side(STEP) - side(-STEP)) / (2.0 * STEP);
            *pick(&mut raws[i]) = center;
            value as f32
        };
        grads.means.push(std::array::from_fn(|k| slope(&|r| &mut r.mean[k])));
        grads.rotations.push(std::array::from_fn(|k| slope(&|r| &mut r.rotation[k])));
        grads.log_scales.push(std::array::from_fn(|k| slope(&|r| &mut r.log_scale[k])));
        grads.logit_opacities.push(slope(&|r| &mut r.logit_opacity));
        if let Colors::Sh { degree, .. } = splats.colors {
            grads.sh.extend((0..3 * (degree + 1) * (degree + 1)).map(|k| slope(&|r| &mut r.color[k])));
        }
        let (mut mean2d, mut radius) = (0.0, 0.0);
        if let (Some(flat), false) = (&plan.flats[i], pixels[i].is_empty()) {
            let side = |step: DVec2| loss(i, &Flat { center: flat.center + step, ..flat.clone() });
            let slope = |axis: DVec2| (side(axis * STEP) - side(-axis * STEP)) / (2.0 * STEP);
            mean2d = (DVec2::new(slope(DVec2::X), slope(DVec2::Y)) * half).length();
            radius = flat.radius();
        }
        grads.mean2d.push(mean2d as f32);
        grads.radii.push(radius as f32);
    }
    grads
}

fn read(splats: &SplatView<'_>, options: &RenderOptions) -> Vec<Raw> {
    (0..splats.means.len()).map(|i| Raw::read(splats, options, i)).collect()
}

fn dot(d: &FrameGrad, p: usize, (color, depth, alpha): (DVec3, f64, f64)) -> f64 {
    let size = d.alpha.len();
    let rgb: f64 = (0..3).map(|c| f64::from(d.rgb[c * size + p]) * color[c]).sum();
    rgb + f64::from(d.depth[p]) * depth + f64::from(d.alpha[p]) * alpha
}

impl Flat {
    /// Opacity times the Gaussian at a pixel, not capped.
    fn alpha(&self, pixel: DVec2) -> f64 {
        let d = pixel - self.center;
        self.opacity * (-0.5 * d.dot(self.conic * d)).exp()
    }

    fn radius(&self) -> f64 {
        let c = &self.covariance;
        let half_trace = 0.5 * (c.x_axis.x + c.y_axis.y);
        let spread = (half_trace * half_trace - c.determinant()).max(limits::RADIUS_SPREAD_MIN.into()).sqrt();
        (f64::from(limits::RADIUS_DEVIATIONS) * (half_trace + spread).sqrt()).ceil()
    }
}

impl Plan {
    fn new(raws: &[Raw], camera: &Camera, options: &RenderOptions) -> Self {
        let flats: Vec<_> = raws.iter().map(|raw| raw.project(camera, options)).collect();
        let mut order: Vec<(f64, u32)> =
            flats.iter().enumerate().filter_map(|(i, f)| Some((f.as_ref()?.depth, i as u32))).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let width = camera.intrinsics.width as usize;
        let size = width * camera.intrinsics.height as usize;
        let mut plan = Self { flats, members: vec![Vec::new(); size], margin: vec![f64::INFINITY; size] };
        for p in 0..size {
            let mut transmittance = 1.0;
            for &(_, i) in &order {
                let Some(flat) = &plan.flats[i as usize] else { continue };
                let alpha = flat.alpha(center(p, width));
                let margin = (alpha / ALPHA_MIN - 1.0).abs().min((alpha / ALPHA_MAX - 1.0).abs());
                plan.margin[p] = plan.margin[p].min(margin);
                if alpha < ALPHA_MIN {
                    continue;
                }
                plan.members[p].push(i);
                transmittance *= 1.0 - alpha.min(ALPHA_MAX);
                plan.margin[p] = plan.margin[p].min((transmittance / TRANSMITTANCE_MIN - 1.0).abs());
                if transmittance < TRANSMITTANCE_MIN {
                    break;
                }
            }
        }
        plan
    }

    /// Colour over the background, depth and alpha of pixel `p`, one Gaussian optionally replaced.
    fn blend(
        &self,
        p: usize,
        width: usize,
        options: &RenderOptions,
        replaced: Option<(usize, &Flat)>,
    ) -> (DVec3, f64, f64) {
        let (mut color, mut depth, mut transmittance) = (DVec3::ZERO, 0.0, 1.0);
        for &i in &self.members[p] {
            let Some(drawn) = &self.flats[i as usize] else { continue };
            let flat = replaced.filter(|r| r.0 == i as usize).map_or(drawn, |r| r.1);
            let weight = transmittance * flat.alpha(center(p, width)).min(ALPHA_MAX);
            color += weight * drawn.shown * flat.color;
            depth += weight * flat.depth;
            transmittance -= weight;
        }
        let background = DVec3::from(options.background.map(f64::from));
        (color + transmittance * background, depth, 1.0 - transmittance)
    }
}

fn center(p: usize, width: usize) -> DVec2 {
    DVec2::new((p % width) as f64 + 0.5, (p / width) as f64 + 0.5)
}
