//! First contact of a moving link with the others: visual meshes are swept along the motion of its joint.
//!
//! Sampled points of each surface are moved against the triangles of the other one, both ways round. A point is stopped where it
//! enters the other surface from outside, if both normals oppose the motion: points that slide along a surface, or leave
//! one that measurement let them overlap with, are not. A contact is where stopped points stand for a meaningful area, so that
//! noise stops nothing. The area must also be wide: rims overlap by a voxel where parts pass each other. Frames that stop a part can be
//! narrow, so the caller decides how wide contacts with the carrier are.

use crate::geometry::Observed;
use crate::geometry::convert::trimesh;
use crate::geometry::convert::{from_parry, to_parry};
use crate::geometry::solid::{Sample, Solid};
use crate::geometry::topology::{corners, refine};
use crate::settings::SweepSettings;
use artgs_core::{Asset, JointKind, Mesh, Rigid};
use glam::{DVec2, DVec3};
use parry3d::query::{PointQueryWithLocation as _, Ray, RayCullingMode};
use parry3d::shape::TriMesh;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Surface of a link, link frame.
pub(crate) struct Surface {
    samples: Vec<Sample>,
    all: Option<TriMesh>,
    seen: Option<TriMesh>,
}

impl Surface {
    /// Surface of a solid with points about `spacing` apart; nothing without one.
    pub(crate) fn of(solid: Option<&Solid>, observed: &Observed, spacing: f64, settings: &SweepSettings) -> Self {
        let Some(solid) = solid else {
            return Self { samples: Vec::new(), all: None, seen: None };
        };
        // A triangle of a flat face is larger than what was observed of it.
        let mut seen = Mesh { colors: Vec::new(), ..solid.mesh.clone() };
        refine(&mut seen, settings.edge * spacing);
        let middle = |t: &[u32; 3]| corners(&seen, *t).iter().sum::<DVec3>() / 3.0;
        let triangles = seen.triangles.par_iter().filter(|t| observed(middle(t))).copied().collect();
        let seen = Mesh { triangles, ..seen };
        let samples = solid.samples(spacing, false);
        let samples = samples.into_iter().map(|s| Sample { seen: observed(s.point), ..s }).collect();
        Self { samples, all: trimesh(&solid.mesh), seen: trimesh(&seen) }
    }

    fn triangles(&self, part: Part) -> Option<&TriMesh> {
        if part == Part::Seen { self.seen.as_ref() } else { self.all.as_ref() }
    }

    fn points(&self, part: Part) -> impl Iterator<Item = &Sample> {
        self.samples.iter().filter(move |s| part == Part::All || s.seen)
    }

    /// Observed points whose normals are within an angle of the given cosine of a direction.
    pub(crate) fn facing(&self, direction: DVec3, cosine: f64) -> impl Iterator<Item = DVec3> {
        self.points(Part::Seen).filter(move |s| s.normal.dot(direction) > cosine).map(|s| s.point)
    }

    /// Unit normals at the points that were observed, which are spread evenly.
    pub(crate) fn normals(&self) -> impl Iterator<Item = DVec3> {
        self.points(Part::Seen).map(|s| s.normal)
    }

    /// Points that were observed; all if none was.
    pub(crate) fn visible(&self) -> impl Iterator<Item = DVec3> + Clone {
        let any = self.samples.iter().any(|s| s.seen);
        self.samples.iter().filter(move |s| s.seen || !any).map(|s| s.point)
    }
}

/// Which part of a surface counts: what only closes a mesh can be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// What was observed.
    Seen,
    /// Also what closes the mesh.
    All,
}

/// How a link is swept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sweep {
    /// Moving link.
    pub link: usize,
    /// Joint value at which the way begins.
    pub from: f64,
    /// Signed length of the way, in units of the joint.
    pub way: f64,
    /// Surface of the moving links that counts.
    pub own: Part,
    /// Surface of the other links that counts.
    pub others: Part,
}

/// Precision of sweeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Precision {
    /// Points that stopped before there is a contact.
    pub points: usize,
    /// Width, metres, of the area around each of them in both directions across the motion, if the other link is not the carrier.
    pub width: f64,
    /// The same where the other link is the carrier.
    pub carrier_width: f64,
    /// Overlap at the beginning of the way, metres, that counts as a contact there.
    pub overlap: f64,
    /// What a contact is.
    pub settings: SweepSettings,
}

/// A contact on a way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Contact {
    /// Length of the free way before it, in units of the joint, at least 0.
    pub way: f64,
    /// The other link.
    pub link: usize,
}

/// Links that move with a joint.
pub(crate) fn carried(asset: &Asset, link: usize) -> Vec<bool> {
    let mut out = vec![false; asset.links.len()];
    out[link] = true;
    for i in link + 1..asset.links.len() {
        out[i] = asset.links[i].parent.is_some_and(|p| out[p]);
    }
    out
}

/// Distance of the farthest point of a link from the axis of its joint for joints that turn, 1 for slides: metres that a point
/// moves per unit of the joint.
pub(crate) fn reach(asset: &Asset, surfaces: &[Surface], link: usize) -> f64 {
    let Some(joint) = asset.links[link].joint.filter(|joint| joint.kind != JointKind::Prismatic) else { return 1.0 };
    let arms = surfaces[link].samples.iter().map(|s| s.point.reject_from_normalized(joint.axis).length());
    arms.fold(0.0, f64::max)
}

/// The first contact of a link, and of what it carries, on a way, while the other joints have the given `values`; none if the way is free.
pub(crate) fn first_contact(
    asset: &Asset,
    surfaces: &[Surface],
    values: &[f64],
    sweep: &Sweep,
    precision: &Precision,
) -> Option<Contact> {
    let settings = &precision.settings;
    let joint = asset.links[sweep.link].joint?;
    let arm = reach(asset, surfaces, sweep.link);
    if sweep.way == 0.0 || arm <= 0.0 {
        return None;
    }
    // The way begins earlier, so that surfaces that overlap already are met.
    let before = (precision.overlap / arm).min(1.0);
    let length = sweep.way.abs() + before;
    let [least, most] = settings.turns;
    let steps = match joint.kind {
        JointKind::Prismatic => settings.slides,
        _ => (length / settings.turn).ceil().clamp(least, most),
    };
    let step = length / steps;
    let poses: Vec<Vec<Rigid>> = (0..=steps as usize)
        .map(|k| {
            let mut values = values.to_vec();
            values[sweep.link] = sweep.from + sweep.way.signum() * (k as f64 * step - before);
            asset.poses(&values)
        })
        .collect();
    let is_carried = carried(asset, sweep.link);
    let mut best: Option<Contact> = None;
    for own in (0..asset.links.len()).filter(|i| is_carried[*i]) {
        for other in (0..asset.links.len()).filter(|i| !is_carried[*i]) {
            // Behind the first contact, others do not matter.
            let needed = best.map_or(f64::INFINITY, |best| ((best.way + before) / step).ceil() + 2.0);
            let poses = poses.iter().take(needed as usize);
            let other_from_own: Vec<Rigid> = poses.map(|at| at[other].inverse() * at[own]).collect();
            let pair = [(&surfaces[own], sweep.own), (&surfaces[other], sweep.others)];
            let is_carrier = asset.links[sweep.link].parent == Some(other);
            let width = if is_carrier { precision.carrier_width } else { precision.width };
            let met = first_of_pair(pair, &other_from_own, (precision.points, width), settings);
            let Some(met) = met.map(|steps| (steps * step - before).max(0.0)) else { continue };
            if best.is_none_or(|best| met < best.way) {
                best = Some(Contact { way: met, link: other });
            }
        }
    }
    best
}

/// Where a slide, and what it carries, begins to cross other links on a way: more of their observed surfaces are deeper inside each
/// other than errors of measurement explain. A part that moves along a wall meets nothing that faces it, however far it is inside.
/// None if it crosses no other link than where the way begins.
pub(crate) fn first_crossing(
    asset: &Asset,
    surfaces: &[Surface],
    values: &[f64],
    sweep: &Sweep,
    precision: &Precision,
) -> Option<Contact> {
    let steps = precision.settings.crossings;
    let is_carried = carried(asset, sweep.link);
    let poses = |k: usize| {
        let mut values = values.to_vec();
        values[sweep.link] = sweep.from + sweep.way * k as f64 / steps as f64;
        asset.poses(&values)
    };
    let pairs = || (0..asset.links.len()).flat_map(|a| (0..asset.links.len()).map(move |b| (a, b)));
    let pairs: Vec<(usize, usize)> = pairs().filter(|(a, b)| is_carried[*a] && !is_carried[*b]).collect();
    let inside = |(a, b): (usize, usize), poses: &[Rigid]| {
        let b_from_a = poses[b].inverse() * poses[a];
        let [own, other] = [&surfaces[a], &surfaces[b]];
        deep(own.points(sweep.own), other.triangles(sweep.others), &b_from_a, precision)
            + deep(other.points(sweep.others), own.triangles(sweep.own), &b_from_a.inverse(), precision)
    };
    let before: Vec<usize> = pairs.iter().map(|pair| inside(*pair, &poses(0))).collect();
    (1..=steps).find_map(|k| {
        let now = poses(k);
        let crossed =
            pairs.iter().zip(&before).find(|(pair, before)| inside(**pair, &now) > **before + precision.points);
        let way = sweep.way.abs() * (k - 1) as f64 / steps as f64;
        crossed.map(|((_, link), _)| Contact { way, link: *link })
    })
}

/// Number of points that are behind a surface by more than the overlap that is an error, and near it.
fn deep<'a>(
    points: impl Iterator<Item = &'a Sample>,
    shape: Option<&TriMesh>,
    pose: &Rigid,
    precision: &Precision,
) -> usize {
    let Some(shape) = shape else { return 0 };
    let (depth, SweepSettings { deepest, straight, .. }) = (precision.overlap, precision.settings);
    let is_deep = |sample: &&&Sample| {
        let p = to_parry(pose.apply(sample.point));
        let found = shape.project_local_point_and_get_location_with_max_dist(p, false, (deepest * depth) as f32);
        let Some((near, (triangle, _))) = found else { return false };
        let Some(normal) = shape.triangle(triangle).normal() else { return false };
        let way = from_parry(p - near.point);
        let behind = -way.dot(from_parry(normal));
        behind > depth && behind > straight * way.length()
    };
    let points: Vec<&Sample> = points.collect();
    points.par_iter().filter(|sample| is_deep(sample)).count()
}

/// The number of steps after which the surfaces of two links are in contact; `other_from_own`: poses of the first in the frame of
/// the second, before and after each step.
fn first_of_pair(
    pair: [(&Surface, Part); 2],
    other_from_own: &[Rigid],
    (points, width): (usize, f64),
    settings: &SweepSettings,
) -> Option<f64> {
    let [(own, own_part), (other, other_part)] = pair;
    let own_from_other: Vec<Rigid> = other_from_own.iter().map(Rigid::inverse).collect();
    // Of a large part, more is needed than of a small one.
    let leading = own.points(own_part).filter(|sample| presses(sample, other_from_own, settings.pressing)).count();
    let points = points.max((settings.leading * leading as f64) as usize);
    let stops = [
        entered(own.points(own_part), other.triangles(other_part), other_from_own, settings),
        entered(other.points(other_part), own.triangles(own_part), &own_from_other, settings),
    ];
    let first = stops.into_iter().filter_map(|stops| wide_contact(stops, points.max(1), width, settings));
    first.reduce(f64::min)
}

/// Where a point stopped.
#[derive(Clone, Copy, Debug)]
struct StopPoint {
    /// Steps before it.
    steps: f64,
    /// Place, frame of the surface that stopped it.
    place: DVec3,
    /// Unit direction of the motion there.
    way: DVec3,
}

/// The number of steps after which `points` points have stopped whose neighbourhood, of all that stopped so far, is as wide as `width` in
/// both directions across the motion: a strip of one voxel, by which rims of measured surfaces overlap, is no contact.
fn wide_contact(mut stops: Vec<StopPoint>, points: usize, width: f64, settings: &SweepSettings) -> Option<f64> {
    let reach = settings.reach * width;
    stops.sort_by(|a, b| a.steps.total_cmp(&b.steps));
    if width <= 0.0 {
        return stops.get(points - 1).map(|stop| stop.steps);
    }
    let cell = |p: DVec3| (p / reach).floor().as_i64vec3().to_array();
    let mut cells: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    let mut around: Vec<Spread> = Vec::with_capacity(stops.len());
    let (mut is_wide, mut count) = (vec![false; stops.len()], 0);
    for (i, stop) in stops.iter().enumerate() {
        around.push(Spread::across(stop.way));
        let [x, y, z] = cell(stop.place);
        let mut near = Vec::new();
        for (dx, dy, dz) in (-1..=1).flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| (x, y, z)))) {
            near.extend(cells.get(&[x + dx, y + dy, z + dz]).into_iter().flatten());
        }
        cells.entry([x, y, z]).or_default().push(i);
        near.push(i);
        for j in near {
            let between = stop.place - stops[j].place;
            if between.length_squared() > reach * reach {
                continue;
            }
            around[j].add(between);
            if j != i {
                around[i].add(-between);
            }
            if !is_wide[j] && around[j].width(settings.few) >= width {
                (is_wide[j], count) = (true, count + 1);
            }
        }
        if count >= points {
            return Some(stop.steps);
        }
    }
    None
}

/// Points around a place in the plane across a direction.
struct Spread {
    axes: [DVec3; 2],
    count: f64,
    sum: DVec2,
    /// Sums of squares, and of the product.
    squares: [f64; 3],
}

impl Spread {
    fn across(direction: DVec3) -> Self {
        let (a, b) = direction.any_orthonormal_pair();
        Self { axes: [a, b], count: 0.0, sum: DVec2::ZERO, squares: [0.0; 3] }
    }

    /// Adds a point by its vector from the place.
    fn add(&mut self, v: DVec3) {
        let [x, y] = self.axes.map(|axis| axis.dot(v));
        self.count += 1.0;
        self.sum += DVec2::new(x, y);
        self.squares = [self.squares[0] + x * x, self.squares[1] + y * y, self.squares[2] + x * y];
    }

    /// Width of the points in the direction in which it is least: that of a strip on which they are spread evenly. Fewer points than `few`
    /// have none.
    fn width(&self, few: f64) -> f64 {
        if self.count < few {
            return 0.0;
        }
        let mean = self.sum / self.count;
        let [xx, yy] = [0, 1].map(|k| self.squares[k] / self.count - mean[k] * mean[k]);
        let xy = self.squares[2] / self.count - mean.x * mean.y;
        let least = 0.5 * (xx + yy) - (0.25 * (xx - yy).powi(2) + xy * xy).sqrt();
        (12.0 * least.max(0.0)).sqrt()
    }
}

/// Where points that move from pose to pose enter a surface against which they press. All steps are the same motion of one
/// joint, so that a point moves at the same angle to its normal on each of them.
fn entered<'a>(
    points: impl Iterator<Item = &'a Sample>,
    shape: Option<&TriMesh>,
    poses: &[Rigid],
    settings: &SweepSettings,
) -> Vec<StopPoint> {
    /// Difference of cosines that may be rounding.
    const ROUNDING: f64 = 1e-6;
    /// Rounding of single precision around a surface, as a share of its distance from the origin.
    const MARGIN: f64 = 1e-5;
    let Some(shape) = shape else { return Vec::new() };
    let points: Vec<&Sample> = points.filter(|sample| presses(sample, poses, settings.pressing - ROUNDING)).collect();
    let bounds = shape.local_aabb();
    let margin = DVec3::splat(MARGIN * f64::from(bounds.mins.length().max(bounds.maxs.length())));
    let near = [from_parry(bounds.mins) - margin, from_parry(bounds.maxs) + margin];
    points.par_iter().filter_map(|sample| entry(sample, shape, near, poses, settings)).collect()
}

/// True if a point moves against its surface on the way between the first two poses, at an angle of at least this cosine.
fn presses(sample: &Sample, poses: &[Rigid], cosine: f64) -> bool {
    let way = poses[1].apply(sample.point) - poses[0].apply(sample.point);
    poses[0].turn(sample.normal).dot(way) >= cosine * way.length()
}

/// Where a point enters a surface against which it presses; `near`: a box that holds the surface.
fn entry(
    sample: &Sample,
    shape: &TriMesh,
    near: [DVec3; 2],
    poses: &[Rigid],
    settings: &SweepSettings,
) -> Option<StopPoint> {
    /// Share of a step behind a surface at which the next one is looked for.
    const BEHIND: f64 = 1e-3;
    let SweepSettings { pressing, grazed, .. } = *settings;
    let mut from = poses[0].apply(sample.point);
    for (k, pair) in poses.windows(2).enumerate() {
        let to = pair[1].apply(sample.point);
        let (way, start) = (to - from, from);
        from = to;
        if start.min(to).cmpgt(near[1]).any() || start.max(to).cmplt(near[0]).any() {
            continue;
        }
        let length = way.length();
        if length <= 0.0 || pair[0].turn(sample.normal).dot(way) < pressing * length {
            continue;
        }
        let mut passed = 0.0;
        for _ in 0..grazed {
            let ray = Ray::new(to_parry(start + way * passed), to_parry(way));
            let left = (1.0 - passed) as f32;
            let Some(hit) = shape.cast_local_ray_with_culling(&ray, left, RayCullingMode::IgnoreBackfaces) else {
                break;
            };
            passed += f64::from(hit.time_of_impact);
            if from_parry(hit.normal).dot(way) < -pressing * length {
                let place = start + way * passed;
                return Some(StopPoint { steps: k as f64 + passed, place, way: way / length });
            }
            passed += BEHIND;
            if passed >= 1.0 {
                break;
            }
        }
    }
    None
}

#[cfg(test)]
#[path = "sweep_tests.rs"]
mod tests;
