//! Whether an object with a free base stands, and whether parts are heavier than what carries them.

use crate::model::{Model, bounds};
use artgs_core::Rigid;
use glam::{DVec2, DVec3};

/// What is odd about the balance of an object, one sentence each.
pub(crate) fn notes(model: &Model) -> Vec<String> {
    let mut out = Vec::new();
    let masses: Vec<f64> = model.links.iter().map(|l| l.inertial.map_or(0.0, |i| i.mass)).collect();
    let Some(base) = model.links.iter().position(crate::model::Link::is_body) else { return out };
    for (i, link) in model.links.iter().enumerate() {
        if i != base && masses[i] > masses[base] {
            let [part, whole] = [masses[i], masses[base]].map(|m| format!("{m:.2} kg"));
            out.push(format!(
                "`{}` has {part}, more than the base with {whole}; see --density of artgs export",
                link.name
            ));
        }
    }
    let mut values = vec![0.0; model.links.len()];
    let feet = feet(model, base, &model.poses(&values));
    if feet.len() < 3 {
        return out;
    }
    let mut tips = |values: &[f64], when: &str| {
        let margin = margin(&feet, center(model, &masses, &model.poses(values)));
        if margin < 0.0 {
            out.push(format!(
                "with a free base the object falls over {when}: its centre of mass is {:.0} mm beyond its feet",
                -1e3 * margin
            ));
        }
        margin < 0.0
    };
    if tips(&values, "with all joints at 0") {
        return out;
    }
    for i in 0..model.links.len() {
        if let Some(motion) = &model.links[i].motion {
            values[i] = motion.limits[1];
            tips(&values, &format!("with `{}` at its upper limit", model.links[i].name));
            values[i] = 0.0;
        }
    }
    out
}

/// Convex outline of the lowest part of the base, counter-clockwise: feet differ by the error of the reconstruction.
fn feet(model: &Model, base: usize, poses: &[Rigid]) -> Vec<DVec2> {
    const LOWEST: f64 = 0.03;
    let points = || model.links[base].visuals.iter().flat_map(|s| &s.points).map(|p| poses[base].apply(*p));
    let Some([low, high]) = bounds(points()) else { return Vec::new() };
    let mut flat: Vec<DVec2> =
        points().filter(|p| p.z < low.z + LOWEST * (high.z - low.z)).map(DVec3::truncate).collect();
    flat.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    flat.dedup();
    let chain = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut out: Vec<DVec2> = Vec::new();
        for p in points {
            while out.len() >= 2 && (out[out.len() - 1] - out[out.len() - 2]).perp_dot(p - out[out.len() - 1]) <= 0.0 {
                out.pop();
            }
            out.push(p);
        }
        out.pop();
        out
    };
    [chain(&mut flat.iter().copied()), chain(&mut flat.iter().rev().copied())].concat()
}

/// Centre of mass, seen from above.
fn center(model: &Model, masses: &[f64], poses: &[Rigid]) -> DVec2 {
    let total: f64 = masses.iter().sum();
    let moment = |i: usize| poses[i].apply(model.links[i].inertial.unwrap_or_default().center) * masses[i];
    ((0..masses.len()).map(moment).sum::<DVec3>() / total.max(f64::MIN_POSITIVE)).truncate()
}

/// Distance of a point from the outline, negative outside.
fn margin(outline: &[DVec2], p: DVec2) -> f64 {
    let side = |i: usize| {
        let (a, b) = (outline[i], outline[(i + 1) % outline.len()]);
        (b - a).normalize_or_zero().perp_dot(p - a)
    };
    (0..outline.len()).map(side).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Link, Motion, Shape};
    use artgs_core::{Inertial, JointKind, Mesh};

    fn body(name: &str, low: [f32; 3], high: [f32; 3], mass: f64) -> Link {
        let mesh = Mesh::cuboid(low, high);
        let points: Vec<DVec3> = mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from))).collect();
        let center = points.iter().sum::<DVec3>() / 8.0;
        let mut link = Link::new(name, None, Rigid::IDENTITY);
        link.inertial = Some(Inertial { mass, center, inertia: [1.0, 1.0, 1.0, 0.0, 0.0, 0.0] });
        link.visuals = vec![Shape { points, triangles: mesh.triangles }];
        link
    }

    #[test]
    fn a_heavy_drawer_pulls_its_cabinet_over_when_it_is_open() {
        let model = |mass: f64| {
            let base = body("base", [0.0; 3], [1.0, 0.4, 1.0], 10.0);
            let mut drawer = body("drawer", [0.0, 0.0, 0.5], [1.0, 0.4, 0.7], mass);
            drawer.parent = Some(0);
            let slide = Motion { limits: [0.0, 0.4], ..Motion::new("slide", JointKind::Prismatic, DVec3::NEG_Y) };
            drawer.motion = Some(slide);
            Model { links: vec![base, drawer], has_hulls: true }
        };
        assert_eq!(notes(&model(2.0)), Vec::<String>::new());
        // 0.2 - 0.4 * 20 / 30 is 67 mm before the front.
        let found = notes(&model(20.0));
        assert!(found.len() == 2 && found[0].contains("more than the base"), "{found:?}");
        assert!(found[1].contains("with `drawer` at its upper limit") && found[1].contains("67 mm"), "{found:?}");
    }
}
