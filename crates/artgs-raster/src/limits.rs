//! Limits of projection and blending, shared by every implementation: the kernels of this crate, its reference and the
//! WGSL of `artgs-gpu`.

use artgs_core::Intrinsics;

/// Default of [`RenderOptions::near`](crate::RenderOptions::near), scene units.
pub const NEAR: f32 = 1e-3;
/// Near plane of training, as a fraction of half the side of the region that holds the object.
pub const TRAINING_NEAR: f64 = 0.05;
/// Default of [`RenderOptions::blur`](crate::RenderOptions::blur), square pixels: the value of 3DGS.
pub const BLUR: f32 = 0.3;

/// Base-2 logarithm of 1/255: a Gaussian is drawn in the pixels where its alpha is at least that.
pub const LOG2_CUT: f32 = -7.994_353_4;
/// Largest alpha of one Gaussian in one pixel. An alpha held at this value has no gradient.
pub const ALPHA_MAX: f32 = 0.99;
/// A pixel is finished once its transmittance is below this. The Gaussian that lowers it below still counts.
pub const TRANSMITTANCE_MIN: f32 = 1e-4;

/// Footprints are widened by this in log2(alpha), and by [`SLACK_PIXELS`], so that rounding loses no pixel.
pub const SLACK: f32 = 1e-3;
/// Footprints are widened by this in pixels.
pub const SLACK_PIXELS: f32 = 0.01;
/// Side of a tile, pixels.
pub const TILE: usize = 16;

/// Quaternions up to this length count as the identity and get no gradient.
pub const QUATERNION_MIN: f32 = 1e-12;
/// The reported radius of a footprint is this many standard deviations along its longest axis.
pub const RADIUS_DEVIATIONS: f32 = 3.0;
/// Least half difference of the two variances of a footprint, squared, in the reported radius (pixels to the fourth).
pub const RADIUS_SPREAD_MIN: f32 = 0.1;

/// The Jacobian of the projection follows a point up to this fraction of the image size beyond the border. For a centred
/// principal point that is 1.3 tan(fov / 2).
pub(crate) const JACOBIAN_MARGIN: f64 = 0.15;

/// Ranges of x / z and of y / z in which the Jacobian of the projection follows a point; beyond, it is that of the border
/// of the range.
pub fn jacobian_limits(k: &Intrinsics) -> [[f32; 2]; 2] {
    let along = |focal: f64, principal: f64, size: u32| {
        let size = f64::from(size);
        [(-principal - JACOBIAN_MARGIN * size) / focal, (size - principal + JACOBIAN_MARGIN * size) / focal]
            .map(|ratio| ratio as f32)
    };
    [along(k.fx, k.cx, k.width), along(k.fy, k.cy, k.height)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cut_is_one_step_of_eight_bits() {
        assert_eq!(LOG2_CUT, (1.0_f64 / 255.0).log2() as f32);
    }

    #[test]
    fn jacobian_limits_of_a_centred_camera_are_1_3_times_the_field_of_view() {
        let k = Intrinsics { fx: 50.0, fy: 40.0, cx: 32.0, cy: 24.0, width: 64, height: 48 };
        let [x, y] = jacobian_limits(&k);
        assert!((x[1] - 1.3 * 32.0 / 50.0).abs() < 1e-6 && x[0] == -x[1], "{x:?}");
        assert!((y[1] - 1.3 * 24.0 / 40.0).abs() < 1e-6 && y[0] == -y[1], "{y:?}");
    }
}
