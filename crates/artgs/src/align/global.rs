//! Alignment of two recordings without a first guess: hypotheses from matched points, ordered by what the frames of each
//! recording see of the surfaces of the other.

use super::cloud::FusedCloud;
use super::features::Features;
use super::frames::DepthFrame;
use crate::neighbours::PointTree;
use artgs_core::{PerState, Rigid, State};
use glam::{DMat3, DVec3, Vec3};
use nalgebra::{Matrix6, Vector6};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Search for the alignment. Lengths are in units of the median depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GlobalConfig {
    /// Edge of the cubes that frames are averaged over.
    pub voxel: f64,
    /// Radius of a descriptor, cubes.
    pub radius: f64,
    /// Described points of a recording.
    pub features: usize,
    /// Random triples of matches.
    pub triples: usize,
    /// Hypotheses that are refined.
    pub refined: usize,
    /// Largest angle between the upward directions of the recordings, where both state them, degrees.
    pub up_deg: f64,
    /// Depth difference within which a point is on a surface.
    pub tolerance: f64,
    /// Alignments that differ by less are the same: degrees.
    pub same_deg: f64,
    /// Alignments that differ by less are the same: length.
    pub same_shift: f64,
}

impl Default for GlobalConfig {
    fn default() -> Self {
        Self {
            voxel: 0.025,
            radius: 6.0,
            features: 2000,
            triples: 400_000,
            refined: 40,
            up_deg: 8.0,
            tolerance: 0.015,
            same_deg: 8.0,
            same_shift: 0.1,
        }
    }
}

/// A possible motion from the world of one recording into that of another, and how well it explains both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hypothesis {
    /// End world to start world.
    pub(crate) motion: Rigid,
    /// Share of the points that the other recording sees as surface less the share that it sees through, -1 to 1.
    pub(crate) score: f64,
    /// Share of all points that the other recording sees as surface.
    pub(crate) matched: f64,
}

/// Both recordings prepared for the search.
pub(crate) struct Scenes<'a> {
    /// Frames of the start and end recordings.
    frames: PerState<&'a [DepthFrame]>,
    /// Upward directions, where stated.
    up: PerState<Option<DVec3>>,
    clouds: PerState<FusedCloud>,
    /// Points of the start cloud.
    start: PointTree,
    unit: f64,
}

impl<'a> Scenes<'a> {
    /// Fuses the frames of both recordings; `unit` is their median depth.
    pub(crate) fn new(
        frames: PerState<&'a [DepthFrame]>,
        up: PerState<Option<DVec3>>,
        unit: f64,
        config: &GlobalConfig,
    ) -> Self {
        let clouds = frames.map(|f| FusedCloud::new(f.iter(), (config.voxel * unit) as f32));
        let start = PointTree::new(&clouds[State::START].points.iter().map(Vec3::to_array).collect::<Vec<_>>());
        Self { frames, up, clouds, start, unit }
    }

    /// Distinct alignments, best first. Empty if nothing matches.
    pub(crate) fn search(&self, config: &GlobalConfig, seed: u64) -> Vec<Hypothesis> {
        let radius = (config.radius * config.voxel * self.unit) as f32;
        let features = self.clouds.as_ref().map(|c| Features::new(c, radius, config.features));
        let matches = features[State::END].matches(&features[State::START], 3);
        // Recordings of one session share a world.
        let mut rough = vec![Rigid::IDENTITY];
        rough.extend(self.triples(&matches, config, seed));
        let mut refined: Vec<Hypothesis> = rough.into_par_iter().map(|m| self.refined(m, config)).collect();
        refined.sort_by(|a, b| b.score.total_cmp(&a.score));
        self.distinct(refined, config)
    }

    /// Score of one alignment, after registration of the clouds.
    pub(crate) fn refined(&self, motion: Rigid, config: &GlobalConfig) -> Hypothesis {
        let motion = self.register(motion, config);
        self.score(motion, config)
    }

    /// Mean of the points of a recording.
    pub(crate) fn center(&self, state: State) -> DVec3 {
        self.clouds[state].points.iter().sum::<Vec3>().as_dvec3() / self.clouds[state].len().max(1) as f64
    }

    fn distinct(&self, sorted: Vec<Hypothesis>, config: &GlobalConfig) -> Vec<Hypothesis> {
        let center = self.center(State::END);
        let mut kept: Vec<Hypothesis> = Vec::new();
        for h in sorted {
            let same = |k: &Hypothesis| {
                (k.motion.inverse() * h.motion).angle().to_degrees() < config.same_deg
                    && k.motion.apply(center).distance(h.motion.apply(center)) < config.same_shift * self.unit
            };
            if !kept.iter().any(same) {
                kept.push(h);
            }
        }
        kept
    }

    /// Motions of random triples of matches whose triangles agree, those with the most agreeing matches first.
    fn triples(&self, matches: &[(usize, usize)], config: &GlobalConfig, seed: u64) -> Vec<Rigid> {
        if matches.len() < 3 {
            return Vec::new();
        }
        let voxel = config.voxel * self.unit;
        let points = |m: (usize, usize)| {
            (self.clouds[State::END].points[m.0].as_dvec3(), self.clouds[State::START].points[m.1].as_dvec3())
        };
        let pairs: Vec<(DVec3, DVec3)> = matches.iter().map(|&m| points(m)).collect();
        const CHUNK: usize = 10_000;
        let chunks = config.triples.div_ceil(CHUNK);
        let mut found: Vec<(usize, Rigid)> = (0..chunks)
            .into_par_iter()
            .flat_map_iter(|chunk| {
                let mut rng = Pcg64Mcg::seed_from_u64(seed ^ ((chunk as u64 + 1) << 20));
                let pairs = &pairs;
                (0..CHUNK).filter_map(move |_| {
                    let pick = [(); 3].map(|()| pairs[rng.random_range(0..pairs.len())]);
                    let motion = triangle_motion(pick, 2.0 * voxel, 8.0 * voxel)?;
                    if !self.upright(&motion, config.up_deg) {
                        return None;
                    }
                    let inliers = pairs.iter().filter(|(e, s)| motion.apply(*e).distance(*s) < 2.5 * voxel).count();
                    Some((inliers, motion))
                })
            })
            .collect();
        found.sort_by_key(|f| std::cmp::Reverse(f.0));
        // Many triples give nearly the same motion.
        let mut kept: Vec<Rigid> = Vec::new();
        for (_, motion) in found {
            let near = |k: &Rigid| {
                (k.inverse() * motion).angle().to_degrees() < 5.0
                    && k.apply(pairs[0].0).distance(motion.apply(pairs[0].0)) < 5.0 * voxel
            };
            if !kept.iter().any(near) {
                kept.push(motion);
            }
            if kept.len() == config.refined {
                break;
            }
        }
        kept
    }

    fn upright(&self, motion: &Rigid, limit_deg: f64) -> bool {
        match (self.up[State::START], self.up[State::END]) {
            (Some(start), Some(end)) => motion.turn(end).angle_between(start).to_degrees() < limit_deg,
            _ => true,
        }
    }

    /// Points of the end cloud against planes of the start cloud, with a gate that shrinks.
    fn register(&self, mut motion: Rigid, config: &GlobalConfig) -> Rigid {
        let voxel = config.voxel * self.unit;
        let (start, end) = (&self.clouds[State::START], &self.clouds[State::END]);
        let stride = end.len().div_ceil(3000).max(1);
        for step in 0..20 {
            let gate = voxel * (4.0 - 0.15 * f64::from(step));
            let (mut matrix, mut vector) = (Matrix6::<f64>::zeros(), Vector6::<f64>::zeros());
            for i in (0..end.len()).step_by(stride) {
                let p = motion.apply(end.points[i].as_dvec3());
                let found = self.start.nearest_within(&p.as_vec3().to_array(), (gate * gate) as f32);
                let Some((j, _)) = found else { continue };
                let n = start.normals[j].as_dvec3();
                if motion.turn(end.normals[i].as_dvec3()).dot(n) < 0.7 {
                    continue;
                }
                let residual = n.dot(p - start.points[j].as_dvec3());
                let weight = 1.0 / (1.0 + (residual / (0.3 * voxel)).powi(2)).powi(2);
                let turn = p.cross(n);
                let row = Vector6::new(turn.x, turn.y, turn.z, n.x, n.y, n.z);
                matrix += weight * row * row.transpose();
                vector += weight * residual * row;
            }
            for k in 0..6 {
                matrix[(k, k)] += 1e-6 * (1.0 + matrix[(k, k)]);
            }
            let Some(factor) = matrix.cholesky() else { break };
            let x = -factor.solve(&vector);
            let turn = glam::DQuat::from_scaled_axis(DVec3::new(x[0], x[1], x[2]));
            motion = Rigid { rotation: turn, translation: DVec3::new(x[3], x[4], x[5]) } * motion;
        }
        motion
    }

    /// Counts, in both directions, points that the other recording sees as surface and that it sees through.
    pub(crate) fn score(&self, motion: Rigid, config: &GlobalConfig) -> Hypothesis {
        let tolerance = config.tolerance * self.unit;
        let ends = seen(&self.clouds[State::END], self.frames[State::START], &motion, tolerance);
        let starts = seen(&self.clouds[State::START], self.frames[State::END], &motion.inverse(), tolerance);
        let [score, matched] = shares([ends, starts]);
        Hypothesis { motion, score, matched }
    }

    /// Score of the recordings against their own frames: what the right alignment of recordings in which nothing moved can reach.
    pub(crate) fn own_score(&self, config: &GlobalConfig) -> f64 {
        let tolerance = config.tolerance * self.unit;
        shares(State::ALL.map(|s| seen(&self.clouds[s], self.frames[s], &Rigid::IDENTITY, tolerance)))[0]
    }
}

/// Share of all points that are seen as surface less the share that is seen through, and the former.
fn shares(seen: [(usize, usize, usize); 2]) -> [f64; 2] {
    let [a, b] = seen;
    let total = (a.2 + b.2).max(1) as f64;
    let (matched, through) = ((a.0 + b.0) as f64, (a.1 + b.1) as f64);
    [(matched - through) / total, matched / total]
}

/// Of some points of a cloud, moved: seen as surface, seen through, tested.
fn seen(cloud: &FusedCloud, frames: &[DepthFrame], motion: &Rigid, tolerance: f64) -> (usize, usize, usize) {
    /// Points tested.
    const SAMPLES: usize = 1500;
    let stride = cloud.len().div_ceil(SAMPLES).max(1);
    let (mut matched, mut through, mut total) = (0, 0, 0);
    for i in (0..cloud.len()).step_by(stride) {
        let (surface, empty) = votes(motion.apply(cloud.points[i].as_dvec3()), frames, tolerance);
        matched += usize::from(surface >= 1 && surface >= empty);
        through += usize::from(empty >= 2 && empty > 2 * surface);
        total += 1;
    }
    (matched, through, total)
}

/// Points of a cloud that the frames look through.
pub(crate) fn seen_through(cloud: &FusedCloud, frames: &[DepthFrame], tolerance: f64) -> Vec<bool> {
    let through = |p: &Vec3| {
        let (surface, empty) = votes(p.as_dvec3(), frames, tolerance);
        empty >= 2 && empty > 2 * surface
    };
    cloud.points.par_iter().map(through).collect()
}

/// Frames that see a surface at a point, and frames that look through it.
fn votes(p: DVec3, frames: &[DepthFrame], tolerance: f64) -> (usize, usize) {
    let (mut surface, mut empty) = (0, 0);
    for f in frames {
        let q = f.camera.world_to_camera.apply(p);
        let Some(cell) = f.cell_of(q) else { continue };
        let z = f64::from(f.points[cell].z);
        if z > 0.0 {
            surface += usize::from((z - q.z).abs() < tolerance);
            // A margin: mean depth near an edge is neither.
            empty += usize::from(z - q.z > 2.0 * tolerance);
        }
    }
    (surface, empty)
}

/// The motion of three points onto three others, if sides agree within `tolerance` and are at least `least` long.
fn triangle_motion(pairs: [(DVec3, DVec3); 3], tolerance: f64, least: f64) -> Option<Rigid> {
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let (a, b) = (pairs[i].0.distance(pairs[j].0), pairs[i].1.distance(pairs[j].1));
        if a < least || (a - b).abs() > tolerance {
            return None;
        }
    }
    let frame = |p: [DVec3; 3]| {
        let x = (p[1] - p[0]).try_normalize()?;
        let z = x.cross(p[2] - p[0]).try_normalize()?;
        Some(DMat3::from_cols(x, z.cross(x), z))
    };
    let (from, to) = (pairs.map(|p| p.0), pairs.map(|p| p.1));
    let rotation = frame(to)? * frame(from)?.transpose();
    let middle = |p: [DVec3; 3]| (p[0] + p[1] + p[2]) / 3.0;
    Some(Rigid::from_matrix(rotation, middle(to) - rotation * middle(from)))
}
