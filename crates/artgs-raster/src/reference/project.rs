//! Projection of one Gaussian in f64, with full matrices.

use crate::limits::JACOBIAN_MARGIN;
use crate::{Colors, RenderOptions, SplatView};
use artgs_core::Camera;
use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};

/// A Gaussian in raw parameters, f64.
#[derive(Clone, Debug)]
pub(super) struct Raw {
    pub(super) mean: [f64; 3],
    pub(super) rotation: [f64; 4],
    pub(super) log_scale: [f64; 3],
    pub(super) logit_opacity: f64,
    /// Harmonics `[coefficient][rgb]`, or one fixed colour.
    pub(super) color: Vec<f64>,
    /// Degree evaluated; `None` for a fixed colour.
    pub(super) degree: Option<usize>,
    /// Takes world directions into the frame of the harmonics.
    pub(super) frame: DMat3,
}

/// A Gaussian on the image.
#[derive(Clone, Debug)]
pub(super) struct Flat {
    pub(super) center: DVec2,
    pub(super) conic: DMat2,
    pub(super) covariance: DMat2,
    pub(super) opacity: f64,
    pub(super) depth: f64,
    /// Before the clamp at zero.
    pub(super) color: DVec3,
    /// 1 where the clamp passes a channel unchanged, 0 where it does not.
    pub(super) shown: DVec3,
}

impl Raw {
    pub(super) fn read(splats: &SplatView<'_>, options: &RenderOptions, i: usize) -> Self {
        let (color, degree, frame) = match splats.colors {
            Colors::Fixed(c) => (c[i].iter().map(|&x| f64::from(x)).collect(), None, DMat3::IDENTITY),
            Colors::Sh { sh, degree, frames } => {
                let stride = 3 * (degree + 1) * (degree + 1);
                let frame = frames.map_or(DMat3::IDENTITY, |f| {
                    let m = f.world_to_frame[usize::from(f.index[i])];
                    DMat3::from_cols_array_2d(&m.map(|row| row.map(f64::from))).transpose()
                });
                let coefficients = sh[i * stride..(i + 1) * stride].iter().map(|&x| f64::from(x)).collect();
                (coefficients, Some(degree.min(options.sh_degree)), frame)
            }
        };
        Self {
            mean: splats.means[i].map(f64::from),
            rotation: splats.rotations[i].map(f64::from),
            log_scale: splats.log_scales[i].map(f64::from),
            logit_opacity: f64::from(splats.logit_opacities[i]),
            color,
            degree,
            frame,
        }
    }

    /// Perspective projection with the local affine approximation of EWA; `None` nearer than the near plane.
    pub(super) fn project(&self, camera: &Camera, options: &RenderOptions) -> Option<Flat> {
        let mean = DVec3::from(self.mean);
        let p = camera.world_to_camera.apply(mean);
        if p.z <= f64::from(options.near) {
            return None;
        }
        let k = &camera.intrinsics;
        let (width, height) = (f64::from(k.width), f64::from(k.height));
        let limit = |x: f64, c: f64, f: f64, size: f64| {
            let extra = JACOBIAN_MARGIN * size / f;
            x.clamp(-c / f - extra, (size - c) / f + extra)
        };
        let u = limit(p.x / p.z, k.cx, k.fx, width);
        let v = limit(p.y / p.z, k.cy, k.fy, height);
        let jacobian = DMat3::from_cols(
            DVec3::new(k.fx / p.z, 0.0, 0.0),
            DVec3::new(0.0, k.fy / p.z, 0.0),
            DVec3::new(-k.fx * u / p.z, -k.fy * v / p.z, 0.0),
        );
        let [w, x, y, z] = self.rotation;
        let norm = (w * w + x * x + y * y + z * z).sqrt();
        let rotation = DMat3::from_quat(DQuat::from_xyzw(x / norm, y / norm, z / norm, w / norm));
        let variances = DMat3::from_diagonal(DVec3::from(self.log_scale.map(|s| (2.0 * s).exp())));
        let to_image = jacobian * camera.world_to_camera.matrix();
        let full = to_image * (rotation * variances * rotation.transpose()) * to_image.transpose();
        let blur = f64::from(options.blur);
        let covariance = DMat2::from_cols(
            DVec2::new(full.x_axis.x + blur, full.x_axis.y),
            DVec2::new(full.y_axis.x, full.y_axis.y + blur),
        );
        let color = self.shade((mean - camera.position()).normalize());
        let passes = |c: f64| if c > 0.0 || self.degree.is_none() { 1.0 } else { 0.0 };
        Some(Flat {
            center: DVec2::new(k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy),
            conic: covariance.inverse(),
            covariance,
            opacity: 1.0 / (1.0 + (-self.logit_opacity).exp()),
            depth: p.z,
            color,
            shown: DVec3::new(passes(color.x), passes(color.y), passes(color.z)),
        })
    }

    fn shade(&self, direction: DVec3) -> DVec3 {
        let Some(degree) = self.degree else {
            return DVec3::new(self.color[0], self.color[1], self.color[2]);
        };
        let d = self.frame * direction;
        let mut sum = DVec3::splat(0.5);
        for l in 0..=degree {
            for m in -(l as i32)..=l as i32 {
                let i = 3 * ((l * l + l) as i32 + m) as usize;
                sum += harmonic(l, m, d) * DVec3::new(self.color[i], self.color[i + 1], self.color[i + 2]);
            }
        }
        sum
    }
}

/// Real spherical harmonic with the Condon-Shortley phase, from the recurrences of the Legendre functions.
pub(crate) fn harmonic(l: usize, m: i32, d: DVec3) -> f64 {
    let order = m.unsigned_abs() as usize;
    let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
    let norm = ((2 * l + 1) as f64 / (4.0 * std::f64::consts::PI) * factorial(l - order) / factorial(l + order)).sqrt();
    let (mut below, mut legendre) = (0.0, 1.0);
    for i in 0..order {
        legendre *= -((2 * i + 1) as f64);
    }
    for n in order + 1..=l {
        let next = ((2 * n - 1) as f64 * d.z * legendre - (n + order - 1) as f64 * below) / (n - order) as f64;
        (below, legendre) = (legendre, next);
    }
    // sin(theta)^m e^(i m phi) = (x + i y)^m
    let (mut re, mut im) = (1.0, 0.0);
    for _ in 0..order {
        (re, im) = (re * d.x - im * d.y, re * d.y + im * d.x);
    }
    match m {
        0 => norm * legendre,
        1.. => std::f64::consts::SQRT_2 * norm * legendre * re,
        _ => std::f64::consts::SQRT_2 * norm * legendre * im,
    }
}
