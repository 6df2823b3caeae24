//! Whether a link stands in another one at the limits of its joint: visual meshes, where the capture showed them. Hulls say nothing of
//! it, because an export cuts them until they keep apart within the limits.

use crate::CheckOptions;
use crate::coverage::samples;
use crate::model::{Model, bounds};
use crate::observed::Observed;
use crate::report::LimitFinding;
use crate::shadow::Triangles;
use crate::table::quantity;
use artgs_core::{Rigid, State};
use glam::DVec3;
use rayon::prelude::*;

/// What of the surface of a link, and of what it carries, is inside of other links at both limits of its joint, and was not at the observed
/// value nearest to the limit; the other joints are at 0. None without a joint that has finite limits and observed values.
pub(crate) fn joint(
    model: &Model,
    observed: &[Option<Observed>],
    link: usize,
    options: &CheckOptions,
) -> Option<LimitFinding> {
    let motion = model.links[link].motion.as_ref()?;
    let values = motion.observed.filter(|_| motion.limits.iter().all(|limit| limit.is_finite()))?;
    let boxes = model.links.iter().filter_map(|link| link.bounds(&link.visuals));
    let [low, high] = bounds(boxes.flatten())?;
    let depth = options.deep * (high - low).length();
    let carried = model.carried(link);
    let points = |i: usize| -> Vec<DVec3> {
        let visuals: Vec<Triangles> =
            model.links[i].visuals.iter().map(|s| (&s.points[..], &s.triangles[..])).collect();
        let holds = |p: &DVec3| observed[i].as_ref().is_some_and(|observed| observed.holds(*p));
        samples(&visuals, options.samples).into_iter().filter(holds).collect()
    };
    let own: Vec<(usize, Vec<DVec3>)> = (0..carried.len()).filter(|i| carried[*i]).map(|i| (i, points(i))).collect();
    let total = own.iter().map(|(_, points)| points.len()).sum::<usize>();
    let inside = |value: f64, other: usize| {
        let mut all = vec![0.0; model.links.len()];
        all[link] = value;
        let poses = model.poses(&all);
        let Some(surface) = observed[other].as_ref() else { return 0 };
        let count = |(i, points): &(usize, Vec<DVec3>)| {
            let to_other: Rigid = poses[other].inverse() * poses[*i];
            points.par_iter().filter(|p| surface.is_deep(to_other.apply(**p), depth)).count()
        };
        own.iter().map(count).sum::<usize>()
    };
    let mut found = LimitFinding {
        joint: motion.name.clone(),
        kind: Some(motion.kind),
        limits: motion.limits,
        depth,
        ..LimitFinding::default()
    };
    for (end, limit) in motion.limits.into_iter().enumerate() {
        let seen =
            State::ALL.map(|s| values[s]).into_iter().min_by(|a, b| (a - limit).abs().total_cmp(&(b - limit).abs()));
        let seen = seen.filter(|seen| *seen != limit && total > 0);
        let share = |other: usize| {
            let more = seen.map_or(0, |seen| inside(limit, other).saturating_sub(inside(seen, other)));
            more as f64 / total.max(1) as f64
        };
        let others = (0..carried.len()).filter(|i| !carried[*i]).map(|other| (other, share(other)));
        let Some((other, share)) = others.max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        found.inside[end] = share;
        if share > options.inside {
            let (at, name) = (quantity(motion.kind, limit), &model.links[other].name);
            let text = format!(
                "at its limit of {at}, {:.0} % of its surface is more than {:.0} mm inside of {name}",
                100.0 * share,
                1e3 * depth
            );
            found.warnings.push(text);
        }
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Link, Motion, Shape};
    use artgs_core::{JointKind, Mesh, PerState};

    fn shape(mesh: &Mesh) -> Shape {
        let points = mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from))).collect();
        Shape { points, triangles: mesh.triangles.clone() }
    }

    #[test]
    fn a_slide_that_ends_in_a_wall_is_found_and_one_that_touches_it_is_not() {
        // A block between y = 0 and 0.2 on its way to a wall of 10 cm at y = -0.3; it was seen there and 0.1 farther.
        let (block, wall) = (Mesh::cuboid([0.0; 3], [0.2; 3]), Mesh::cuboid([-0.1, -0.4, -0.1], [0.3, -0.3, 0.3]));
        let found = |lower: f64| {
            let motion = Motion {
                limits: [lower, 0.1],
                observed: Some(PerState::new(0.0, 0.1)),
                ..Motion::new("slide", JointKind::Prismatic, DVec3::Y)
            };
            let base = Link { visuals: vec![shape(&wall)], ..Link::new("wall", None, Rigid::IDENTITY) };
            let part = Link {
                visuals: vec![shape(&block)],
                motion: Some(motion),
                ..Link::new("block", Some(0), Rigid::IDENTITY)
            };
            let model = Model { links: vec![base, part], has_hulls: true };
            let observed = [&wall, &block].map(|mesh| Observed::new(mesh, 1.0, &Rigid::IDENTITY));
            joint(&model, &observed, 1, &CheckOptions::default()).unwrap()
        };
        let touching = found(-0.301);
        assert!(touching.inside == [0.0; 2] && touching.warnings.is_empty(), "{touching:?}");
        let inside = found(-0.34);
        // Of the four sides of the block, what is between 1 and 3 depths behind the face of the wall; its front is deeper than that.
        let expected = 4.0 * 0.2 * 2.0 * inside.depth / (6.0 * 0.2 * 0.2);
        assert!((inside.inside[0] - expected).abs() < 0.002 && inside.inside[1] == 0.0, "{inside:?}");
        assert!(inside.warnings.len() == 1 && inside.warnings[0].contains("of wall"), "{inside:?}");
    }
}
