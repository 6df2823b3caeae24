//! Real spherical harmonics up to degree 3 with the signs of 3DGS.

use glam::Vec3;

/// Coefficients of the highest degree.
pub(crate) const COEFFICIENTS: usize = 16;

/// Factor of the constant function.
pub const C0: f32 = 0.282_094_79;
/// Factor of the functions of degree 1.
pub const C1: f32 = 0.488_602_51;
/// Factors of the functions of degree 2: products of two coordinates, `2 z^2 - x^2 - y^2`, `x^2 - y^2`.
pub const C2: [f32; 3] = [1.092_548_4, 0.315_391_57, 0.546_274_2];
/// Factors of the functions of degree 3, in the order in which `basis` uses them first.
pub const C3: [f32; 5] = [0.590_043_6, 2.890_611_4, 0.457_045_8, 0.373_176_34, 1.445_305_7];

/// Values of the basis up to `degree` at a unit direction; zero beyond.
#[inline]
pub(crate) fn basis(degree: usize, d: Vec3) -> [f32; COEFFICIENTS] {
    let mut b = [0.0; COEFFICIENTS];
    let Vec3 { x, y, z } = d;
    b[0] = C0;
    if degree > 0 {
        b[1] = -C1 * y;
        b[2] = C1 * z;
        b[3] = -C1 * x;
    }
    if degree > 1 {
        b[4] = C2[0] * x * y;
        b[5] = -C2[0] * y * z;
        b[6] = C2[1] * (2.0 * z * z - x * x - y * y);
        b[7] = -C2[0] * x * z;
        b[8] = C2[2] * (x * x - y * y);
    }
    if degree > 2 {
        let ring = 4.0 * z * z - x * x - y * y;
        b[9] = -C3[0] * y * (3.0 * x * x - y * y);
        b[10] = C3[1] * x * y * z;
        b[11] = -C3[2] * y * ring;
        b[12] = C3[3] * z * (2.0 * z * z - 3.0 * x * x - 3.0 * y * y);
        b[13] = -C3[2] * x * ring;
        b[14] = C3[4] * z * (x * x - y * y);
        b[15] = -C3[0] * x * (x * x - 3.0 * y * y);
    }
    b
}

/// Gradient with respect to the direction (as a free vector) of `sum_k s[k] * basis[k]`.
#[inline]
pub(crate) fn basis_gradient(degree: usize, d: Vec3, s: &[f32; COEFFICIENTS]) -> Vec3 {
    let Vec3 { x, y, z } = d;
    let mut g = Vec3::ZERO;
    if degree > 0 {
        g += C1 * Vec3::new(-s[3], -s[1], s[2]);
    }
    if degree > 1 {
        g += C2[0] * (s[4] * Vec3::new(y, x, 0.0) - s[5] * Vec3::new(0.0, z, y) - s[7] * Vec3::new(z, 0.0, x));
        g += C2[1] * s[6] * Vec3::new(-2.0 * x, -2.0 * y, 4.0 * z);
        g += C2[2] * s[8] * Vec3::new(2.0 * x, -2.0 * y, 0.0);
    }
    if degree > 2 {
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let xy = x * y;
        g -= C3[0] * s[9] * Vec3::new(6.0 * xy, 3.0 * (xx - yy), 0.0);
        g += C3[1] * s[10] * Vec3::new(y * z, x * z, xy);
        g -= C3[2] * s[11] * Vec3::new(-2.0 * xy, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z);
        g += C3[3] * s[12] * Vec3::new(-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * (xx + yy));
        g -= C3[2] * s[13] * Vec3::new(4.0 * zz - 3.0 * xx - yy, -2.0 * xy, 8.0 * x * z);
        g += C3[4] * s[14] * Vec3::new(2.0 * x * z, -2.0 * y * z, xx - yy);
        g -= C3[0] * s[15] * Vec3::new(3.0 * (xx - yy), -6.0 * xy, 0.0);
    }
    g
}

/// `0.5 + sum_k basis[k] * sh[k]`, not clamped; `sh` is `[coefficient][rgb]`.
#[inline]
pub(crate) fn color(degree: usize, d: Vec3, sh: &[f32]) -> Vec3 {
    let b = basis(degree, d);
    let mut sum = Vec3::splat(0.5);
    for (k, c) in sh.chunks_exact(3).take((degree + 1) * (degree + 1)).enumerate() {
        sum += b[k] * Vec3::new(c[0], c[1], c[2]);
    }
    sum
}

/// Adjoint of [`color`]: writes the gradient of `sh` (zero beyond `degree`) and returns that of the direction.
#[inline]
pub(crate) fn color_adjoint(degree: usize, d: Vec3, sh: &[f32], d_color: Vec3, d_sh: &mut [f32]) -> Vec3 {
    let b = basis(degree, d);
    let mut s = [0.0; COEFFICIENTS];
    for (k, (c, g)) in sh.chunks_exact(3).zip(d_sh.chunks_exact_mut(3)).enumerate() {
        s[k] = Vec3::new(c[0], c[1], c[2]).dot(d_color);
        g.copy_from_slice(&(b[k] * d_color).to_array());
    }
    basis_gradient(degree, d, &s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::harmonic;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    fn directions() -> Vec<Vec3> {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        (0..40).map(|_| Vec3::from([0; 3].map(|_| rng.random_range(-1.0f32..1.0))).normalize()).collect()
    }

    #[test]
    fn basis_agrees_with_the_legendre_recurrences() {
        for d in directions() {
            let b = basis(3, d);
            for l in 0..4usize {
                for m in -(l as i32)..=l as i32 {
                    let want = harmonic(l, m, d.as_dvec3());
                    let got = f64::from(b[((l * l + l) as i32 + m) as usize]);
                    assert!((want - got).abs() < 2e-6, "l {l} m {m}: {want} {got}");
                }
            }
        }
    }

    #[test]
    fn basis_gradient_agrees_with_differences() {
        for d in directions() {
            for k in 0..COEFFICIENTS {
                let mut s = [0.0; COEFFICIENTS];
                s[k] = 1.0;
                let g = basis_gradient(3, d, &s);
                for (axis, got) in [(Vec3::X, g.x), (Vec3::Y, g.y), (Vec3::Z, g.z)] {
                    let h = 1e-2;
                    // A cubic's central difference is off by h^2 f''' / 6, at most 24 * 2.9 * 1e-4 / 6 here.
                    let want = (basis(3, d + h * axis)[k] - basis(3, d - h * axis)[k]) / (2.0 * h);
                    assert!((want - got).abs() < 1.5e-3, "coefficient {k}: {want} {got}");
                }
            }
        }
    }
}
