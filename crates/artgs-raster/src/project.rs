//! Projection of one Gaussian from the world to the image, and its adjoint.

use crate::limits::{
    LOG2_CUT, QUATERNION_MIN, RADIUS_DEVIATIONS, RADIUS_SPREAD_MIN, SLACK, SLACK_PIXELS, jacobian_limits,
};
use crate::{Colors, RenderOptions, SplatView, sh};
use artgs_core::Camera;
use glam::{Mat3, Vec2, Vec3};
use std::f32::consts::{LN_2, LOG2_E};

/// A Gaussian on the image, one cache line:
/// `log2(alpha) = log2_opacity + xx dx^2 + xy dx dy + yy dy^2` with `dx`, `dy` from the centre to the pixel.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(crate) struct Flat {
    pub(crate) x: f32,
    pub(crate) y: f32,
    pub(crate) xx: f32,
    pub(crate) xy: f32,
    pub(crate) yy: f32,
    pub(crate) log2_opacity: f32,
    pub(crate) rgb: [f32; 3],
    pub(crate) depth: f32,
    /// Half extents in pixels of the region where alpha reaches 1/255.
    pub(crate) half: [f32; 2],
    /// `4 xx yy - xy^2`, without the cancellation.
    pub(crate) discriminant: f32,
}

/// The camera and the options of a rendering, in the form that the projection needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    /// Rows of the world-to-camera rotation.
    rows: [Vec3; 3],
    translation: Vec3,
    eye: Vec3,
    focal: Vec2,
    principal: Vec2,
    pub(crate) size: [usize; 2],
    /// Range of x / z and y / z in which the Jacobian follows the point.
    limits: [[f32; 2]; 2],
    near: f32,
    blur: f32,
    sh_degree: usize,
}

/// Sums over the pixels of one Gaussian, `g` being alpha times the gradient of the loss with respect to alpha.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums {
    pub(crate) g: f32,
    /// `sum g (dx, dy)`.
    pub(crate) first: Vec2,
    /// `sum g (dx^2, dx dy, dy^2)`.
    pub(crate) second: [f32; 3],
    pub(crate) rgb: Vec3,
    pub(crate) depth: f32,
}

/// Gradients of one Gaussian; those of its harmonics are written in place.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Gradient {
    pub(crate) mean: [f32; 3],
    pub(crate) rotation: [f32; 4],
    pub(crate) log_scale: [f32; 3],
    pub(crate) logit_opacity: f32,
    pub(crate) mean2d: f32,
    /// Three standard deviations in pixels, rounded up.
    pub(crate) radius: f32,
}

/// Intermediate values of the projection.
struct Chain {
    p: Vec3,
    /// x / z and y / z, and the same clamped to the limits.
    ratio: Vec2,
    clamped: Vec2,
    /// Unit quaternion and the length of the raw one (0 if it was not usable).
    unit: [f32; 4],
    norm: f32,
    rotation: Mat3,
    scale: Vec3,
    /// Rows of Jacobian times world-to-camera rotation, and of that times the Gaussian's rotation and scale.
    to_image: [Vec3; 2],
    scaled: [Vec3; 2],
    /// Covariance (xx, xy, yy) with the blur, and its determinant.
    covariance: [f32; 3],
    determinant: f32,
}

impl View {
    pub(crate) fn new(camera: &Camera, options: &RenderOptions) -> Self {
        let k = &camera.intrinsics;
        let m = camera.world_to_camera.matrix().as_mat3();
        Self {
            rows: [m.row(0), m.row(1), m.row(2)],
            translation: camera.world_to_camera.translation.as_vec3(),
            eye: camera.position().as_vec3(),
            focal: Vec2::new(k.fx as f32, k.fy as f32),
            principal: Vec2::new(k.cx as f32, k.cy as f32),
            size: [k.width as usize, k.height as usize],
            limits: jacobian_limits(k),
            near: options.near,
            blur: options.blur,
            sh_degree: options.sh_degree,
        }
    }

    /// The Gaussian on the image; `None` if it is too near, too faint, degenerate or outside the image.
    pub(crate) fn project(&self, splats: &SplatView<'_>, i: usize) -> Option<Flat> {
        let depth = self.rows[2].dot(Vec3::from(splats.means[i])) + self.translation.z;
        let opacity = 1.0 / (1.0 + (-splats.logit_opacities[i]).exp());
        let log2_opacity = opacity.log2();
        let reach = log2_opacity - LOG2_CUT;
        if !(depth > self.near && depth.is_finite() && reach >= 0.0) {
            return None;
        }
        let chain = self.chain(splats, i);
        let center = self.focal * chain.ratio + self.principal;
        let [xx, xy, yy] = chain.covariance;
        if !(chain.determinant > 0.0 && chain.determinant.is_finite() && center.is_finite()) {
            return None;
        }
        // alpha >= 1/255 within the Mahalanobis distance sqrt(2 ln(255 opacity)); the slack covers rounding.
        let distance_squared = 2.0 * LN_2 * (reach + SLACK);
        let half = [xx, yy].map(|v| (distance_squared * v).sqrt() + SLACK_PIXELS);
        let outside = (0..2).any(|k| center[k] + half[k] < 0.5 || center[k] - half[k] > self.size[k] as f32 - 0.5);
        if outside {
            return None;
        }
        let inverse = LOG2_E / chain.determinant;
        Some(Flat {
            x: center.x,
            y: center.y,
            xx: -0.5 * inverse * yy,
            xy: inverse * xy,
            yy: -0.5 * inverse * xx,
            log2_opacity,
            rgb: self.shade(splats, i).to_array(),
            depth,
            half,
            discriminant: LOG2_E * inverse,
        })
    }

    /// Colour as seen from the camera; fixed colours are not clamped.
    fn shade(&self, splats: &SplatView<'_>, i: usize) -> Vec3 {
        match splats.colors {
            Colors::Fixed(c) => Vec3::from(c[i]),
            Colors::Sh { sh, degree, .. } => {
                let stride = 3 * (degree + 1) * (degree + 1);
                let active = degree.min(self.sh_degree);
                sh::color(active, self.direction(splats, i).0, &sh[i * stride..(i + 1) * stride]).max(Vec3::ZERO)
            }
        }
    }

    /// Viewing direction in the frame of the harmonics, unit direction in the world and distance.
    fn direction(&self, splats: &SplatView<'_>, i: usize) -> (Vec3, Vec3, f32) {
        let offset = Vec3::from(splats.means[i]) - self.eye;
        let distance = offset.length();
        let world = offset / distance;
        (frame(splats, i).map_or(world, |f| f * world), world, distance)
    }

    fn chain(&self, splats: &SplatView<'_>, i: usize) -> Chain {
        let mean = Vec3::from(splats.means[i]);
        let [r0, r1, r2] = self.rows;
        let p = Vec3::new(r0.dot(mean), r1.dot(mean), r2.dot(mean)) + self.translation;
        let ratio = Vec2::new(p.x, p.y) / p.z;
        let [lx, ly] = self.limits;
        let clamped = Vec2::new(ratio.x.max(lx[0]).min(lx[1]), ratio.y.max(ly[0]).min(ly[1]));
        let (unit, norm) = normalize(splats.rotations[i]);
        let rotation = matrix(unit);
        let scale = Vec3::from(splats.log_scales[i].map(f32::exp));
        let f = self.focal / p.z;
        let to_image = [f.x * (r0 - clamped.x * r2), f.y * (r1 - clamped.y * r2)];
        let scaled = to_image.map(|row| rotation.transpose() * row * scale);
        let [a, b] = scaled;
        let (aa, bb) = (a.length_squared(), b.length_squared());
        // Lagrange's identity: no cancellation for thin Gaussians.
        let determinant = a.cross(b).length_squared() + self.blur * (aa + bb) + self.blur * self.blur;
        let covariance = [aa + self.blur, a.dot(b), bb + self.blur];
        Chain { p, ratio, clamped, unit, norm, rotation, scale, to_image, scaled, covariance, determinant }
    }

    /// Gradients of the parameters of a drawn Gaussian from its sums over pixels; `d_sh` is overwritten (empty for fixed
    /// colours).
    pub(crate) fn adjoint(
        &self,
        splats: &SplatView<'_>,
        i: usize,
        sums: &Sums,
        flat: &Flat,
        d_sh: &mut [f32],
    ) -> Gradient {
        let chain = self.chain(splats, i);
        let [xx, xy, yy] = chain.covariance;
        let inverse = chain.determinant.recip();
        let conic = [yy * inverse, -xy * inverse, xx * inverse];
        let d_center = symmetric(conic, sums.first);
        let (log_scale, d_to_image, d_rotation) = chain.spread_adjoint(sandwich(conic, sums.second));
        let mut d_mean = self.position_adjoint(&chain, d_center, d_to_image, sums.depth);
        d_mean += self.color_adjoint(splats, i, sums.rgb, flat, d_sh);
        let mean_variance = 0.5 * (xx + yy);
        let spread = (mean_variance * mean_variance - chain.determinant).max(RADIUS_SPREAD_MIN).sqrt();
        let half_size = Vec2::new(self.size[0] as f32, self.size[1] as f32) / 2.0;
        Gradient {
            mean: d_mean.to_array(),
            rotation: chain.quaternion_adjoint(d_rotation),
            log_scale: log_scale.to_array(),
            logit_opacity: sums.g / (1.0 + splats.logit_opacities[i].exp()),
            mean2d: (d_center * half_size).length(),
            radius: (RADIUS_DEVIATIONS * (mean_variance + spread).sqrt()).ceil(),
        }
    }

    /// Gradient of the world-space centre through the projected centre, the Jacobian and the depth.
    fn position_adjoint(&self, chain: &Chain, d_center: Vec2, d_to_image: [Vec3; 2], d_depth: f32) -> Vec3 {
        let [r0, r1, r2] = self.rows;
        let inverse = chain.p.z.recip();
        let rows = [r0, r1];
        let mut d_p = Vec3::new(0.0, 0.0, d_depth);
        for k in 0..2 {
            let f = self.focal[k] * inverse;
            let d_f = d_to_image[k].dot(rows[k] - chain.clamped[k] * r2);
            let mut d_ratio = self.focal[k] * d_center[k];
            if chain.clamped[k] == chain.ratio[k] {
                d_ratio -= f * d_to_image[k].dot(r2);
            }
            d_p[k] = d_ratio * inverse;
            d_p.z -= inverse * (f * d_f + d_ratio * chain.ratio[k]);
        }
        d_p.x * r0 + d_p.y * r1 + d_p.z * r2
    }

    /// Gradient of the harmonics, and of the world-space centre through the viewing direction.
    fn color_adjoint(&self, splats: &SplatView<'_>, i: usize, d_rgb: Vec3, flat: &Flat, d_sh: &mut [f32]) -> Vec3 {
        let Colors::Sh { sh, degree, .. } = splats.colors else { return Vec3::ZERO };
        let shown = Vec3::from(flat.rgb.map(|c| if c > 0.0 { 1.0 } else { 0.0 }));
        let stride = 3 * (degree + 1) * (degree + 1);
        let (local, world, distance) = self.direction(splats, i);
        let active = degree.min(self.sh_degree);
        let d_local = sh::color_adjoint(active, local, &sh[i * stride..(i + 1) * stride], d_rgb * shown, d_sh);
        let d_world = frame(splats, i).map_or(d_local, |f| f.transpose() * d_local);
        (d_world - world * world.dot(d_world)) / distance
    }
}

impl Chain {
    /// Gradients of log scales, of `to_image` and of the rotation matrix, given the symmetric one of the covariance.
    fn spread_adjoint(&self, [gxx, gxy, gyy]: [f32; 3]) -> (Vec3, [Vec3; 2], Mat3) {
        let [a, b] = self.scaled;
        let d_scaled = [2.0 * (gxx * a + gxy * b), 2.0 * (gxy * a + gyy * b)];
        let log_scale = d_scaled[0] * a + d_scaled[1] * b;
        let d_turned = d_scaled.map(|d| d * self.scale);
        let d_to_image = d_turned.map(|d| self.rotation * d);
        let [t0, t1] = self.to_image;
        let column = |k: usize| t0 * d_turned[0][k] + t1 * d_turned[1][k];
        (log_scale, d_to_image, Mat3::from_cols(column(0), column(1), column(2)))
    }

    /// Gradient of the raw quaternion, given that of the rotation matrix.
    fn quaternion_adjoint(&self, d: Mat3) -> [f32; 4] {
        if self.norm == 0.0 {
            return [0.0; 4];
        }
        let [w, x, y, z] = self.unit;
        let (c0, c1, c2) = (d.x_axis, d.y_axis, d.z_axis);
        let turn = Vec3::new(c1.z - c2.y, c2.x - c0.z, c0.y - c1.x);
        let (sxy, sxz, syz) = (c1.x + c0.y, c2.x + c0.z, c2.y + c1.z);
        let g = [
            2.0 * (x * turn.x + y * turn.y + z * turn.z),
            2.0 * (w * turn.x + y * sxy + z * sxz - 2.0 * x * (c1.y + c2.z)),
            2.0 * (w * turn.y + x * sxy + z * syz - 2.0 * y * (c0.x + c2.z)),
            2.0 * (w * turn.z + x * sxz + y * syz - 2.0 * z * (c0.x + c1.y)),
        ];
        let along = w * g[0] + x * g[1] + y * g[2] + z * g[3];
        std::array::from_fn(|k| (g[k] - self.unit[k] * along) / self.norm)
    }
}

fn frame(splats: &SplatView<'_>, i: usize) -> Option<Mat3> {
    let Colors::Sh { frames: Some(frames), .. } = splats.colors else { return None };
    Some(Mat3::from_cols_array_2d(&frames.world_to_frame[usize::from(frames.index[i])]).transpose())
}

/// Unit quaternion and length; the identity and 0 for the zero quaternion.
fn normalize(q: [f32; 4]) -> ([f32; 4], f32) {
    let norm = q.iter().map(|x| x * x).sum::<f32>().sqrt();
    if norm <= QUATERNION_MIN { ([1.0, 0.0, 0.0, 0.0], 0.0) } else { (q.map(|x| x / norm), norm) }
}

fn matrix([w, x, y, z]: [f32; 4]) -> Mat3 {
    Mat3::from_cols(
        Vec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        Vec3::new(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        Vec3::new(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
}

fn symmetric([xx, xy, yy]: [f32; 3], v: Vec2) -> Vec2 {
    Vec2::new(xx * v.x + xy * v.y, xy * v.x + yy * v.y)
}

/// `K S K / 2` for symmetric `K` and `S`: the gradient of the covariance from the second moments `S`.
fn sandwich(k: [f32; 3], [sxx, sxy, syy]: [f32; 3]) -> [f32; 3] {
    let u = symmetric(k, Vec2::new(sxx, sxy));
    let v = symmetric(k, Vec2::new(sxy, syy));
    let top = symmetric(k, Vec2::new(u.x, v.x));
    let bottom = symmetric(k, Vec2::new(u.y, v.y));
    [0.5 * top.x, 0.5 * top.y, 0.5 * bottom.y]
}
