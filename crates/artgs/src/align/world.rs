//! The world of a recording as stated and as refined: the rigid motion between them, and what it leaves.

use super::frames::DepthFrame;
use artgs_core::{FrameError, Rigid};
use glam::{DMat3, DVec3};
use nalgebra::Matrix3;

/// Points of a frame that are compared.
const POINTS: usize = 60;

/// A camera (to world) as stated and refined, and surface points in its frame.
pub(super) struct MovedCamera {
    pub(super) stated: Rigid,
    pub(super) refined: Rigid,
    pub(super) points: Vec<DVec3>,
}

/// The cameras of a recording: stated poses (camera to world) and the refined frames, in the same order.
pub(super) fn cameras(stated: impl Iterator<Item = Rigid>, frames: &[DepthFrame]) -> Vec<MovedCamera> {
    let camera = |(stated, frame): (Rigid, &DepthFrame)| {
        let step = frame.samples.len().div_ceil(POINTS).max(1);
        let points = frame.samples.iter().step_by(step).map(|s| frame.points[*s as usize].as_dvec3()).collect();
        MovedCamera { stated, refined: frame.pose(), points }
    };
    stated.zip(frames).map(camera).collect()
}

/// The motion that takes the points of the stated world to those of the refined one with the least squares of distances,
/// and what remains. Without three points apart it is the identity.
pub(super) fn motion(cameras: &[MovedCamera]) -> (Rigid, FrameError) {
    let pairs: Vec<(DVec3, DVec3)> =
        cameras.iter().flat_map(|c| c.points.iter().map(|p| (c.stated.apply(*p), c.refined.apply(*p)))).collect();
    let motion = best_motion(&pairs).unwrap_or(Rigid::IDENTITY);
    let mean = |sum: f64, n: usize| (sum / n.max(1) as f64).sqrt();
    let apart = pairs.iter().map(|(from, to)| motion.apply(*from).distance_squared(*to)).sum();
    let turned = cameras.iter().map(|c| ((motion * c.stated).inverse() * c.refined).angle().powi(2)).sum();
    (motion, FrameError { shift: mean(apart, pairs.len()), turn: mean(turned, cameras.len()) })
}

/// The rigid motion with the least squares of the distances of pairs; none if they do not fix it.
fn best_motion(pairs: &[(DVec3, DVec3)]) -> Option<Rigid> {
    /// Least ratio of the second and the first extent of points that are not on a line.
    const APART: f64 = 1e-6;
    let n = pairs.len() as f64;
    let from = pairs.iter().map(|p| p.0).sum::<DVec3>() / n;
    let to = pairs.iter().map(|p| p.1).sum::<DVec3>() / n;
    let mut moments = Matrix3::<f64>::zeros();
    for (a, b) in pairs {
        let (a, b) = (*a - from, *b - to);
        moments += nalgebra::Vector3::from(a.to_array()) * nalgebra::RowVector3::from(b.to_array());
    }
    let svd = moments.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mut sizes: Vec<f64> = svd.singular_values.iter().copied().collect();
    sizes.sort_by(f64::total_cmp);
    if pairs.len() < 3 || sizes[1].is_nan() || sizes[1] <= APART * sizes[2] {
        return None;
    }
    // A reflection would fit some planar points as well: the smallest direction is turned instead.
    let smallest = svd.singular_values.imin();
    let mut signs = Matrix3::<f64>::identity();
    signs[(smallest, smallest)] = (v_t.transpose() * u.transpose()).determinant().signum();
    let turn = v_t.transpose() * signs * u.transpose();
    let columns = turn.as_slice();
    let rotation = DMat3::from_cols_slice(columns);
    Some(Rigid::from_matrix(rotation, to - rotation * from))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cameras on an arc that look at a wall 2.5 m ahead; the refined ones are moved by `known` and jitter.
    fn moved(known: Rigid, jitter: f64) -> Vec<MovedCamera> {
        let camera = |i: usize| {
            let angle = -0.6 + 0.06 * i as f64;
            let stated =
                Rigid::about(DVec3::Y, DVec3::new(0.3, 1.2, 2.5), angle) * Rigid::shift(DVec3::new(0.3, 1.2, 0.0));
            let points = (0..25).map(|k| DVec3::new(0.3 * (k % 5) as f64 - 0.6, 0.25 * (k / 5) as f64 - 0.5, 2.5));
            let wave = |k: f64| (i as f64 * k).sin();
            let shake = Rigid::about(
                DVec3::new(wave(1.3), wave(2.1), wave(0.7)).normalize_or(DVec3::X),
                DVec3::ZERO,
                jitter * wave(3.7),
            );
            MovedCamera { stated, refined: known * stated * shake, points: points.collect() }
        };
        (0..20).map(camera).collect()
    }

    #[test]
    fn a_known_motion_is_found_with_what_remains() {
        let known = Rigid::shift(DVec3::new(0.02, -0.05, 0.01))
            * Rigid::about(DVec3::new(0.2, 1.0, -0.1).normalize(), DVec3::new(1.0, 2.0, 3.0), 0.024);
        let (found, error) = motion(&moved(known, 0.0));
        assert!((found.inverse() * known).angle() < 1e-9 && error.shift < 1e-9 && error.turn < 1e-7, "{error:?}");
        // The motion of 6 cm at 2.5 m that the identity would leave out.
        let ahead = DVec3::new(0.3, 1.2, 2.5);
        assert!(known.apply(ahead).distance(ahead) > 0.03);

        let jitter = 0.01;
        let (found, error) = motion(&moved(known, jitter));
        assert!(found.apply(ahead).distance(known.apply(ahead)) < 0.005, "{found:?}");
        // Jitter of at most 0.01 radians is 25 mm at 2.5 m.
        assert!((0.004..0.025).contains(&error.shift), "{error:?}");
        assert!((0.004..0.010).contains(&error.turn), "{error:?}");
    }

    #[test]
    fn cameras_without_points_say_nothing() {
        assert_eq!(motion(&[]).0, Rigid::IDENTITY);
        let mut blind = moved(Rigid::shift(DVec3::X), 0.0);
        blind.iter_mut().for_each(|c| c.points.clear());
        assert_eq!(motion(&blind).0, Rigid::IDENTITY);
    }
}
