//! Drops balls and boxes into drawers and onto shelves: they have to stay there.

use crate::CheckOptions;
use crate::model::{Model, bounds};
use crate::observed::Observed;
use crate::places::{self, Place};
use crate::poses::{Scene, pose, vector};
use crate::report::DropFinding;
use artgs_core::{JointKind, Rigid};
use glam::DVec3;
use rapier3d::prelude::*;

/// Radius of balls, half an edge of boxes.
const RADIUS: f64 = 0.02;
/// Least height that has to be free above a place.
const ROOM: f64 = 0.06;
/// Largest height from which things fall.
const HIGHEST: f64 = 0.1;
/// Largest number of places per link.
const MOST: usize = 6;

/// Drops things onto the places of a link while its joint is at its upper limit and the others at 0; none if it has no places.
/// `seen` are the visual meshes of all links.
pub(crate) fn link(
    model: &Model,
    scene: &Scene,
    index: usize,
    seen: &[Option<crate::drawn::Drawn>],
    observed: Option<&Observed>,
    options: &CheckOptions,
) -> Option<DropFinding> {
    let link = &model.links[index];
    let mut values = vec![0.0; model.links.len()];
    if let Some(motion) = link.motion.as_ref().filter(|m| m.kind == JointKind::Prismatic) {
        values[index] = motion.limits[1];
    }
    let poses = model.poses(&values);
    let places: Vec<Place> = places::of(link, &poses[index], observed).into_iter().take(MOST).collect();
    let room = |p: DVec3| -> f64 {
        let free = |(drawn, at): (&Option<crate::drawn::Drawn>, &Rigid)| {
            let to_link = at.inverse();
            drawn.as_ref()?.ray(to_link.apply(p + DVec3::Z * 1e-3), to_link.turn(DVec3::Z), HIGHEST + RADIUS)
        };
        seen.iter().zip(&poses).filter_map(free).fold(HIGHEST + RADIUS, f64::min)
    };
    let is_free = |p: DVec3| {
        let far = |(drawn, at): (&Option<crate::drawn::Drawn>, &Rigid)| {
            drawn.as_ref().map_or(f64::INFINITY, |drawn| drawn.signed(at.inverse().apply(p)))
        };
        seen.iter().zip(&poses).all(|pair| far(pair) > 1.2 * RADIUS)
    };
    // Where a part slides, its carrier holds nothing.
    let zero = model.poses(&vec![0.0; model.links.len()]);
    let slides = |l: &crate::model::Link| l.motion.as_ref().is_some_and(|m| m.kind == JointKind::Prismatic);
    let children = (0..model.links.len()).filter(|i| model.links[*i].parent == Some(index) && slides(&model.links[*i]));
    let boxes: Vec<[DVec3; 2]> = children
        .filter_map(|i| {
            let points = model.links[i].visuals.iter().flat_map(|s| &s.points);
            bounds(points.map(|p| zero[i].apply(*p)))
        })
        .collect();
    let in_drawer = |p: DVec3| boxes.iter().any(|[low, high]| p.cmpge(*low).all() && p.cmple(*high).all());
    let mut starts: Vec<(usize, DVec3)> = Vec::new();
    for (i, place) in places.iter().enumerate() {
        for p in &place.points {
            let height = room(*p);
            let start = *p + DVec3::Z * (height - 1.5 * RADIUS).max(1.5 * RADIUS);
            if height >= ROOM && is_free(start) && !in_drawer(*p) {
                starts.push((i, start));
            }
        }
    }
    if starts.is_empty() {
        return None;
    }
    let mut out = DropFinding { link: link.name.clone(), ..DropFinding::default() };
    out.places = (0..places.len()).filter(|i| starts.iter().any(|(of, _)| of == i)).count();
    drop(scene, &poses, &places, &starts, options, &mut out);
    if out.blocked > 0 {
        out.problems.push(format!(
            "{} of {} balls and boxes start inside a hull where nothing is drawn",
            out.blocked, out.dropped
        ));
    }
    if out.fell > 0 {
        out.problems
            .push(format!("{} of {} balls and boxes fall through the {} places", out.fell, out.dropped, out.places));
    }
    if out.sank > 0 {
        out.warnings.push(format!(
            "{} of {} balls and boxes sink more than 10 mm below the surface that is drawn",
            out.sank, out.dropped
        ));
    }
    Some(out)
}

/// A box, with a ball in each corner: of a face with more than four corners the engine uses the first four, so that a box on such a
/// floor has one point of contact and tips into it. Balls are not affected.
fn small_box() -> Vec<(SharedShape, DVec3)> {
    const CORNER: f64 = 0.2 * RADIUS;
    let half = RADIUS as Real;
    let side = |i: usize, k: usize| if i >> k & 1 == 0 { CORNER - RADIUS } else { RADIUS - CORNER };
    let corner = |i: usize| (SharedShape::ball(CORNER as Real), DVec3::new(side(i, 0), side(i, 1), side(i, 2)));
    std::iter::once((SharedShape::cuboid(half, half, half), DVec3::ZERO)).chain((0..8).map(corner)).collect()
}

/// A ball or a box.
struct Thing {
    place: usize,
    body: RigidBodyHandle,
    start: DVec3,
    /// How far it was below where it rests on the place, while it was there.
    deepest: f64,
    /// True as soon as it was beside the place: what rolls over the border may fall there, and roll below the place.
    has_left: bool,
}

impl Thing {
    fn follow(&mut self, at: DVec3, place: &Place) {
        match place.below(at) {
            Some(z) if !self.has_left => self.deepest = self.deepest.max(z + RADIUS - at.z),
            Some(_) => {}
            None => self.has_left = true,
        }
    }
}

/// Simulates a ball and a box at every start.
fn drop(
    scene: &Scene,
    poses: &[Rigid],
    places: &[Place],
    starts: &[(usize, DVec3)],
    options: &CheckOptions,
    out: &mut DropFinding,
) {
    /// Seconds.
    const TIME: f64 = 1.0;
    /// How far a thing may sink below the surface that is drawn.
    const SINKS: f64 = 0.01;
    /// Depth at which it is below the surface as a whole.
    const THROUGH: f64 = 2.0 * RADIUS;
    let mut world = PhysicsWorld { gravity: Vector::Z * -9.81, ..PhysicsWorld::default() };
    world.integration_parameters.dt = options.step as Real;
    // Things touch hulls only, not each other.
    let (solid, thing) = (Group::GROUP_1, Group::GROUP_2);
    let ground = world.insert_body(RigidBodyBuilder::fixed());
    for (hulls, at) in scene.hulls.iter().zip(poses) {
        for hull in hulls {
            let groups = InteractionGroups::new(solid, thing, InteractionTestMode::And);
            let collider = ColliderBuilder::new(hull.clone()).position(pose(at)).friction(0.6).collision_groups(groups);
            world.insert_collider(collider, Some(ground));
        }
    }
    let mut things: Vec<Thing> = Vec::new();
    for (place, start) in starts {
        for shapes in [vec![(SharedShape::ball(RADIUS as Real), DVec3::ZERO)], small_box()] {
            out.dropped += 1;
            if scene.holds(poses, *start, -0.5 * RADIUS) {
                out.blocked += 1;
                continue;
            }
            let body = RigidBodyBuilder::dynamic().translation(vector(*start)).ccd_enabled(true);
            let body = world.insert_body(body);
            let groups = InteractionGroups::new(thing, solid, InteractionTestMode::And);
            for (shape, at) in shapes {
                let collider = ColliderBuilder::new(shape).translation(vector(at)).density(500.0).friction(0.6);
                world.insert_collider(collider.collision_groups(groups), Some(body));
            }
            things.push(Thing { place: *place, body, start: *start, deepest: 0.0, has_left: false });
        }
    }
    for _ in 0..(TIME / options.step).ceil() as usize {
        world.step_with_events(&(), &());
        for thing in &mut things {
            let Some(body) = world.bodies.get(thing.body) else { continue };
            let at = DVec3::from_array(body.translation().to_array().map(f64::from));
            thing.follow(at, &places[thing.place]);
        }
    }
    let deeper = |than: f64| things.iter().filter(|thing| thing.deepest > than).count();
    out.fell = deeper(THROUGH);
    out.sank = deeper(SINKS) - out.fell;
    out.lost_at = things.iter().filter(|thing| thing.deepest > SINKS).map(|thing| thing.start.to_array()).collect();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Link, Shape};
    use rapier3d::parry::transformation::try_convex_hull;

    #[test]
    fn boxes_stay_on_a_floor_with_many_corners_and_fall_beside_it() {
        // The floor of a drawer, 12 mm thick, with ten corners.
        let rim = [
            [-0.5318, -0.5666],
            [-0.4947, -0.5751],
            [-0.3217, -0.5763],
            [0.5108, -0.57],
            [0.5314, -0.566],
            [0.5317, -0.5248],
            [0.5262, -0.1374],
            [0.5222, -0.1291],
            [0.378, -0.1281],
            [-0.5286, -0.1339],
        ];
        let corners = rim.iter().flat_map(|[x, y]| [1.0475, 1.0596].map(|z| vector(DVec3::new(*x, *y, z))));
        let (points, triangles) = try_convex_hull(&corners.collect::<Vec<_>>()).unwrap();
        let mut link = Link::new("floor", None, Rigid::IDENTITY);
        let shown = points.iter().map(|p| DVec3::from_array(p.to_array().map(f64::from))).collect();
        link.visuals = vec![Shape { points: shown, triangles: triangles.clone() }];
        let floor = ConvexPolyhedron::from_convex_mesh(points, &triangles).unwrap();
        let scene = Scene { hulls: vec![vec![SharedShape::new(floor)]] };
        let poses = [Rigid::IDENTITY];
        let places = places::of(&link, &poses[0], None);
        let starts = |z: f64| places[0].points.iter().map(|p| (0, *p + DVec3::Z * z)).collect::<Vec<_>>();
        let mut out = DropFinding::default();
        drop(&scene, &poses, &places, &starts(0.09), &CheckOptions::default(), &mut out);
        assert!(out.dropped >= 6 && out.fell + out.sank == 0 && out.lost_at.is_empty(), "{out:?}");
        let mut out = DropFinding::default();
        drop(&scene, &poses, &places, &starts(-0.04), &CheckOptions::default(), &mut out);
        assert!(out.fell == out.dropped && out.lost_at.len() == out.fell, "{out:?}");
    }

    #[test]
    fn what_has_rolled_over_the_border_may_roll_below_the_place() {
        let mut link = Link::new("shelf", None, Rigid::IDENTITY);
        let corner = |x: f64, y: f64| DVec3::new(x, y, 0.5);
        let points = vec![corner(0.0, 0.0), corner(0.4, 0.0), corner(0.4, 0.3), corner(0.0, 0.3)];
        link.visuals = vec![Shape { points, triangles: vec![[0, 1, 2], [0, 2, 3]] }];
        let places = places::of(&link, &Rigid::IDENTITY, None);
        let fallen = |way: &[[f64; 3]]| {
            let (body, start) = (RigidBodyHandle::invalid(), DVec3::ZERO);
            let mut thing = Thing { place: 0, body, start, deepest: 0.0, has_left: false };
            way.iter().for_each(|at| thing.follow(DVec3::from_array(*at), &places[0]));
            thing.deepest
        };
        let over_the_border = [[0.2, 0.15, 0.52], [0.2, -0.1, 0.4], [0.2, 0.1, 0.2]];
        assert!(fallen(&over_the_border).abs() < 1e-9);
        let through = [[0.2, 0.15, 0.52], [0.2, 0.15, 0.4], [0.2, -0.1, 0.2]];
        assert!((fallen(&through) - 0.12).abs() < 1e-9);
    }
}
