//! Checks that mass and inertia of a link are plausible for its size.

use crate::CheckOptions;
use crate::model::{Link, bounds, tensor};
use crate::report::LinkFinding;
use glam::DVec3;

/// Checks a link of the URDF.
pub(crate) fn link(link: &Link, options: &CheckOptions) -> LinkFinding {
    let (mass, moments) = link.inertial.map_or((0.0, [0.0; 3]), |i| (i.mass, principal(i.inertia)));
    let (link_name, hulls) = (link.name.clone(), link.hulls.len());
    LinkFinding { link: link_name, mass, moments, hulls, problems: problems(link, moments, options) }
}

fn problems(link: &Link, moments: [f64; 3], options: &CheckOptions) -> Vec<String> {
    let mut out = Vec::new();
    let Some(inertial) = &link.inertial else { return out };
    let (mass, [a, b, c]) = (inertial.mass, moments);
    if !(mass > 0.0 && mass.is_finite()) {
        return vec![format!("mass {mass} kg, must be above 0")];
    }
    if !(a > 0.0 && c.is_finite()) {
        return vec![format!("principal moments {a:.3e} {b:.3e} {c:.3e} kg m^2, must be above 0")];
    }
    if a + b < c * (1.0 - 1e-6) {
        out.push(format!("principal moment {c:.3e} exceeds the sum of {a:.3e} and {b:.3e}; no body has that"));
    }
    let points = link.visuals.iter().chain(&link.hulls).flat_map(|s| &s.points).copied();
    let Some([low, high]) = bounds(points) else { return out };
    /// Least assumed thickness of a link, metres.
    const THINNEST: f64 = 1e-3;
    let size = (high - low).max(DVec3::splat(THINNEST));
    let density = mass / (size.x * size.y * size.z);
    let [least, most] = options.density;
    if density < least || density > most {
        out.push(format!(
            "{mass:.4} kg in a box of {:.3} x {:.3} x {:.3} m: {density:.3e} kg/m^3",
            size.x, size.y, size.z
        ));
    }
    let slack = 0.05 * size.length();
    let center = inertial.center;
    if center.cmplt(low - slack).any() || center.cmpgt(high + slack).any() {
        out.push(format!("centre of mass {center} is outside of the link"));
    }
    // Upper bound: all mass in the farthest corner. Lower bound: a needle of a thousandth of the size.
    let reach = (high - center).abs().max((low - center).abs()).length();
    if c > 1.01 * mass * reach * reach {
        out.push(format!("principal moment {c:.3e} kg m^2, {mass:.4} kg within {reach:.3} m have less"));
    }
    if c < 1e-6 * mass * size.length_squared() {
        out.push(format!("principal moment {c:.3e} kg m^2 is too small, the link is {:.3} m long", size.length()));
    }
    out
}

/// Eigenvalues of `ixx iyy izz ixy ixz iyz`, ascending, by Jacobi rotations until the matrix is diagonal.
pub(crate) fn principal(inertia: [f64; 6]) -> [f64; 3] {
    let mut m = tensor(inertia).to_cols_array_2d();
    for round in 0..60 {
        let (p, q) = [(0, 1), (0, 2), (1, 2)][round % 3];
        if m[p][q] == 0.0 {
            continue;
        }
        let theta = 0.5 * (2.0 * m[p][q]).atan2(m[q][q] - m[p][p]);
        let (s, c) = theta.sin_cos();
        for k in 0..3 {
            let (x, y) = (m[k][p], m[k][q]);
            (m[k][p], m[k][q]) = (c * x - s * y, s * x + c * y);
        }
        for k in 0..3 {
            let (x, y) = (m[p][k], m[q][k]);
            (m[p][k], m[q][k]) = (c * x - s * y, s * x + c * y);
        }
    }
    let mut out = [m[0][0], m[1][1], m[2][2]];
    out.sort_by(f64::total_cmp);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Shape;
    use artgs_core::{Inertial, Rigid};

    fn cube(inertial: Inertial) -> Vec<String> {
        let points =
            (0..8).map(|i| DVec3::from_array([0, 1, 2].map(|a| if i >> a & 1 == 0 { -0.5 } else { 0.5 }))).collect();
        let mut body = Link::new("cube", None, Rigid::IDENTITY);
        body.inertial = Some(inertial);
        body.hulls = vec![Shape { points, triangles: Vec::new() }];
        link(&body, &CheckOptions::default()).problems
    }

    #[test]
    fn moments_of_known_tensors() {
        assert_eq!(principal([3.0, 1.0, 2.0, 0.0, 0.0, 0.0]), [1.0, 2.0, 3.0]);
        // [[2, 1], [1, 2]] has 1 and 3.
        let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-12);
        assert!(near(principal([2.0, 2.0, 5.0, 1.0, 0.0, 0.0]), [1.0, 3.0, 5.0]));
        assert!(near(principal([2.0, 5.0, 2.0, 0.0, -1.0, 0.0]), [1.0, 3.0, 5.0]));
        assert!(near(principal([1.0, 1.0, 1.0, 1.0, 1.0, 1.0]), [0.0, 0.0, 3.0]));
    }

    #[test]
    fn implausible_bodies_are_reported() {
        let good = Inertial { mass: 100.0, center: DVec3::ZERO, inertia: [16.7, 16.7, 16.7, 0.0, 0.0, 0.0] };
        assert_eq!(cube(good), Vec::<String>::new());
        let reports = |inertial: Inertial, words: &str| {
            let found = cube(inertial);
            assert!(found.len() == 1 && found[0].contains(words), "{found:?}");
        };
        reports(Inertial { mass: 0.0, ..good }, "mass 0 kg");
        reports(Inertial { inertia: [16.7, 16.7, -1.0, 0.0, 0.0, 0.0], ..good }, "must be above 0");
        reports(Inertial { inertia: [1.0, 1.0, 16.7, 0.0, 0.0, 0.0], ..good }, "exceeds the sum");
        reports(Inertial { mass: 1e6, inertia: good.inertia.map(|v| v * 1e4), ..good }, "kg/m^3");
        reports(Inertial { center: DVec3::new(0.0, 2.0, 0.0), ..good }, "outside");
        reports(Inertial { inertia: good.inertia.map(|v| v * 10.0), ..good }, "have less");
        reports(Inertial { inertia: good.inertia.map(|v| v * 1e-6), ..good }, "too small");
    }
}
