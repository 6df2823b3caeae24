//! What the views of a state say about surfels of another state that a motion takes to it.

use super::noise::{Noise, misfit};
use super::settings::ExplainSettings;
use crate::discover::Cloud;
use crate::discover::cloud::IndexedCloud;
use crate::discover::visibility::DepthLookup;
use artgs_core::Rigid;
use glam::{DVec2, Vec3};
use rayon::prelude::*;

/// A point of a surface, world frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surfel {
    pub(super) point: Vec3,
    /// Unit normal towards the cameras that saw it.
    pub(super) normal: Vec3,
}

impl Surfel {
    pub(super) fn of(cloud: &Cloud, index: usize) -> Self {
        Self { point: cloud.points[index], normal: cloud.normals[index] }
    }

    pub(super) fn moved(&self, motion: &Rigid) -> Self {
        let point = motion.apply(self.point.as_dvec3()).as_vec3();
        Self { point, normal: motion.turn(self.normal.as_dvec3()).as_vec3() }
    }
}

/// Measured minus predicted depth, scene units, infinite where the view sees nothing, and the cosine of incidence. Of the four pixels
/// around the surfel the one that agrees best counts. None outside of the view and where it measured nothing. Where the surfel is
/// steeper than the least cosine `facing`, its plane does not predict depth beside its centre.
pub(super) fn residual(view: &DepthLookup, surfel: &Surfel, facing: f32) -> Option<(f32, f32)> {
    /// The plane of a surfel predicts the depth of a pixel at most this far from that of its centre, a share of the depth.
    const PLANE: f32 = 0.03;
    let (p, n) = view.seen_from(surfel.point, surfel.normal);
    if p.z <= 1e-6 {
        return None;
    }
    let k = &view.camera.intrinsics;
    let (fx, fy, cx, cy) = (k.fx as f32, k.fy as f32, k.cx as f32 - 0.5, k.cy as f32 - 0.5);
    let (x, y) = (fx * p.x / p.z + cx, fy * p.y / p.z + cy);
    if !(x >= 0.0 && y >= 0.0 && x < (k.width - 1) as f32 && y < (k.height - 1) as f32) {
        return None;
    }
    let (x0, y0) = (x as usize, y as usize);
    let offset = n.dot(p);
    let cosine = -offset / p.length();
    let mut best: Option<f32> = None;
    for (u, v) in [(x0, y0), (x0 + 1, y0), (x0, y0 + 1), (x0 + 1, y0 + 1)] {
        let Some(depth) = view.measured(v * k.width as usize + u) else { continue };
        let mut z = p.z;
        if cosine.abs() > facing {
            let of_plane = offset / n.dot(Vec3::new((u as f32 - cx) / fx, (v as f32 - cy) / fy, 1.0));
            if (of_plane - p.z).abs() < PLANE * p.z {
                z = of_plane;
            }
        }
        let r = depth - z;
        if best.is_none_or(|b| r.abs() < b.abs()) {
            best = Some(r);
        }
    }
    best.map(|r| (r, cosine))
}

/// Places that are looked up for what hides a surfel.
const OCCLUDERS: usize = 4;
/// Surfels that are looked up where a surfel is seen.
const LANDINGS: usize = 4;
/// No surfel there.
pub(super) const NOBODY: u32 = u32::MAX;

/// What all views say about one surfel under one motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Nats of the residuals of hits, in sum.
    pub(super) misfit: f32,
    /// Views that see it where it is predicted,
    pub(super) hit: u16,
    /// that look through its place,
    pub(super) through: u16,
    /// and that see something in front of it.
    pub(super) hidden: u16,
    /// True if it faces away from all views that could see it, and some show a surface in front of it by at most the thickness of a plate.
    pub(super) backed: bool,
    /// Surfels of the other state that hide it, in some of these views, or in some that it faces away from if there are none: those that it
    /// is `backed` in come first; [`NOBODY`] where there are fewer.
    pub(super) occluders: [u32; OCCLUDERS],
    /// Surfels of the other state nearest to its place, where it is seen.
    pub(super) landing: [u32; LANDINGS],
}

impl Seen {
    /// True if what is seen there is of other parts than `part`.
    pub(super) fn lands_on_another(&self, part: u16, labels: &[u16]) -> bool {
        let mut known = self.landing.iter().filter(|o| **o != NOBODY).peekable();
        self.hit > 0 && known.peek().is_some() && known.all(|o| labels[*o as usize] != part)
    }

    /// True if the views see it where it is predicted more than they look through it, or if they see the other face of its part `part`, a
    /// plate, in front of it. `labels` are those of the other state.
    pub(super) fn is_founded(&self, part: u16, labels: &[u16]) -> bool {
        let seen = self.hit > 0 && self.hit >= self.through;
        seen || self.backed && self.is_hidden_by(|o| labels[o] == part)
    }

    /// True if most of the surfels that hide it `are` such.
    pub(super) fn is_hidden_by(&self, are: impl Fn(usize) -> bool) -> bool {
        let known = || self.occluders.iter().filter(|o| **o != NOBODY).map(|o| *o as usize);
        2 * known().filter(|o| are(*o)).count() > known().count()
    }
}

/// Some of the views that were added, spread over all of them.
#[derive(Clone, Copy, Default)]
struct Sample {
    views: [usize; OCCLUDERS],
    /// Number of views that were added.
    count: u16,
}

impl Sample {
    fn add(&mut self, view: usize) {
        if let Some(place) = self.views.get_mut(usize::from(self.count)) {
            *place = view;
        } else if view.is_multiple_of(OCCLUDERS) {
            // Later views replace earlier ones.
            self.views[(view / OCCLUDERS) % OCCLUDERS] = view;
        }
        self.count += 1;
    }

    fn iter(&self) -> impl Iterator<Item = usize> {
        self.views.into_iter().take(self.count.into())
    }
}

/// The views of a state, asked about surfels.
pub(super) struct Look<'a> {
    /// The surfels.
    pub(super) cloud: &'a Cloud,
    /// Surfels of the state whose views are asked.
    pub(super) shown: &'a IndexedCloud<'a>,
    pub(super) views: &'a [DepthLookup],
    /// Of these views.
    pub(super) noise: &'a Noise,
    pub(super) settings: &'a ExplainSettings,
    /// Distance between neighbouring surfels, scene units.
    pub(super) spacing: f32,
    /// Of plates, at most, scene units.
    pub(super) thickness: f32,
}

impl Look<'_> {
    /// What is seen of every surfel that `motion` takes to the state.
    pub(super) fn all(&self, motion: &Rigid) -> Vec<Seen> {
        (0..self.cloud.len()).into_par_iter().with_min_len(256).map(|i| self.seen(i, motion)).collect()
    }

    /// What is seen of surfel `i`.
    pub(super) fn seen(&self, i: usize, motion: &Rigid) -> Seen {
        /// Surfaces seen from behind are empty where a view sees this many times farther past them.
        const BEHIND: f32 = 3.0;
        /// Reach for the surfels where it is seen, distances of surfels.
        const LANDING_REACH: f32 = 1.5;
        let settings = self.settings;
        let surfel = Surfel::of(self.cloud, i).moved(motion);
        let mut out = Seen {
            misfit: 0.0,
            hit: 0,
            through: 0,
            hidden: 0,
            backed: false,
            occluders: [NOBODY; OCCLUDERS],
            landing: [NOBODY; LANDINGS],
        };
        // Views that see something in front of it, that it faces away from, and of these views those that see a surface close in front of it.
        let [mut hiding, mut turned, mut backing] = [Sample::default(); 3];
        for (index, view) in self.views.iter().enumerate() {
            let Some((r, cosine)) = residual(view, &surfel, settings.facing) else { continue };
            let (t, front) = (r / self.noise.deviation_at(cosine), cosine >= settings.facing);
            if t > settings.hit {
                out.through += u16::from(front || t > BEHIND * settings.hit);
            } else if front && t >= -settings.hit {
                out.hit += 1;
                out.misfit += misfit(t);
            } else if front {
                hiding.add(index);
            } else if cosine > -settings.facing {
                // A view along the surface says nothing.
            } else if r * cosine < self.thickness {
                backing.add(index);
            } else {
                turned.add(index);
            }
        }
        out.hidden = hiding.count;
        if out.through > 0
            && let Some(t) = self.shown_residual(&surfel)
        {
            // Its state shows this surface: views that look past its edge do not contradict.
            out.through = 0;
            if out.hit == 0 {
                (out.hit, out.misfit) = (1, misfit(t));
            }
        }
        if out.hit > 0 {
            let (mut found, limit) = (0, (LANDING_REACH * self.spacing).powi(2));
            self.shown.nearest_n(surfel.point, LANDINGS, limit, |j, _| {
                out.landing[found] = j as u32;
                found += 1;
            });
        } else if out.through == 0 {
            out.backed = out.hidden == 0 && backing.count > 0;
            let sample = [hiding, backing].into_iter().find(|s| s.count > 0).unwrap_or(turned);
            for (place, view) in out.occluders.iter_mut().zip(sample.iter()) {
                *place = self.occluder(&self.views[view], surfel.point);
            }
        }
        out
    }

    /// Distance along the normal to the surface of the state at the place of a surfel, standard deviations; none if there is none.
    fn shown_residual(&self, surfel: &Surfel) -> Option<f32> {
        /// Reach, distances of surfels.
        const REACH: f32 = 1.0;
        /// Least cosine between normals.
        const ALIKE: f32 = 0.8;
        const NEAREST: usize = 4;
        let deviation = self.noise.deviation_at(1.0);
        let mut best: Option<f32> = None;
        self.shown.nearest_n(surfel.point, NEAREST, (REACH * self.spacing).powi(2), |j, _| {
            let other = Surfel::of(self.shown.cloud, j);
            let t = other.normal.dot(surfel.point - other.point).abs() / deviation;
            if other.normal.dot(surfel.normal) > ALIKE && t <= self.settings.hit && best.is_none_or(|b| t < b) {
                best = Some(t);
            }
        });
        best
    }

    /// The surfel that a view shows in front of a point.
    fn occluder(&self, view: &DepthLookup, point: Vec3) -> u32 {
        /// Reach for the surfel that a pixel shows, distances of surfels.
        const REACH: f32 = 2.0;
        let limit = (REACH * self.spacing).powi(2);
        let found = view.shown_at(point).and_then(|p| self.shown.nearest_within(p, limit));
        found.map_or(NOBODY, |found| found.0 as u32)
    }
}

impl DepthLookup {
    /// A point and a direction in the frame of the camera.
    fn seen_from(&self, point: Vec3, normal: Vec3) -> (Vec3, Vec3) {
        let (rotation, translation) = self.pose();
        (rotation * point + translation, rotation * normal)
    }

    /// Depth at a pixel, infinite where nothing is seen, none where nothing was measured.
    fn measured(&self, pixel: usize) -> Option<f32> {
        let depth = self.depth.at(pixel);
        if depth > 0.0 { Some(depth) } else { (!self.is_unknown(pixel)).then_some(f32::INFINITY) }
    }

    /// The surface point that the view shows in the direction of a point, world frame.
    fn shown_at(&self, point: Vec3) -> Option<Vec3> {
        let (pixel, _) = self.locate(point)?;
        let depth = self.depth.at(pixel);
        let width = self.camera.intrinsics.width as usize;
        let place = DVec2::new((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
        (depth > 0.0).then(|| self.camera.unproject(place, depth.into()).as_vec3())
    }
}
