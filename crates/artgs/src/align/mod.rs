//! The stage `align`: recordings of two states, each in a world frame of its own, become one capture of the object.
//!
//! Poses of each recording are refined (`bundle`), the end recording is moved into the world of the start (`global`), all
//! poses are refined together, and the object is selected (`object`, `planes`, or `bounds`) and cut out (`extract`). What
//! else moved is reported (`bystander`).

mod bounds;
#[cfg(test)]
mod box_tests;
mod bundle;
mod bystander;
mod cloud;
mod color;
mod complete;
mod components;
mod consistent;
mod correct;
mod exposure;
mod extract;
mod features;
pub(crate) mod frames;
pub(crate) mod global;
mod object;
mod outline;
mod planes;
mod refine;
mod upward;
mod world;

pub use bounds::{BoxError, ObjectBox};
pub use bundle::BundleConfig;
pub use bystander::{Bystander, Seen};
pub use color::{ColorConfig, ColorRegistration, color_registration};
pub use complete::CompleteConfig;
pub use consistent::ConsistentConfig;
pub use correct::{CorrectConfig, Correction, EndCorrection, correct};
pub use exposure::{Exposure, ExposureConfig};
pub use extract::ExtractConfig;
pub use frames::GridConfig;
pub use global::GlobalConfig;
pub use object::ObjectConfig;
pub use planes::{Plane, PlaneConfig};

use crate::observer::Share;
use artgs_core::{Capture, FrameError, PerState, Recording, Rigid, State, StateViews, Upward};
use bundle::BundleReport;
use extract::StateFrames;
use frames::DepthFrame;
use glam::{DVec3, Vec3};
use global::{Hypothesis, Scenes, seen_through};
use object::Selection;
use refine::refine_poses;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Settings of the stage `align`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AlignConfig {
    /// Frames on coarse grids.
    pub grid: GridConfig,
    /// Registration of frames with each other.
    pub bundle: BundleConfig,
    /// Search for the alignment of the two recordings.
    pub global: GlobalConfig,
    /// Correction of depth by other frames.
    pub consistent: ConsistentConfig,
    /// Depth where none was measured.
    pub complete: CompleteConfig,
    /// Correction of captures whose states share a frame.
    pub correct: CorrectConfig,
    /// Registration of colour to depth.
    pub color: ColorConfig,
    /// Equalisation of exposure and white balance.
    pub exposure: ExposureConfig,
    /// Selection of the object.
    pub object: ObjectConfig,
    /// Views of the object.
    pub extract: ExtractConfig,
    /// Least score of an alignment as a share of the score of the recordings against their own frames: below it they have nothing in common.
    pub least_score: f64,
    /// An alignment whose score is this share of the same below the best is still possible, 0 to 1.
    pub ambiguous: f64,
}

impl Default for AlignConfig {
    fn default() -> Self {
        Self {
            grid: GridConfig::default(),
            bundle: BundleConfig::default(),
            global: GlobalConfig::default(),
            consistent: ConsistentConfig::default(),
            complete: CompleteConfig::default(),
            correct: CorrectConfig::default(),
            color: ColorConfig::default(),
            exposure: ExposureConfig::default(),
            object: ObjectConfig::default(),
            extract: ExtractConfig::default(),
            least_score: 0.3,
            ambiguous: 0.08,
        }
    }
}

/// Why recordings were not aligned. Every message says what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AlignError {
    /// A recording has fewer frames with depth than are needed.
    #[error(
        "the recording of state {state} has {count} frames with depth, at least {LEAST_FRAMES} are needed; record with \
         depth, or use a capture with known poses in one frame"
    )]
    FewFrames {
        /// Name of the state.
        state: &'static str,
        /// Frames with depth.
        count: usize,
    },
    /// No alignment explains both recordings.
    #[error(
        "the recordings of the two states cannot be aligned: the best alignment explains {percent:.0} % of the surfaces; \
         are they of the same object and place? Keep more of the surroundings in view and unchanged"
    )]
    NothingInCommon {
        /// Score of the best alignment, percent.
        percent: f64,
    },
    /// Two different alignments explain the recordings equally well.
    #[error(
        "two alignments of the recordings are almost equally good (scores {first:.2} and {second:.2}), {degrees:.0} degrees \
         and {length:.2} units apart: the surroundings look alike from two sides, or the recordings show different objects or places; \
         check that both show the same object, keep something in view that breaks the symmetry, and leave it where it is"
    )]
    Ambiguous {
        /// Score of the best alignment.
        first: f64,
        /// Score of the other.
        second: f64,
        /// Angle between them.
        degrees: f64,
        /// Distance between the places where they put the object, scene units.
        length: f64,
    },
    /// The cameras look at nothing but planes.
    #[error(
        "no object was found: the cameras look at floor and walls only; walk around the object and keep it in the centre"
    )]
    NoObject,
    /// Nothing of a state is in the box that was given.
    #[error("the box {given} contains no surface of the {state} state; {remedy}")]
    EmptyBox {
        /// Name of the state.
        state: &'static str,
        /// The box that was given.
        given: ObjectBox,
        /// What to do, with the box of what was recorded.
        remedy: BoxRemedy,
    },
    /// The object is in no view of a state.
    #[error(
        "no frame of state {0} shows the selected object: other things are in front of it, or it is too small in the images, or another \
         thing was selected; walk around it with nothing in front of it, or select it with --box"
    )]
    NoViews(&'static str),
}

/// A box to begin with instead of one that contains nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BoxRemedy {
    /// The object that is selected without a box.
    Selected(ObjectBox),
    /// The surfaces that both recordings show.
    Scene(ObjectBox),
    /// There are no surfaces.
    Nothing,
}

impl std::fmt::Display for BoxRemedy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Selected(found) => write!(f, "the object that is found without a box is in {found}"),
            Self::Scene(extent) => write!(f, "what was recorded is in {extent}"),
            Self::Nothing => f.write_str("no surfaces were recorded"),
        }
    }
}

/// Frames with depth that a recording needs.
pub const LEAST_FRAMES: usize = 4;

/// Shares of the work until the views of one state are registered, the states are in one frame, and all poses are refined:
/// rough, to show progress.
const REGISTERED: f64 = 0.15;
const TOGETHER: f64 = 0.45;
const POSES: f64 = 0.8;

/// What the stage found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AlignReport {
    /// Motion from the stated world of each recording into the world of the capture, which is that of the start recording
    /// after its poses were refined.
    pub frames: PerState<Rigid>,
    /// Median distance between surfaces of different frames before and after poses were refined, scene units.
    pub disagreement: PerState<[f64; 2]>,
    /// Share of the surfaces that the alignment explains less the share that it contradicts, -1 to 1.
    pub score: f64,
    /// The same of the best clearly different alignment; none if there is none.
    pub runner_up: Option<f64>,
    /// Gains of the frames that were removed; none where colours were kept.
    pub exposure: Option<Exposure>,
    /// Box of the surfaces of the object in both states, world of the start recording, scene units.
    pub object: ObjectBox,
    /// Box of what stands on the object, did not move and was left out; none if nothing was.
    pub left_out: Option<ObjectBox>,
    /// The box that was given; none if the object was selected by what the cameras look at.
    pub given: Option<ObjectBox>,
    /// Things that are not of the object and moved between the recordings, the largest first.
    pub bystanders: Vec<Bystander>,
    /// Share of what the cameras look at that is the object, 0 to 1.
    pub attention: f64,
    /// The same of the next candidate; 0 if a box was given.
    pub other_attention: f64,
    /// Planes that bound the scene.
    pub planes: Vec<Plane>,
    /// Frames that show the object, of each state.
    pub views: PerState<usize>,
    /// Upward direction in the world of the capture, with its source and certainty.
    pub upward: Upward,
    /// What `frames` leaves, because the poses of each recording were refined one by one.
    pub frame_errors: PerState<FrameError>,
}

/// Aligns two recordings and selects the object. The capture is in the world of the start recording and in its unit.
pub fn align(
    recordings: &PerState<Recording>,
    config: &AlignConfig,
    seed: u64,
) -> Result<(Capture, AlignReport), AlignError> {
    align_with_progress(recordings, config, None, seed, &mut |_| ())
}

/// The same. If a box is given, the object is what is inside of it; `done` takes the share of the work that is done.
pub fn align_with_progress(
    recordings: &PerState<Recording>,
    config: &AlignConfig,
    given: Option<&ObjectBox>,
    seed: u64,
    done: Share<'_>,
) -> Result<(Capture, AlignReport), AlignError> {
    for (state, recording) in recordings.enumerate() {
        let count = recording.frames.iter().filter(|f| f.view.depth.is_some()).count();
        if count < LEAST_FRAMES {
            return Err(AlignError::FewFrames { state: state.name(), count });
        }
    }
    let registered = with_registered_colors(recordings, &config.color);
    let aligned = poses(&registered, config, seed, done)?;
    done(POSES);
    cut_out(&registered, aligned, config, given, seed)
}

/// The recordings with colours where the depth is; a warning says what was done.
fn with_registered_colors<'a>(
    recordings: &'a PerState<Recording>,
    config: &ColorConfig,
) -> Cow<'a, PerState<Recording>> {
    let mut out = Cow::Borrowed(recordings);
    for (state, recording) in recordings.enumerate().filter(|_| config.enabled) {
        if let Some(registration) = color_registration(recording, config) {
            let own = &mut out.to_mut()[state];
            color::apply(own, &registration);
            own.warnings.push(format!("{} recording: {}", state.name(), registration.sentence()));
        }
    }
    out
}

/// Frames of both recordings with refined poses in the world of the start recording.
#[derive(Clone)]
pub(crate) struct Aligned {
    pub(crate) frames: PerState<Vec<DepthFrame>>,
    /// Median depth.
    pub(crate) unit: f64,
    pub(crate) best: Hypothesis,
    pub(crate) runner_up: Option<f64>,
    pub(crate) disagreement: PerState<[f64; 2]>,
}

/// Refines the poses of each recording, aligns the recordings, and refines all poses together.
pub(crate) fn poses(
    recordings: &PerState<Recording>,
    config: &AlignConfig,
    seed: u64,
    done: Share<'_>,
) -> Result<Aligned, AlignError> {
    done(0.0);
    let mut frames = recordings.as_ref().map(|r| DepthFrame::all(&r.frames, &config.grid));
    let unit = bundle::median_depth(frames.iter().flatten());
    let alone = PerState::from_fn(|state| {
        let order: Vec<(usize, usize)> = (0..frames[state].len()).map(|i| (0, i)).collect();
        let report = refine_poses(&mut frames[state], &order, &config.bundle);
        done((state.index() + 1) as f64 * REGISTERED);
        report
    });
    let (best, runner_up) = best_alignment(recordings, &frames, unit, config, seed)?;
    done(TOGETHER);
    let (frames, together) = register_jointly(frames, &best.motion, config);
    Ok(Aligned { frames, unit, best, runner_up, disagreement: alone.map(|r| [r.before, together.after]) })
}

/// Corrects depth, selects the object and makes views of it.
pub(crate) fn cut_out(
    recordings: &PerState<Recording>,
    aligned: Aligned,
    config: &AlignConfig,
    given: Option<&ObjectBox>,
    seed: u64,
) -> Result<(Capture, AlignReport), AlignError> {
    let Aligned { mut frames, unit, best, runner_up, disagreement } = aligned;
    let factors = frames.as_ref().map(|f| consistent::depth_factors(f, &config.consistent));
    for (own, factors) in frames.iter_mut().zip(factors.iter()) {
        own.iter_mut().zip(factors).for_each(|(frame, factors)| frame.scale_depth(factors));
    }
    let up = recordings[State::START].up;
    let (selection, object) = selected(&frames, unit, up, config, given, seed)?;
    let all: Vec<&DepthFrame> = frames.iter().flatten().collect();
    let equalised = exposure::equalising(&all, config.exposure.explained, &config.exposure);
    let (factors_of_colors, exposure) = equalised.unzip();
    let colors = split(factors_of_colors.unwrap_or_else(|| vec![Vec3::ONE; all.len()]), &frames);
    let spacing = (0.5 * config.object.cube * unit) as f32;
    let surface = selection.surface(&all, spacing);
    let planes = PerState::from_fn(|state| {
        // The median is of all surfaces; those at edges differ by more.
        let tolerance = 2.0 * disagreement[state][1].max(1e-3 * unit);
        complete::cell_planes(&frames[state], &colors[state], tolerance as f32, &config.complete)
    });
    let sources = PerState::from_fn(|state| StateFrames {
        recorded: &recordings[state].frames,
        frames: &frames[state],
        factors: &factors[state],
        planes: &planes[state],
        colors: &colors[state],
        surface: &surface,
        spacing,
    });
    let views = extract::views(&sources, &selection, &config.extract);
    if let Some((state, _)) = views.enumerate().find(|(_, v)| v.is_empty()) {
        return Err(AlignError::NoViews(state.name()));
    }
    let warnings = recordings.iter().flat_map(|r| r.warnings.iter().cloned()).collect();
    let bystanders = bystander::find(&frames, &selection, unit, config);
    let (to_start, frame_errors) = motions_of_worlds(recordings, &frames);
    let states = views.map(|train| StateViews { train, test: Vec::new() });
    let metric = recordings.iter().all(|r| r.metric);
    let poses: Vec<Rigid> = all.iter().map(|frame| frame.pose()).collect();
    let upward = upward::upward(up, &selection.planes, &poses, metric);
    let frames = Some(to_start);
    let capture = Capture { states, frames, frame_errors: Some(frame_errors), up: Some(upward), warnings };
    let report = AlignReport {
        frames: to_start,
        disagreement,
        score: best.score,
        runner_up,
        exposure,
        object,
        left_out: selection.left_out(),
        given: given.copied(),
        bystanders,
        attention: selection.attention,
        other_attention: selection.runner_up,
        upward,
        frame_errors,
        planes: selection.planes,
        views: capture.states.as_ref().map(|s| s.train.len()),
    };
    Ok((capture, report))
}

/// Values of the frames of all states, in the order of states, for each state.
fn split<T>(mut all: Vec<T>, frames: &PerState<Vec<DepthFrame>>) -> PerState<Vec<T>> {
    frames.as_ref().map(|own| all.drain(..own.len()).collect())
}

/// The object and the box of its surfaces.
fn selected(
    frames: &PerState<Vec<DepthFrame>>,
    unit: f64,
    up: Option<DVec3>,
    config: &AlignConfig,
    given: Option<&ObjectBox>,
    seed: u64,
) -> Result<(Selection, ObjectBox), AlignError> {
    let tolerance = config.global.tolerance * unit;
    let moved = |cloud: &cloud::FusedCloud| {
        let through = frames.as_ref().map(|f| seen_through(cloud, f, tolerance));
        (0..cloud.len()).map(|i| through.iter().any(|t| t[i])).collect()
    };
    let all: Vec<&DepthFrame> = frames.iter().flatten().collect();
    let automatic = || {
        let found = Selection::find(&all, unit, up, &moved, &config.object, seed)?;
        let bounds = found.bounds(&all)?;
        Some((found, bounds))
    };
    let Some(given) = given else { return automatic().ok_or(AlignError::NoObject) };
    let empty = |state: State| {
        let scene = || ObjectBox::around(all.iter().flat_map(|f| f.world_points()));
        let remedy = match automatic() {
            Some((_, bounds)) => BoxRemedy::Selected(bounds.rounded()),
            None => scene().map_or(BoxRemedy::Nothing, |extent| BoxRemedy::Scene(extent.rounded())),
        };
        AlignError::EmptyBox { state: state.name(), given: *given, remedy }
    };
    let found = Selection::inside(&all, unit, given, &config.object, seed);
    let Some(found) = found else { return Err(empty(State::START)) };
    let shown = |own: &[DepthFrame]| own.iter().flat_map(DepthFrame::world_points).any(|p| found.contains(p));
    if let Some((state, _)) = frames.enumerate().find(|(_, own)| !shown(own)) {
        return Err(empty(state));
    }
    let bounds = found.bounds(&all).ok_or_else(|| empty(State::START))?;
    Ok((found, bounds))
}

/// The alignment with the best score, and the score of the best clearly different one.
fn best_alignment(
    recordings: &PerState<Recording>,
    frames: &PerState<Vec<DepthFrame>>,
    unit: f64,
    config: &AlignConfig,
    seed: u64,
) -> Result<(Hypothesis, Option<f64>), AlignError> {
    let up = recordings.as_ref().map(|r| r.up);
    let scenes = Scenes::new(frames.as_ref().map(Vec::as_slice), up, unit, &config.global);
    let found = scenes.search(&config.global, seed);
    // Frames of a poor recording contradict each other: its limits are shares of what it can reach.
    let own = scenes.own_score(&config.global).clamp(0.0, 1.0);
    let Some(best) = found.first().copied().filter(|h| h.score >= config.least_score * own) else {
        let percent = 100.0 * found.first().map_or(0.0, |h| h.score.max(0.0));
        return Err(AlignError::NothingInCommon { percent });
    };
    if let Some(second) = found.get(1).filter(|h| h.score > best.score - config.ambiguous * own) {
        let center = scenes.center(State::END);
        return Err(AlignError::Ambiguous {
            first: best.score,
            second: second.score,
            degrees: (best.motion.inverse() * second.motion).angle().to_degrees(),
            length: best.motion.apply(center).distance(second.motion.apply(center)),
        });
    }
    Ok((best, found.get(1).map(|h| h.score)))
}

/// Refines the poses of all frames together, in the world of the start recording.
fn register_jointly(
    frames: PerState<Vec<DepthFrame>>,
    motion: &Rigid,
    config: &AlignConfig,
) -> (PerState<Vec<DepthFrame>>, BundleReport) {
    let counts = frames.as_ref().map(Vec::len);
    let mut joint = Vec::with_capacity(counts.iter().sum());
    let mut order = Vec::with_capacity(joint.capacity());
    for (state, own) in State::ALL.into_iter().zip(frames) {
        for (i, mut frame) in own.into_iter().enumerate() {
            if state == State::END {
                frame.set_pose(*motion * frame.pose());
            }
            joint.push(frame);
            order.push((state.index(), i));
        }
    }
    let report = refine_poses(&mut joint, &order, &config.bundle);
    let end = joint.split_off(counts[State::START]);
    (PerState::new(joint, end), report)
}

/// Motion from the stated world of each recording into that of the refined frames, and what it leaves.
fn motions_of_worlds(
    recordings: &PerState<Recording>,
    frames: &PerState<Vec<DepthFrame>>,
) -> (PerState<Rigid>, PerState<FrameError>) {
    let found = PerState::from_fn(|state| {
        let stated = recordings[state].frames.iter().map(|f| f.view.camera.world_to_camera.inverse());
        world::motion(&world::cameras(stated, &frames[state]))
    });
    (found.as_ref().map(|f| f.0), found.map(|f| f.1))
}

/// Mean motion from stated poses (camera to world) to those of frames, which is close to `near`.
fn mean_motion(stated: &[Rigid], frames: &[DepthFrame], near: &Rigid) -> Rigid {
    let motions: Vec<Rigid> = stated.iter().zip(frames).map(|(s, frame)| frame.pose() * s.inverse()).collect();
    let count = motions.len().max(1) as f64;
    let center = frames.iter().map(|f| f.pose().translation).sum::<DVec3>() / count;
    // Differences from `near` are small, so that rotation vectors can be averaged.
    let (mut turn, mut shift) = (DVec3::ZERO, DVec3::ZERO);
    for m in &motions {
        let difference = *m * near.inverse();
        turn += difference.rotation.to_scaled_axis() / count;
        shift += (difference.apply(center) - center) / count;
    }
    let rotation = glam::DQuat::from_scaled_axis(turn);
    Rigid { rotation, translation: center + shift - rotation * center } * *near
}
