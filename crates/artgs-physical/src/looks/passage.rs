//! Surfaces that contradict the motion of a part: its carrier has no material where the part passes.
//!
//! A part's surface is fused from what images of it show, so its solid is known where both of its sides were seen. A surface of the
//! carrier that is inside this solid at any joint value between the observed states cannot exist: it is a remainder of the part, or
//! was invented to close the carrier's mesh. A surface of the carrier that is in or on the part in both states was not seen
//! either, such as the edge of a door that hardly moves beside its hinge. A surface of the part that passes through an observed
//! surface of the carrier belongs to something behind it.

use crate::geometry::convert::{from_parry, to_parry};
use crate::geometry::topology::{bounds, corners, cross, points};
use crate::looks::fused::Fused;
use crate::looks::sights::Sights;
use crate::settings::PassageSettings;
use artgs_core::{Joint, JointKind, Mesh, Rigid, State};
use glam::DVec3;
use parry3d::query::{PointQueryWithLocation as _, Ray, RayCast as _, RayCullingMode};
use parry3d::shape::TriMesh;
use rayon::prelude::*;
use std::sync::Arc;

/// The volume that a part sweeps on its way from start to end, world frame at the start state.
pub(crate) struct Passage {
    /// A box inside that of the part.
    inner: [DVec3; 2],
    outer: [DVec3; 2],
    /// A box around the part at all positions.
    around: [DVec3; 2],
    back: Vec<Rigid>,
    /// Way from the first of these poses to the last one, for a part that slides.
    way: Option<DVec3>,
    joint: Joint,
    /// Change of the joint value from one pose to the next.
    step: f64,
    surface: Option<Arc<TriMesh>>,
    voxel: f64,
    settings: PassageSettings,
}

impl Passage {
    /// None if the part has no surface. `voxel`: resolution of its fused mesh, scene units.
    pub(crate) fn of(fused: &Fused, joint: &Joint, voxel: f64, settings: &PassageSettings) -> Option<Self> {
        let mesh = fused.mesh();
        let [low, high] = bounds(mesh)?;
        let shrink = settings.shrink * (high - low);
        let travel = joint.state_values[State::END] - joint.state_values[State::START];
        let arm = match joint.kind {
            JointKind::Prismatic => 1.0,
            _ => points(mesh).map(|p| (p - joint.origin).reject_from(joint.axis).length()).fold(0.0, f64::max),
        };
        let stops = (travel.abs() * arm / voxel).clamp(settings.stops[0], settings.stops[1]).ceil();
        let ways: Vec<Rigid> = (0..=stops as usize).map(|i| joint.motion(travel * i as f64 / stops)).collect();
        let corner = |i: usize| DVec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low);
        let corners = ways.iter().flat_map(|way| (0..8).map(move |i| way.apply(corner(i))));
        let around = corners.fold([low, high], |[low, high], p| [low.min(p), high.max(p)]);
        let back = ways.iter().map(Rigid::inverse).collect();
        let inner = [low + shrink, high - shrink];
        Some(Self {
            inner,
            outer: [low, high],
            around,
            back,
            surface: fused.shape().cloned(),
            voxel,
            way: (joint.kind == JointKind::Prismatic).then(|| joint.motion(travel).inverse().translation),
            joint: *joint,
            step: travel.abs() / stops,
            settings: *settings,
        })
    }

    /// True where nothing may be invented: in the box that the part sweeps, or in its solid.
    pub(crate) fn holds(&self, point: DVec3) -> bool {
        self.sweeps(point) || self.contradicts(point, self.settings.noise * self.voxel)
    }

    /// The poses back to the start state at which a point can be in this box of the part, and the point there: none at which it is
    /// farther from the box than a voxel.
    fn reached(&self, point: DVec3, [low, high]: [DVec3; 2]) -> impl Iterator<Item = (&Rigid, DVec3)> {
        /// Least approach from pose to pose, in voxels, that guards a division.
        const TINY: f64 = 1e-3;
        let stops = self.candidates(point, [low, high]);
        let farthest = match self.joint.kind {
            JointKind::Prismatic => self.step,
            _ => {
                let arm = (point - self.joint.origin).reject_from(self.joint.axis).length();
                self.step * arm.hypot(self.joint.pitch)
            }
        };
        let mut next = 0;
        std::iter::from_fn(move || {
            while let Some(back) = stops.get(next) {
                let p = back.apply(point);
                let outside = (low - p).max(p - high).max_element() - self.voxel;
                next += 1;
                if outside <= 0.0 {
                    return Some((back, p));
                }
                // The point comes nearer by at most `farthest` from each pose to the next.
                next += (outside / farthest.max(TINY * self.voxel)) as usize;
            }
            None
        })
    }

    /// The poses of a slide at which a point is between the planes of the box; all poses of other parts.
    fn candidates(&self, point: DVec3, [low, high]: [DVec3; 2]) -> &[Rigid] {
        if point.cmplt(self.around[0]).any() || point.cmpgt(self.around[1]).any() {
            return &[];
        }
        let Some(way) = self.way else { return &self.back };
        let stops = (self.back.len() - 1) as f64;
        let (mut first, mut last) = (0.0_f64, stops);
        for axis in 0..3 {
            let (at, speed) = (point[axis], way[axis] / stops);
            if speed == 0.0 {
                if at < low[axis] || at > high[axis] {
                    return &[];
                }
                continue;
            }
            let (one, other) = ((low[axis] - at) / speed, (high[axis] - at) / speed);
            first = first.max(one.min(other));
            last = last.min(one.max(other));
        }
        // One position more at each end, because of rounding.
        if first > last + 2.0 {
            return &[];
        }
        let first = (first.floor() - 1.0).max(0.0) as usize;
        let end = ((last.ceil() + 2.0).max(0.0) as usize).min(self.back.len());
        self.back.get(first..end).unwrap_or_default()
    }

    /// True in the box that the part sweeps.
    fn sweeps(&self, point: DVec3) -> bool {
        let [low, high] = self.inner;
        self.reached(point, self.inner).any(|(_, p)| p.cmpgt(low).all() && p.cmplt(high).all())
    }

    /// True for points that are, at some position of the part, more than `depth` inside its solid as it was seen from both sides.
    fn contradicts(&self, point: DVec3, depth: f64) -> bool {
        self.reached(point, self.outer).any(|(_, p)| self.encloses(p, depth))
    }

    /// True for points of a surface with this unit normal that are inside the part or on its surface in both observed states.
    fn explains(&self, point: DVec3, normal: DVec3) -> bool {
        let (noise, same) = (self.settings.noise * self.voxel, self.settings.same);
        let is_part = |back: &Rigid| {
            let p = back.apply(point);
            let Some((way, own)) = self.nearest(p, self.voxel) else { return false };
            let alike = own.dot(back.turn(normal)) > same && way.dot(own) < noise;
            alike || self.encloses(p, noise)
        };
        match &self.back[..] {
            [first, .., last] => is_part(first) && is_part(last),
            _ => false,
        }
    }

    /// True for points of a surface with this unit normal that are, at some position of the part, on a side of it that faces the same
    /// way: what is behind one of the two surfaces would be in the place of the other.
    fn covers(&self, point: DVec3, normal: DVec3) -> bool {
        let PassageSettings { covered: near, alike, rim, .. } = self.settings;
        self.reached(point, self.outer).any(|(back, p)| {
            let Some((way, own)) = self.nearest(p, near[1] * self.voxel) else { return false };
            let height = way.dot(own);
            height < near[0] * self.voxel
                && (way - own * height).length() < rim * self.voxel
                && own.dot(back.turn(normal)) > alike
        })
    }

    /// True for points that are in the part or near its surface in a state.
    fn is_at(&self, point: DVec3, state: State) -> bool {
        let back = if state == State::START { self.back.first() } else { self.back.last() };
        back.map(|back| back.apply(point))
            .is_some_and(|p| self.nearest(p, self.settings.beside * self.voxel).is_some() || self.encloses(p, 0.0))
    }

    /// The way from the nearest point of the surface, within `reach`, to a point, and the unit normal there.
    fn nearest(&self, p: DVec3, reach: f64) -> Option<(DVec3, DVec3)> {
        let ([low, high], surface) = (self.outer, self.surface.as_ref()?);
        if p.cmplt(low - reach).any() || p.cmpgt(high + reach).any() {
            return None;
        }
        let (near, (triangle, _)) =
            surface.project_local_point_and_get_location_with_max_dist(to_parry(p), false, reach as f32)?;
        let normal = surface.triangle(triangle).normal().map(from_parry)?;
        Some((p - from_parry(near.point), normal))
    }

    /// True for points more than `depth` inside the solid of the part at the start state.
    fn encloses(&self, p: DVec3, depth: f64) -> bool {
        let PassageSettings { farthest, straight, .. } = self.settings;
        let [low, high] = self.outer;
        if p.cmple(low).any() || p.cmpge(high).any() {
            return false;
        }
        let (Some(surface), Some((way, normal))) = (&self.surface, self.nearest(p, farthest * self.voxel)) else {
            return false;
        };
        let distance = way.length();
        if distance <= depth || way.dot(normal) > -straight * distance {
            return false;
        }
        // Behind one side; the next surface on the way has to be the back of the other side.
        let ray = Ray::new(to_parry(p), to_parry(way / distance));
        let most = low.distance(high) as f32;
        let first = surface.cast_local_ray(&ray, most, false);
        let exit = surface.cast_local_ray_with_culling(&ray, most, RayCullingMode::IgnoreFrontfaces);
        match (first, exit) {
            (Some(first), Some(exit)) => exit.time_of_impact <= first && f64::from(first) > depth,
            _ => false,
        }
    }
}

/// A carrier's fused mesh without the triangles that contradict the motion of what it carries. What `sights` show in a state in which no part is
/// there stays: the motion may be wrong.
pub(crate) fn carved(fused: &Fused, passages: &[Passage], sights: &Sights<'_>) -> Fused {
    let mesh = fused.mesh();
    let Some(PassageSettings { rings, shown, .. }) = passages.first().map(|passage| passage.settings) else {
        return fused.clone();
    };
    let is_shown = |p: DVec3, normal: DVec3| {
        let is_free = |state: State| passages.iter().all(|passage| !passage.is_at(p, state));
        State::ALL.into_iter().any(|s| is_free(s) && sights.show(s, p, normal, shown))
    };
    let is_wrong = |t: &[u32; 3]| {
        let (p, normal) = (middle(mesh, *t), cross(mesh, *t).normalize_or_zero());
        let contradicts = passages.iter().any(|passage| {
            passage.contradicts(p, passage.settings.inside * passage.voxel)
                || passage.explains(p, normal)
                || passage.covers(p, normal)
        });
        contradicts && !is_shown(p, normal)
    };
    let mut wrong: Vec<bool> = mesh.triangles.par_iter().map(is_wrong).collect();
    // The box of a part that slides holds nothing of its carrier; what turns is not its box.
    let slides: Vec<&Passage> = passages.iter().filter(|passage| passage.way.is_some()).collect();
    let is_inside = |t: &[u32; 3]| {
        let (p, normal) = (middle(mesh, *t), cross(mesh, *t).normalize_or_zero());
        slides.iter().any(|passage| passage.sweeps(p)) && !is_shown(p, normal)
    };
    let inside: Vec<bool> = mesh.triangles.par_iter().map(is_inside).collect();
    for _ in 0..rings {
        let mut of_vertex = vec![false; mesh.vertices.len()];
        let removed = mesh.triangles.iter().zip(&wrong).filter(|(_, wrong)| **wrong);
        removed.flat_map(|(t, _)| t).for_each(|v| of_vertex[*v as usize] = true);
        for ((t, wrong), inside) in mesh.triangles.iter().zip(&mut wrong).zip(&inside) {
            *wrong |= *inside && t.iter().any(|v| of_vertex[*v as usize]);
        }
    }
    fused.kept(&wrong.iter().map(|wrong| !wrong).collect::<Vec<bool>>())
}

fn middle(mesh: &Mesh, t: [u32; 3]) -> DVec3 {
    corners(mesh, t).iter().sum::<DVec3>() / 3.0
}

/// A part's fused mesh without the triangles that pass through the surface of its carrier, which is `carrier`.
pub(crate) fn freed(fused: &Fused, joint: &Joint, carrier: &Fused, voxel: f64, settings: &PassageSettings) -> Fused {
    let (Some(passage), Some(surface)) = (Passage::of(fused, joint, voxel, settings), carrier.shape()) else {
        return fused.clone();
    };
    let stride = passage.back.len().div_ceil(settings.chords);
    let ways: Vec<Rigid> = passage.back.iter().step_by(stride).chain(passage.back.last()).map(Rigid::inverse).collect();
    let mesh = fused.mesh();
    let stays = |t: &[u32; 3]| !pierces(middle(mesh, *t), &ways, surface, (voxel, settings));
    fused.kept(&mesh.triangles.par_iter().map(stays).collect::<Vec<bool>>())
}

/// True if a point that takes these poses passes straight through a surface, with more than noise on both sides.
fn pierces(p: DVec3, ways: &[Rigid], surface: &TriMesh, (voxel, settings): (f64, &PassageSettings)) -> bool {
    let (first, last) = match ways {
        [first, .., last] => (first.apply(p), last.apply(p)),
        _ => return false,
    };
    ways.windows(2).any(|pair| {
        let [from, to] = [pair[0].apply(p), pair[1].apply(p)];
        let (way, length) = (to - from, from.distance(to));
        if length <= 0.0 {
            return false;
        }
        let ray = Ray::new(to_parry(from), to_parry(way / length));
        let Some(hit) = surface.cast_local_ray_and_get_normal(&ray, length as f32, false) else { return false };
        let (at, normal) = (from + way * (f64::from(hit.time_of_impact) / length), from_parry(hit.normal));
        let far = |end: DVec3| (end - at).dot(normal).abs() > settings.clear * voxel;
        normal.dot(way).abs() > settings.pierced * length && far(first) && far(last)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::topology::refine;
    use crate::looks::bake::{BakeOptions, BakeView, Photo, depth_of};
    use crate::settings::BakeSettings;
    use artgs_core::{Camera, Intrinsics, PerState};

    /// These views of the start, none of the end.
    fn seen_by(views: Vec<BakeView<'_>>) -> Sights<'_> {
        let options = BakeOptions::at_resolution(0.005, &BakeSettings::DEFAULT);
        Sights { views: PerState::new(views, Vec::new()), options }
    }

    /// A door of 60 x 4 x 90 cm with its hinge at the left edge, that opens by 90 degrees.
    fn door() -> (Mesh, Joint) {
        let mesh = Mesh::cuboid([0.0, -0.04, 0.0], [0.6, 0.0, 0.9]);
        let joint = Joint {
            kind: JointKind::Revolute,
            axis: DVec3::Z,
            origin: DVec3::ZERO,
            pitch: 0.0,
            state_values: PerState::new(0.0, -std::f64::consts::FRAC_PI_2),
            limits: [-std::f64::consts::FRAC_PI_2, 0.0],
        };
        (mesh, joint)
    }

    #[test]
    fn a_remainder_of_a_door_is_removed_and_the_wall_beside_it_stays() {
        let (door, joint) = door();
        let passage = Passage::of(&door.clone().into(), &joint, 0.005, &PassageSettings::DEFAULT).unwrap();
        // A body in the middle of the door beside its hinge, one where the open door is, and a wall behind the closed door.
        let remainder = Mesh::cuboid([0.02, -0.025, 0.3], [0.04, -0.015, 0.6]);
        let open = Mesh::cuboid([-0.025, -0.4, 0.3], [-0.015, -0.3, 0.6]);
        let wall = Mesh::cuboid([0.0, 0.001, 0.0], [0.6, 0.02, 0.9]);
        let mut base = wall.clone();
        base.append(&remainder);
        base.append(&open);
        let left = carved(&base.clone().into(), &[passage], &seen_by(Vec::new())).mesh().clone();
        assert_eq!(left.triangles, wall.triangles);
        assert_eq!(
            carved(&base.clone().into(), &[], &seen_by(Vec::new())).mesh().triangles.len(),
            base.triangles.len()
        );
    }

    #[test]
    fn what_a_state_shows_where_no_part_is_stays() {
        let (door, joint) = door();
        let passage = || Passage::of(&door.clone().into(), &joint, 0.005, &PassageSettings::DEFAULT).unwrap();
        // A body in the way of the door, and a copy of the door's front where the door is.
        let body = Mesh::cuboid([0.25, -0.30, 0.3], [0.27, -0.28, 0.6]);
        let copy = Mesh::cuboid([0.3, -0.0401, 0.1], [0.5, -0.01, 0.2]);
        let mut base = body.clone();
        base.append(&copy);
        assert!(carved(&base.clone().into(), &[passage()], &seen_by(Vec::new())).mesh().is_empty());
        let k = Intrinsics { fx: 400.0, fy: 400.0, cx: 150.0, cy: 150.0, width: 300, height: 300 };
        let at = DVec3::new(0.26, 0.0, 0.45);
        let camera = Camera::look_at(k, at - 2.0 * DVec3::Y, at, DVec3::Z);
        let (depth, rgba) = (depth_of(&camera, &[&door, &base]), vec![[9, 9, 9, 255]; 300 * 300]);
        let photo = Photo::new(&rgba, &depth, k, (0.04, &BakeSettings::DEFAULT)).unwrap();
        let left = |count: usize| {
            let sights = seen_by((0..count).map(|_| BakeView::new(&photo, camera)).collect());
            carved(&base.clone().into(), &[passage()], &sights).mesh().triangles.clone()
        };
        let front = |t: &&[u32; 3]| cross(&body, **t).normalize().y < -0.99;
        let front: Vec<[u32; 3]> = body.triangles.iter().filter(front).copied().collect();
        assert_eq!(front.len(), 2);
        assert_eq!(left(2), front, "the side that the cameras see");
        assert!(left(1).is_empty(), "one view may be wrong");
    }

    #[test]
    fn a_point_is_tested_at_all_positions_that_can_hold_it() {
        let (mesh, turning) = door();
        let axis = DVec3::new(0.2, -1.0, 0.1).normalize();
        let sliding = Joint { kind: JointKind::Prismatic, axis, state_values: PerState::new(-0.1, 0.35), ..turning };
        for joint in [turning, sliding] {
            let passage = Passage::of(&mesh.clone().into(), &joint, 0.005, &PassageSettings::DEFAULT).unwrap();
            let holds = |back: &Rigid, p: DVec3| {
                let [low, high] = passage.outer;
                back.apply(p).cmpgt(low).all() && back.apply(p).cmplt(high).all()
            };
            let mut held = 0;
            for i in 0..4000 {
                let spread = |k: f64| (k * f64::from(i)).fract();
                let p = DVec3::new(spread(0.754_877_6), spread(0.569_840_2), spread(0.438_289_1)) * 1.6 - 0.6;
                let all = passage.back.iter().filter(|back| holds(back, p)).count();
                let reached = passage.reached(p, passage.outer).filter(|(back, _)| holds(back, p)).count();
                assert_eq!(all, reached, "{p}");
                held += usize::from(all > 0);
            }
            assert!(held > 100, "{held}");
        }
    }

    #[test]
    fn a_part_seen_from_one_side_contradicts_nothing() {
        let (mut door, joint) = door();
        // Without its back, the door could be a thin sheet.
        let front = |t: &[u32; 3]| t.iter().all(|v| door.vertices[*v as usize][1] < -0.03);
        door.triangles = door.triangles.iter().filter(|t| front(t)).copied().collect();
        assert!(!door.triangles.is_empty());
        let passage = Passage::of(&door.clone().into(), &joint, 0.005, &PassageSettings::DEFAULT).unwrap();
        let behind = Mesh::cuboid([0.2, -0.025, 0.3], [0.4, -0.015, 0.6]);
        assert_eq!(
            carved(&behind.clone().into(), &[passage], &seen_by(Vec::new())).mesh().triangles.len(),
            behind.triangles.len()
        );
    }

    #[test]
    fn what_is_on_the_part_in_both_states_is_not_of_its_carrier() {
        // A drawer's side wall that slides within its plane, and a wall of the cabinet 4 mm beside it.
        let wall = Mesh::cuboid([0.0, 0.0, 0.0], [0.015, 0.5, 0.2]);
        let joint = Joint {
            kind: JointKind::Prismatic,
            axis: DVec3::NEG_Y,
            origin: DVec3::ZERO,
            pitch: 0.0,
            state_values: PerState::new(0.0, 0.2),
            limits: [0.0, 0.2],
        };
        let passage = Passage::of(&wall.clone().into(), &joint, 0.01, &PassageSettings::DEFAULT).unwrap();
        let copy = Mesh::cuboid([0.001, 0.02, 0.02], [0.014, 0.28, 0.18]);
        let cabinet = Mesh::cuboid([0.019, -0.1, 0.0], [0.05, 0.6, 0.2]);
        let mut base = cabinet.clone();
        base.append(&copy);
        let left = carved(&base.clone().into(), &[passage], &seen_by(Vec::new())).mesh().triangles.clone();
        assert!(cabinet.triangles.iter().all(|t| left.contains(t)));
        // Both large sides of the copy.
        let mut large = copy.clone();
        large.triangles.retain(|t| cross(&copy, *t).normalize_or_zero().x.abs() > 0.9);
        assert!(left.len() <= base.triangles.len() - large.triangles.len(), "{}", left.len());
    }

    #[test]
    fn a_copy_of_a_drawer_floor_is_not_of_the_carrier_and_what_is_flush_with_a_door_stays() {
        // A floor of 12 mm that slides within its plane, with a wall, and a sheet on it that the open drawer only covers in part.
        let mut floor = Mesh::cuboid([0.0, 0.0, 0.0], [0.4, 0.5, 0.012]);
        floor.append(&Mesh::cuboid([0.0, 0.0, 0.012], [0.015, 0.5, 0.1]));
        let joint = Joint {
            kind: JointKind::Prismatic,
            axis: DVec3::NEG_Y,
            origin: DVec3::ZERO,
            pitch: 0.0,
            state_values: PerState::new(0.0, 0.3),
            limits: [0.0, 0.3],
        };
        let passage = Passage::of(&floor.clone().into(), &joint, 0.01, &PassageSettings::DEFAULT).unwrap();
        let mut sheet = Mesh::cuboid([0.02, 0.1, -0.05], [0.38, 0.48, 0.013]);
        refine(&mut sheet, 0.05);
        let upper = |mesh: &Mesh| mesh.triangles.iter().filter(|t| cross(mesh, **t).normalize().z > 0.9).count();
        assert!(upper(&sheet) > 20);
        assert_eq!(upper(carved(&sheet.clone().into(), &[passage], &seen_by(Vec::new())).mesh()), 0);
        // The front of a frame, flush with that of a door beside it; a wall whose front is behind that of the door, by its thickness.
        let (door, joint) = door();
        let passage = [Passage::of(&door.clone().into(), &joint, 0.01, &PassageSettings::DEFAULT).unwrap()];
        let mut frame = Mesh::cuboid([0.602, -0.04, 0.0], [0.8, 0.1, 0.9]);
        frame.append(&Mesh::cuboid([0.0, 0.002, 0.0], [0.6, 0.1, 0.9]));
        assert_eq!(carved(&frame.clone().into(), &passage, &seen_by(Vec::new())).mesh().triangles, frame.triangles);
    }

    #[test]
    fn what_passes_through_the_front_of_the_carrier_is_not_of_the_door() {
        let (door, joint) = door();
        // The carrier's front, which the closed door overlaps, and a wall of the compartment behind it that is labelled as the door.
        let front = Mesh::cuboid([0.5, 0.005, 0.0], [1.0, 0.015, 0.9]);
        let mut part = door.clone();
        part.append(&Mesh::cuboid([0.5, 0.1, 0.2], [0.55, 0.3, 0.7]));
        assert_eq!(
            freed(&part.clone().into(), &joint, &front.clone().into(), 0.005, &PassageSettings::DEFAULT)
                .mesh()
                .triangles,
            door.triangles
        );
        // A front beside the door stops nothing.
        let beside = Mesh::cuboid([0.605, -0.04, 0.0], [1.0, 0.0, 0.9]);
        assert_eq!(
            freed(&door.clone().into(), &joint, &beside.clone().into(), 0.005, &PassageSettings::DEFAULT)
                .mesh()
                .triangles,
            door.triangles
        );
    }

    #[test]
    fn a_sheet_inside_a_drawer_goes_with_the_part_of_it_that_the_walls_sweep() {
        // Two walls of a drawer, and a sheet that reaches from a cabinet's side through one of them into the drawer.
        let mut drawer = Mesh::cuboid([0.0, 0.0, 0.0], [0.04, 0.5, 0.3]);
        drawer.append(&Mesh::cuboid([0.46, 0.0, 0.0], [0.5, 0.5, 0.3]));
        let joint = |kind| Joint {
            kind,
            axis: DVec3::NEG_Y,
            origin: DVec3::ZERO,
            pitch: 0.0,
            state_values: PerState::new(0.0, 0.2),
            limits: [0.0, 0.2],
        };
        let mut sheet = Mesh::cuboid([-0.1, 0.2, 0.05], [0.08, 0.21, 0.25]);
        refine(&mut sheet, 0.012);
        let inside = |mesh: &Mesh, low: f64, high: f64| {
            let x = |t: &[u32; 3]| middle(mesh, *t).x;
            mesh.triangles.iter().filter(|t| (low..high).contains(&x(t))).count()
        };
        assert!(inside(&sheet, 0.045, 0.08) > 50);
        let passage =
            Passage::of(&drawer.clone().into(), &joint(JointKind::Prismatic), 0.01, &PassageSettings::DEFAULT).unwrap();
        let left = carved(&sheet.clone().into(), &[passage], &seen_by(Vec::new())).mesh().clone();
        assert!(inside(&left, 0.045, 0.07) == 0, "{}", inside(&left, 0.045, 0.07));
        assert_eq!(inside(&left, -0.2, -0.01), inside(&sheet, -0.2, -0.01));
    }
}
