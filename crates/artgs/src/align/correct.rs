//! Correction of captures whose states share a frame: jitter of stated poses, and a small misalignment of the end state.
//!
//! Poses of a state are refined only where that lowers the disagreement of its depth clearly. The end state is moved only
//! where its surfaces then agree with those of the start much better than as stated: exact captures stay as they are.

use super::bundle::{BundleConfig, median_depth, overlapping_pairs, register_frames, register_states};
use super::exposure::{self, Exposure};
use super::frames::DepthFrame;
use super::refine::refine_poses;
use super::{AlignConfig, LEAST_FRAMES, mean_motion};
use artgs_core::{Capture, PerState, Rigid, State, View};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Correction of captures that share a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CorrectConfig {
    /// False: stated poses are used as they are.
    pub enabled: bool,
    /// Standard deviation of the jitter of a stated pose: angle in degrees.
    pub stated_deg: f64,
    /// Standard deviation of the jitter of a stated pose: position, relative to the median depth.
    pub stated_shift: f64,
    /// Disagreement of depth, relative to the median depth, below which poses are exact.
    pub exact: f64,
    /// Poses are refined if that lowers the disagreement to this share, 0 to 1.
    pub refined: f64,
    /// Largest correction of the end state: angle in degrees.
    pub largest_deg: f64,
    /// Largest correction of the end state: motion of the object's centre as a share of its size.
    pub largest_shift: f64,
    /// The end state is moved if the share of surfaces that agree grows by this factor.
    pub gain: f64,
    /// A stated alignment is right if this share of the surfaces that agree roughly agrees within the noise, 0 to 1.
    pub sharp: f64,
}

impl Default for CorrectConfig {
    fn default() -> Self {
        Self {
            enabled: true,
            stated_deg: 0.5,
            stated_shift: 0.005,
            exact: 5e-4,
            refined: 0.7,
            largest_deg: 10.0,
            largest_shift: 0.15,
            gain: 1.3,
            sharp: 0.85,
        }
    }
}

/// What was corrected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Correction {
    /// Median disagreement of a state's depth before and after its poses were refined, scene units; none where the stated
    /// poses were kept.
    pub poses: PerState<Option<[f64; 2]>>,
    /// Motion of the end state into the world of the start; none where the stated alignment was kept.
    pub end: Option<EndCorrection>,
    /// Gains of the views that were removed; none where colours were kept.
    pub exposure: Option<Exposure>,
}

/// Correction of the alignment of two states.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EndCorrection {
    /// World of the end state as stated to that of the start state.
    pub motion: Rigid,
    /// Share of the surfaces that agree between the states within the noise, as stated and corrected, 0 to 1.
    pub agreement: [f64; 2],
    /// Motion of the object's centre, scene units.
    pub shift: f64,
}

impl Correction {
    /// True if cameras and colours were kept.
    pub fn is_none(&self) -> bool {
        self.end.is_none() && self.exposure.is_none() && self.poses.iter().all(Option::is_none)
    }

    /// One sentence for each correction.
    pub fn sentences(&self) -> Vec<String> {
        let poses = self.poses.enumerate().filter_map(|(state, p)| {
            p.map(|[before, after]| {
                format!(
                    "poses of the {} state were refined: surfaces of different views disagreed by {before:.4} units, now by \
                     {after:.4}",
                    state.name()
                )
            })
        });
        let end = self.end.map(|end| {
            format!(
                "the end state was moved by {:.2} degrees and {:.4} units to align it with the start state: {:.0} % of its \
                 surfaces agreed with the start, now {:.0} %",
                end.motion.angle().to_degrees(),
                end.shift,
                100.0 * end.agreement[0],
                100.0 * end.agreement[1]
            )
        });
        poses.chain(end).chain(self.exposure.map(|e| e.sentence())).collect()
    }
}

/// Corrects the cameras of a capture and equalises the exposure of its training views. Captures without depth or with few
/// views, and those that were aligned or corrected before, stay as they are.
pub fn correct(capture: &mut Capture, config: &AlignConfig) -> Correction {
    let mut done = Correction::default();
    let usable = |views: &[View]| views.iter().filter(|v| v.depth.is_some()).count() >= LEAST_FRAMES;
    let aligned = capture.frames.is_some();
    if aligned || !config.correct.enabled || !capture.states.iter().all(|s| usable(&s.train)) {
        return done;
    }
    let mut frames = capture.states.as_ref().map(|s| DepthFrame::of_views(&s.train, &config.grid));
    let unit = median_depth(frames.iter().flatten());
    let mut noise = 0.0_f64;
    for state in State::ALL {
        let (kept, disagreement) = refined_poses(&mut frames[state], unit, config);
        done.poses[state] = kept;
        noise = noise.max(disagreement);
    }
    for (state, own) in frames.enumerate() {
        if done.poses[state].is_some() {
            let views = capture.states[state].train.iter_mut().zip(own);
            views.for_each(|(view, frame)| view.camera.world_to_camera = frame.camera.world_to_camera);
        }
    }
    // Refined poses leave each state where its poses were on average, which the jitter itself decides.
    let loose = done.poses.iter().any(Option::is_some);
    done.end = end_correction(&frames, noise, unit, loose, config);
    if let Some(end) = done.end {
        let own = &mut capture.states[State::END];
        for view in own.train.iter_mut().chain(&mut own.test) {
            view.camera.world_to_camera = view.camera.world_to_camera * end.motion.inverse();
        }
        frames[State::END].iter_mut().for_each(|frame| frame.set_pose(end.motion * frame.pose()));
        let [start, before] = capture.frames.map_or([Rigid::IDENTITY; 2], |f| [f[State::START], f[State::END]]);
        capture.frames = Some(PerState::new(start, end.motion * before));
    }
    done.exposure = equalise(capture, &frames, config);
    capture.warnings.extend(done.sentences());
    done
}

/// Equalises the colours of the training views, whose prepared frames are `frames`.
fn equalise(capture: &mut Capture, frames: &PerState<Vec<DepthFrame>>, config: &AlignConfig) -> Option<Exposure> {
    let all: Vec<&DepthFrame> = frames.iter().flatten().collect();
    let (factors, done) = exposure::equalising(&all, config.exposure.explained_in_captures, &config.exposure)?;
    let views = capture.states.iter_mut().flat_map(|s| &mut s.train);
    for (view, factors) in views.zip(factors) {
        view.rgba.par_iter_mut().for_each(|c| *c = exposure::applied(*c, factors));
    }
    Some(done)
}

/// Refines the poses of one state where that is clearly better. Returns the disagreement before and after if they were
/// refined, and what remains.
fn refined_poses(frames: &mut [DepthFrame], unit: f64, config: &AlignConfig) -> (Option<[f64; 2]>, f64) {
    let order: Vec<(usize, usize)> = (0..frames.len()).map(|i| (0, i)).collect();
    let CorrectConfig { stated_deg, stated_shift, .. } = config.correct;
    let refine = BundleConfig { stated_deg, stated_shift, ..config.bundle };
    let look = BundleConfig { steps: 1, ..refine };
    let pairs = overlapping_pairs(frames, look.overlap);
    let stated = register_frames(frames, &pairs, &order, &look).before;
    if stated < config.correct.exact * unit {
        return (None, stated);
    }
    let poses: Vec<Rigid> = frames.iter().map(DepthFrame::pose).collect();
    let report = refine_poses(frames, &order, &refine);
    if report.after > config.correct.refined * report.before {
        frames.iter_mut().zip(&poses).for_each(|(frame, pose)| frame.set_pose(*pose));
        return (None, stated);
    }
    // The stated poses define the world on average.
    let back = mean_motion(&poses, frames, &Rigid::IDENTITY).inverse();
    frames.iter_mut().for_each(|frame| frame.set_pose(back * frame.pose()));
    (Some([report.before, report.after]), report.after)
}

/// The motion of the end state after which much more of it agrees with the start, within the limits of the settings; if the
/// states are `loose`, any that does not make less agree.
fn end_correction(
    frames: &PerState<Vec<DepthFrame>>,
    noise: f64,
    unit: f64,
    loose: bool,
    config: &AlignConfig,
) -> Option<EndCorrection> {
    /// First standard deviations of the residuals, as shares of the object's size: a wide one finds a misalignment, a
    /// narrow one is not led away by moved parts.
    const WIDTHS: [f64; 3] = [0.03, 0.01, 0.003];
    /// By how much more the agreement must grow for a shift by the size of the object.
    const PER_SIZE: f64 = 10.0;
    /// Least share of the surfaces whose sharp agreement is no coincidence: of a wrong alignment, a third of what agrees roughly agrees sharply. Of a
    /// laptop that is closed in one state, 8 % agree; its lid, taken for the top of its base, would make it 33 %.
    const LEAST: f64 = 0.02;
    /// From the median of absolute values to three standard deviations.
    const WITHIN: f64 = 3.0 * 1.4826;
    let (center, size) = extent(frames);
    let tolerance = (WITHIN * noise).max(config.correct.exact * unit);
    let pairs = nearby_pairs(frames, unit);
    let (stated, rough) = agreement(frames, &pairs, &Rigid::IDENTITY, tolerance);
    if !loose && stated > config.correct.sharp * rough && stated > LEAST {
        return None;
    }
    let candidates = WIDTHS.map(|width| {
        let motion = register_states(frames, &pairs, width * size, tolerance / 3.0);
        (motion, agreement(frames, &pairs, &motion, tolerance).0)
    });
    let shift = |m: &Rigid| m.apply(center).distance(center);
    let possible = candidates.iter().filter(|(m, _)| {
        m.angle().to_degrees() < config.correct.largest_deg && shift(m) < config.correct.largest_shift * size
    });
    let (motion, corrected) = possible.max_by(|a, b| a.1.total_cmp(&b.1))?;
    // A right alignment far from the stated one lets many times more surfaces agree; one that follows parts which moved alike
    // does not.
    let gain = if loose { 1.0 } else { config.correct.gain + PER_SIZE * shift(motion) / size };
    (*corrected > gain * stated).then(|| EndCorrection {
        motion: *motion,
        agreement: [stated, *corrected],
        shift: shift(motion),
    })
}

/// Shares of the compared points of the end state that lie on a surface of the start state: within `tolerance`, and within
/// three times that.
fn agreement(
    frames: &PerState<Vec<DepthFrame>>,
    pairs: &[(usize, usize)],
    motion: &Rigid,
    tolerance: f64,
) -> (f64, f64) {
    let (mut near, mut rough, mut count) = (0_usize, 0_usize, 0_usize);
    for &(i, j) in pairs {
        let (end, start) = (&frames[State::END][i], &frames[State::START][j]);
        let relative = start.camera.world_to_camera * *motion * end.pose();
        for &s in &end.samples {
            let p = relative.apply(end.points[s as usize].as_dvec3());
            let Some(cell) = start.cell_of(p) else { continue };
            let (q, n) = (start.points[cell].as_dvec3(), start.normals[cell].as_dvec3());
            count += 1;
            if n != DVec3::ZERO && relative.turn(end.normals[s as usize].as_dvec3()).dot(n) > 0.8 {
                let residual = n.dot(p - q).abs();
                near += usize::from(residual < tolerance);
                rough += usize::from(residual < 3.0 * tolerance);
            }
        }
    }
    let share = |n: usize| n as f64 / count.max(1) as f64;
    (share(near), share(rough))
}

/// Each view of the end state with the views of the start state that look from nearly the same place in nearly the same
/// direction.
fn nearby_pairs(frames: &PerState<Vec<DepthFrame>>, unit: f64) -> Vec<(usize, usize)> {
    const VIEWS: usize = 6;
    let pairs_of = |(i, end): (usize, &DepthFrame)| {
        let pose = end.pose();
        let distance = |start: &DepthFrame| {
            let other = start.pose();
            let turned = 1.0 - other.turn(DVec3::Z).dot(pose.turn(DVec3::Z));
            turned + (other.translation - pose.translation).length_squared() / (unit * unit)
        };
        let mut order: Vec<(f64, usize)> =
            frames[State::START].iter().enumerate().map(|(j, start)| (distance(start), j)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.into_iter().take(VIEWS).map(move |(_, j)| (i, j)).collect::<Vec<_>>()
    };
    frames[State::END].iter().enumerate().flat_map(pairs_of).collect()
}

/// Centre and diagonal of the box of the start state's points, without the outermost 1 %.
fn extent(frames: &PerState<Vec<DepthFrame>>) -> (DVec3, f64) {
    let points: Vec<DVec3> = frames[State::START]
        .iter()
        .flat_map(|f| {
            let pose = f.pose();
            f.samples.iter().map(move |&s| pose.apply(f.points[s as usize].as_dvec3()))
        })
        .collect();
    let range = |axis: usize| {
        let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
        crate::trimmed::trimmed_range(&mut values, 100, f64::total_cmp).unwrap_or([0.0; 2])
    };
    let ranges = [range(0), range(1), range(2)];
    let (low, high) = (DVec3::from_array(ranges.map(|r| r[0])), DVec3::from_array(ranges.map(|r| r[1])));
    (0.5 * (low + high), low.distance(high))
}
