//! Planes through small sets of points.

use glam::{DMat3, DVec3, Vec3};
use nalgebra::{Matrix3, SymmetricEigen};

/// Unit normal of the least-squares plane and the root mean square distance from it. Points should be relative to one of
/// them.
pub(crate) fn fit_plane(points: &[Vec3]) -> (Vec3, f32) {
    let mut sum = DVec3::ZERO;
    let (mut diagonal, mut others) = (DVec3::ZERO, DVec3::ZERO);
    for p in points {
        let p = p.as_dvec3();
        sum += p;
        diagonal += p * p;
        others += DVec3::new(p.x * p.y, p.x * p.z, p.y * p.z);
    }
    let count = points.len().max(1) as f64;
    let mean = sum / count;
    let d = diagonal / count - mean * mean;
    let o = others / count - DVec3::new(mean.x * mean.y, mean.x * mean.z, mean.y * mean.z);
    let covariance = DMat3::from_cols(DVec3::new(d.x, o.x, o.y), DVec3::new(o.x, d.y, o.z), DVec3::new(o.y, o.z, d.z));
    let (normal, variance) = least_eigenvector(&covariance);
    (normal.as_vec3(), variance.max(0.0).sqrt() as f32)
}

/// Unit eigenvector of the least eigenvalue of a symmetric matrix, and that eigenvalue; by the trigonometric solution of the
/// characteristic polynomial (Smith 1961), ten times as fast as an iteration.
fn least_eigenvector(m: &DMat3) -> (DVec3, f64) {
    /// Squared length of the largest cross product, relative to the fourth power of the matrix, below which the two least
    /// eigenvalues are too close to each other for their difference to be computed.
    const CLOSE: f64 = 1e-16;
    let mean = (m.x_axis.x + m.y_axis.y + m.z_axis.z) / 3.0;
    let shifted = *m - DMat3::from_diagonal(DVec3::splat(mean));
    let square = shifted.x_axis.length_squared() + shifted.y_axis.length_squared() + shifted.z_axis.length_squared();
    let p = (square / 6.0).sqrt();
    if p > 0.0 {
        let angle = (0.5 * (shifted * (1.0 / p)).determinant()).clamp(-1.0, 1.0).acos() / 3.0;
        let least = mean + 2.0 * p * (angle + std::f64::consts::TAU / 3.0).cos();
        let rest = *m - DMat3::from_diagonal(DVec3::splat(least));
        let crosses = [rest.x_axis.cross(rest.y_axis), rest.x_axis.cross(rest.z_axis), rest.y_axis.cross(rest.z_axis)];
        let longest = crosses.into_iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        if let Some(v) = longest.filter(|v| v.length_squared() > CLOSE * square * square) {
            return (v.normalize(), least);
        }
    }
    let eigen = SymmetricEigen::new(Matrix3::from_column_slice(&m.to_cols_array()));
    let i = eigen.eigenvalues.imin();
    let v = eigen.eigenvectors.column(i);
    (DVec3::new(v[0], v[1], v[2]), eigen.eigenvalues[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_are_those_of_the_iteration() {
        for i in 0..500 {
            let t = f64::from(i);
            let a = DMat3::from_cols(
                DVec3::new((1.3 * t).sin(), (0.7 * t).cos(), (2.1 * t).sin()),
                DVec3::new((0.4 * t).cos(), (1.9 * t).sin(), (0.3 * t).cos()),
                DVec3::new((2.7 * t).sin(), (0.9 * t).cos(), (1.1 * t).sin()),
            );
            // From round to flat: the third direction shrinks.
            let flat = DMat3::from_diagonal(DVec3::new(1.0, 0.8, 10_f64.powi(-(i % 9))));
            let m = a * flat * flat * a.transpose();
            let (v, least) = least_eigenvector(&m);
            let eigen = SymmetricEigen::new(Matrix3::from_column_slice(&m.to_cols_array()));
            let scale = eigen.eigenvalues.max();
            assert!((least - eigen.eigenvalues.min()).abs() < 1e-12 * scale);
            assert!((m * v - v * least).length() < 1e-10 * scale, "{i}");
            assert!((v.length() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn degenerate_points_give_a_unit_normal() {
        let line: Vec<Vec3> = (0..9).map(|i| Vec3::new(0.1 * i as f32, 0.2 * i as f32, 0.0)).collect();
        for points in [&line[..], &line[..1], &[Vec3::ONE; 5], &[]] {
            let (normal, rms) = fit_plane(points);
            assert!((normal.length() - 1.0).abs() < 1e-6 && rms < 1e-6, "{normal} {rms}");
        }
        let direction = Vec3::new(1.0, 2.0, 0.0).normalize();
        assert!(fit_plane(&line).0.dot(direction).abs() < 1e-5);
    }

    #[test]
    fn a_plane_is_recovered() {
        let normal = Vec3::new(0.3, -0.5, 0.8).normalize();
        let (u, v) = normal.any_orthonormal_pair();
        let points: Vec<Vec3> = (0..25).map(|i| u * (i % 5) as f32 * 0.01 + v * (i / 5) as f32 * 0.01).collect();
        let (found, rms) = fit_plane(&points);
        assert!(found.dot(normal).abs() > 1.0 - 1e-6 && rms < 1e-6);
    }
}
