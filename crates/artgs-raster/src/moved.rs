//! Scaling and rigid motion of Gaussians: positions, orientations, sizes and the harmonics of their colours.

use crate::sh::{COEFFICIENTS, basis};
use artgs_core::{Rigid, Splats};
use glam::{DVec3, Quat, Vec3};

/// Gaussians scaled by `scale`, above 0, then moved. A camera that is scaled and moved in the same way renders the same
/// image: colours turn with the Gaussians, which is exact for real harmonics.
pub fn moved(splats: &Splats, motion: &Rigid, scale: f64) -> Splats {
    let mut out = splats.clone();
    let turn = motion.rotation.as_quat();
    let log_scale = scale.ln() as f32;
    for mean in &mut out.means {
        *mean = motion.apply(DVec3::from_array(mean.map(f64::from)) * scale).as_vec3().to_array();
    }
    for q in &mut out.rotations {
        let turned = turn * Quat::from_xyzw(q[1], q[2], q[3], q[0]);
        *q = [turned.w, turned.x, turned.y, turned.z];
    }
    out.log_scales.iter_mut().flatten().for_each(|s| *s += log_scale);
    let matrix = turned_harmonics(splats.sh_degree, turn);
    let count = (splats.sh_degree + 1) * (splats.sh_degree + 1);
    for (new, old) in out.sh.chunks_mut(3 * count).zip(splats.sh.chunks(3 * count)) {
        for (i, row) in matrix.iter().take(count).enumerate() {
            for c in 0..3 {
                new[3 * i + c] = (0..count).map(|j| row[j] * old[3 * j + c]).sum();
            }
        }
    }
    out
}

/// `m[i][j]`: the coefficient of function `i` in the turned function `j`, which is the integral of their product over the
/// sphere. The quadrature is exact up to degree 7: Gauss-Legendre in z, equal steps of the azimuth.
fn turned_harmonics(degree: usize, turn: Quat) -> [[f32; COEFFICIENTS]; COEFFICIENTS] {
    const NODES: [(f32, f32); 4] = [
        (-0.861_136_3, 0.347_854_85),
        (-0.339_981_05, 0.652_145_15),
        (0.339_981_05, 0.652_145_15),
        (0.861_136_3, 0.347_854_85),
    ];
    const AZIMUTHS: usize = 8;
    let mut m = [[0.0; COEFFICIENTS]; COEFFICIENTS];
    for (z, weight) in NODES {
        for step in 0..AZIMUTHS {
            let (sin, cos) = (std::f32::consts::TAU * step as f32 / AZIMUTHS as f32).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let d = Vec3::new(r * cos, r * sin, z);
            let (new, old) = (basis(degree, d), basis(degree, turn.inverse() * d));
            let area = weight * std::f32::consts::TAU / AZIMUTHS as f32;
            for i in 0..COEFFICIENTS {
                for j in 0..COEFFICIENTS {
                    m[i][j] += new[i] * old[j] * area;
                }
            }
        }
    }
    m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sh::color;

    #[test]
    fn colours_turn_with_the_gaussian_and_shapes_scale() {
        let axis = DVec3::new(0.3, -0.8, 0.5).normalize();
        let motion = Rigid::about(axis, DVec3::new(1.0, 2.0, -1.0), 1.1);
        for degree in 0..=3 {
            let count = (degree + 1) * (degree + 1);
            let splats = Splats {
                means: vec![[0.1, 0.2, 0.3]],
                rotations: vec![[0.9, 0.1, -0.3, 0.2]],
                log_scales: vec![[-3.0, -2.0, -1.0]],
                logit_opacities: vec![0.5],
                sh_degree: degree,
                sh: (0..3 * count).map(|i| ((i * 37 % 17) as f32 - 8.0) * 0.02).collect(),
            };
            let result = moved(&splats, &motion, 2.0);
            assert!((result.log_scales[0][2] - (2f32.ln() - 1.0)).abs() < 1e-6);
            let want = motion.apply(DVec3::new(0.2, 0.4, 0.6)).as_vec3();
            assert!((Vec3::from_array(result.means[0]) - want).length() < 1e-5);
            for d in [Vec3::X, Vec3::new(0.6, -0.64, 0.48), Vec3::NEG_Z] {
                let turned = motion.rotation.as_quat() * d;
                let gap = color(degree, d, &splats.sh) - color(degree, turned, &result.sh);
                assert!(gap.length() < 1e-5, "degree {degree}: {gap}");
            }
            let local = |q: [f32; 4], d: Vec3| Quat::from_xyzw(q[1], q[2], q[3], q[0]).normalize() * d;
            let gap =
                motion.rotation.as_quat() * local(splats.rotations[0], Vec3::X) - local(result.rotations[0], Vec3::X);
            assert!(gap.length() < 1e-5);
        }
    }
}
