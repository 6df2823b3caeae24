//! Where points of one state are under a motion in the other state, and the cost of that position.

use super::cloud::IndexedCloud;
use super::cube_votes::{Cube, CubeVotes};
use super::segmentation::LabelCosts;
use super::visibility::{CHUNK, DepthLookup, ViewVotes};
use artgs_core::Rigid;
use glam::{Mat3, Vec3};
use rayon::prelude::*;

/// Points of a state with what is needed to look them up in another one.
pub(super) struct StatePair<'a> {
    /// Points of the state that is labelled.
    pub(super) own: &'a IndexedCloud<'a>,
    /// Points of the other state.
    pub(super) other: &'a IndexedCloud<'a>,
    /// Depth maps of the other state.
    pub(super) other_views: &'a [DepthLookup],
    /// Every so many of these are asked about a place.
    pub(super) view_step: usize,
    /// Cubes about which these agree.
    pub(super) other_cubes: &'a CubeVotes,
    /// Depth tolerance, scene units.
    pub(super) tolerance: f32,
    /// Views that may look through a surface by mistake.
    pub(super) stray_views: u32,
    /// Distance between neighbouring points, scene units.
    pub(super) spacing: f32,
}

/// Where a point of one state is in the other one under a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Landing {
    /// In space shown as empty, at this cost.
    Empty(f32),
    /// Where no view shows anything.
    #[default]
    Hidden,
    /// At the depth of a surface of which too little is seen to give points.
    Unsampled,
    /// On a surface: its point there, and the cost of looking different from it.
    Surface(u32, f32),
}

impl Landing {
    /// Cost of a position under a motion.
    pub(super) fn cost(&self, costs: &LabelCosts) -> f32 {
        match self {
            Self::Empty(cost) | Self::Surface(_, cost) => *cost,
            Self::Unsampled => costs.mismatch,
            Self::Hidden => costs.hidden_moved,
        }
    }

    /// Cost of a position judged by itself, at rest or moved.
    pub(super) fn plain_cost(&self, at_rest: bool, costs: &LabelCosts) -> f32 {
        match self {
            Self::Hidden if at_rest => costs.hidden_static,
            _ => self.cost(costs),
        }
    }

    /// True on a surface that looks the same.
    pub(super) fn fits(&self, costs: &LabelCosts) -> bool {
        matches!(self, Self::Surface(_, cost) if *cost < 0.5 * costs.mismatch)
    }
}

impl StatePair<'_> {
    /// The same pair asking fewer views about a place, which is enough to compare motions.
    pub(super) fn with_few_views(self) -> Self {
        /// Views that are asked at most.
        const VIEWS: usize = 24;
        Self { view_step: self.other_views.len().div_ceil(VIEWS).max(1), ..self }
    }

    /// Where point `i` is that moves to `q`, for which the other state's views cast `votes`.
    fn landing(&self, i: usize, q: Vec3, rotation: &Mat3, votes: ViewVotes, costs: &LabelCosts) -> Landing {
        if votes.surface == 0 && votes.through <= self.stray_views {
            return Landing::Hidden;
        }
        if !votes.is_surface() {
            let through = votes.through as f32 / (votes.through + votes.surface) as f32;
            // One or two views are weak evidence.
            let trust = (votes.through.saturating_sub(self.stray_views) as f32 / 3.0).min(1.0);
            return Landing::Empty(trust * (0.5 + 0.5 * through));
        }
        // Of the nearest points the one whose surface fits best; nearer ones first, so that differences of texture count.
        let normal = *rotation * self.own.cloud.normals[i];
        let mut best: Option<(usize, f32)> = None;
        self.other.nearest_n(q, 4, (2.0 * self.spacing).powi(2), |j, _| {
            let shape = self.misplacement(j, q, normal);
            if best.is_none_or(|b| shape < b.1 - 0.1) {
                best = Some((j, shape));
            }
        });
        let Some((j, shape)) = best else { return Landing::Unsampled };
        // The other side of a thin plate may have another colour.
        let same_side = normal.dot(self.other.cloud.normals[j]) > -0.7;
        let tint = (self.own.cloud.colors[i] - self.other.cloud.colors[j]).abs().max_element();
        let tint = if same_side { (tint / 0.5).min(1.0) } else { 0.0 };
        Landing::Surface(j as u32, costs.mismatch * shape + costs.color * tint * tint)
    }

    /// How badly a point at `q` with `normal` fits the surface at point `j` of the other state, 0 to 1. The other side of
    /// a thin plate fits nearly as well as the same side.
    fn misplacement(&self, j: usize, q: Vec3, normal: Vec3) -> f32 {
        let other = self.other.cloud;
        let facing = normal.dot(other.normals[j]);
        let turned_away = if facing < 0.0 { 1.0 + 0.7 * facing } else { 1.0 - facing };
        let off_plane = ((q - other.points[j]).dot(other.normals[j]).abs() / self.spacing).min(1.0);
        turned_away.max(0.5 * off_plane * off_plane)
    }

    /// Where every point lands under every motion, `[n * motions]`.
    pub(super) fn landings(&self, to_other: &[Rigid], costs: &LabelCosts) -> Vec<Landing> {
        self.fill_rows(to_other, costs, |_, landing| landing)
    }

    /// `f(motion's number, landing)` of every point under every motion, `[n * motions]`.
    fn fill_rows<T: Copy + Default + Send>(
        &self,
        to_other: &[Rigid],
        costs: &LabelCosts,
        f: impl Fn(usize, Landing) -> T + Sync,
    ) -> Vec<T> {
        let poses: Vec<(Mat3, Vec3)> =
            to_other.iter().map(|m| (m.matrix().as_mat3(), m.translation.as_vec3())).collect();
        let mut out = vec![T::default(); self.own.cloud.len() * poses.len()];
        out.par_chunks_mut(CHUNK * poses.len()).zip(self.own.cloud.points.par_chunks(CHUNK)).enumerate().for_each(
            |(chunk, (out, points))| {
                let (mut unclear, mut moved) = (Vec::with_capacity(CHUNK), Vec::with_capacity(CHUNK));
                let mut votes = vec![ViewVotes::default(); CHUNK];
                for (k, (rotation, translation)) in poses.iter().enumerate() {
                    unclear.clear();
                    moved.clear();
                    for (n, p) in points.iter().enumerate() {
                        let q = *rotation * *p + *translation;
                        let landing = match self.other_cubes.at(q) {
                            Cube::Empty => Landing::Empty(1.0),
                            Cube::Hidden => Landing::Hidden,
                            Cube::Mixed => {
                                unclear.push(n);
                                moved.push(q);
                                continue;
                            }
                        };
                        out[n * poses.len() + k] = f(k, landing);
                    }
                    let votes = &mut votes[..moved.len()];
                    let views = self.other_views.iter().step_by(self.view_step);
                    ViewVotes::of_each(views, &moved, self.tolerance, votes);
                    for ((n, q), votes) in unclear.iter().zip(&moved).zip(votes) {
                        let landing = self.landing(chunk * CHUNK + n, *q, rotation, *votes, costs);
                        out[n * poses.len() + k] = f(k, landing);
                    }
                }
            },
        );
        out
    }
}
