//! Consistency of a capture: do its views agree about the surfaces that they show, and if not, which usual mistake in poses,
//! depth or intrinsics explains it?

mod agreement;
mod causes;
mod jumps;
mod odd;
mod samples;
mod twins;

use agreement::{Agreement, agreement, votes};
use artgs_core::{Capture, PerState, State, View};
pub use causes::Cause;
use causes::{GAIN, likely_cause, likely_scale};
pub use jumps::Apart;
pub use odd::{OddView, OddViews};
use samples::{CoarseView, Reading, coarse_views};
use serde::Serialize;

/// Points that a view must be able to show before their agreement says anything.
const LEAST_SHOWN: usize = 200;
/// Agreement of the views of a state above which no mistake is searched. Exact and noisy captures of the project reach 0.92,
/// a focal length that is wrong by a fifth 0.78 at most.
const GOOD: f64 = 0.85;
/// Agreement above which no mistake is suspected either: thin things and drift of a right recording leave that much, and any factor
/// near 1 that makes up for the drift lets nearly all points agree. With focal lengths that are wrong by a tenth 0.86.
const PERFECT: f64 = 0.95;
/// A mistake is suspected if its correction leaves less than this share of the disagreement.
const LEFT: f64 = 0.3;
/// Agreement below which a capture is refused even if no usual mistake explains it. Poses of neighbouring views give 0.4; depth of
/// which every second image is 7 % too large, or poses of which half are those of other images, 0.5; a real recording with stated
/// poses that are off by 17 mm and 1.2 degrees 0.82.
const REFUSED: f64 = 0.6;
/// Agreement below which the result is doubtful.
const DOUBTFUL: f64 = 0.75;
/// Share of images in both states, with different poses, above which files of one state were copied to the other.
const COPIED: f64 = 0.25;
/// Share of the surfaces at places that the other state shows that agree, below which the states agree nowhere: a capture is refused
/// before parts are searched. A larger share decides nothing: of a laptop that is closed in one state 22 % agree, of pairs of different
/// objects in one place 0 to 34 %.
const NOWHERE: f64 = 0.02;
/// Agreement between the states below which most of the object seems to have moved.
const LITTLE_ACROSS: f64 = 0.25;

/// Agreement of the views of one state.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StateConsistency {
    /// Share of depth points that are where other views show a surface, 0 to 1; none without depth in two views.
    pub agreement: Option<f64>,
    /// The usual mistake that explains a low agreement.
    pub cause: Option<Explained>,
    /// A usual mistake, too small to lower the agreement much, with whose correction nearly all points agree.
    pub suspected: Option<Explained>,
    /// True if all camera poses are the same.
    pub one_pose: bool,
    /// Views that contradict the others.
    pub odd: OddViews,
    /// Frames of a recording that a jump of the poses separates from the others.
    pub apart: Option<Apart>,
    /// Of a recording the stored depths per unit: remedies then name options. None for a state of a capture.
    #[serde(skip)]
    pub recorded: Option<f64>,
}

/// A mistake with the agreement after its correction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Explained {
    /// What is probably wrong.
    pub cause: Cause,
    /// Agreement if it is corrected, 0 to 1.
    pub agreement: f64,
}

/// Agreement within and between the states of a capture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Consistency {
    /// Views of each state.
    #[serde(with = "artgs_core::state::array")]
    pub states: PerState<StateConsistency>,
    /// Share of the depth points of one state that are where the other shows a surface, 0 to 1; none without depth.
    pub across: Option<f64>,
    /// The same of the points at places that the other state shows, those that it hides left out; each point counts once. None
    /// without depth, and where [`Self::across`] is not low.
    pub across_shown: Option<f64>,
    /// Factor of the end state's poses and depths with which the states agree.
    pub end_scale: Option<Explained>,
    /// Share of the images of the end state that are those of the start state with other poses, 0 to 1.
    pub copied: f64,
}

/// What a consistency check found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Finding {
    /// The capture cannot be used as it is.
    Refused(String),
    /// The result may be wrong.
    Warning(String),
}

/// Checks the frames of a recording of one state, in the order of their time. Frames without depth are ignored, and those that a
/// jump of the poses separates from the others are not compared with them.
pub fn check_recording<'v>(frames: impl Iterator<Item = &'v View> + Clone) -> StateConsistency {
    let apart = Apart::find(frames.clone());
    let is_apart = |view: &View| apart.as_ref().is_some_and(|a| a.names.contains(&view.name));
    let recorded = frames.clone().find_map(|view| view.depth.as_ref()).map_or(1.0, |depth| f64::from(depth.per_unit()));
    let connected = frames.filter(|view| !is_apart(view));
    let found = check_state(&coarse_views(connected.clone()), connected);
    StateConsistency { apart, recorded: Some(recorded), ..found }
}

/// Checks both states and whether they show one object in one frame.
pub fn check_capture(capture: &Capture) -> Consistency {
    let views = capture.states.as_ref().map(|s| coarse_views(s.train.iter()));
    let states = PerState::from_fn(|s| check_state(&views[s], capture.states[s].train.iter()));
    let mut out = Consistency {
        states,
        across: None,
        across_shown: None,
        end_scale: None,
        copied: twins::copied_images(capture),
    };
    let sound = |s: &StateConsistency| {
        s.agreement.is_some_and(|share| share >= REFUSED) && s.cause.is_none() && !s.one_pose && !s.odd.are_noise()
    };
    if !out.states.iter().all(sound) {
        return out;
    }
    let both = between(&views, Reading::STATED);
    out.across = (both.all() >= LEAST_SHOWN).then(|| both.share_of_all());
    if out.across.is_some_and(|a| a < LITTLE_ACROSS) {
        out.end_scale = likely_scale(&views, both.share_of_all());
        out.across_shown = least_vote(&views);
    }
    out
}

/// What makes it doubtful that two recordings that were aligned show the same object; the search for parts decides. Points count once, by
/// what most views of the other state show: of right recordings 1 to 75 % agree (a thin arm of which most moves 1 %), of those of different
/// objects 0 to 15 %.
pub fn check_aligned(capture: &Capture) -> Option<String> {
    let views = capture.states.as_ref().map(|s| coarse_views(s.train.iter()));
    let share = least_vote(&views).filter(|share| *share < LITTLE_ACROSS)?;
    Some(format!(
        "{} of the object's surfaces agree between the two recordings: most of the object moved, or the recordings show different objects, \
         or what was selected is not the same in both (--box selects it)",
        percent(share)
    ))
}

/// Share of the points of one state at places that the other shows that agree, each counted once; of both states the smaller share.
fn least_vote(views: &PerState<Vec<CoarseView>>) -> Option<f64> {
    let (a, b) = (&views[State::START][..], &views[State::END][..]);
    // Of a small object that lies within a large one, the large one hides every point.
    let shares = [votes(a, b), votes(b, a)].into_iter().filter(|v| v.shown() >= LEAST_SHOWN).map(|v| v.share());
    shares.min_by(f64::total_cmp)
}

/// Agreement of both states with each other, the end state under a reading.
fn between(views: &PerState<Vec<CoarseView>>, end: Reading) -> Agreement {
    let (a, b) = (&views[State::START][..], &views[State::END][..]);
    let (there, back) = (agreement(a, b, [Reading::STATED, end]), agreement(b, a, [end, Reading::STATED]));
    // The smaller share: a small object that lies within a large one agrees one way only.
    if there.share_of_all() < back.share_of_all() { there } else { back }
}

/// Checks some views of a state with each other, and all of them with those.
fn check_state<'v>(views: &[CoarseView], all: impl Iterator<Item = &'v View> + Clone) -> StateConsistency {
    let one_pose = one_pose(all.clone());
    let stated = agreement(views, views, [Reading::STATED; 2]);
    let odd = if one_pose || views.len() < 2 { OddViews::default() } else { OddViews::find(all, views) };
    if views.len() < 2 || stated.all() < LEAST_SHOWN {
        return StateConsistency { one_pose, odd, ..StateConsistency::default() };
    }
    let share = if stated.shown() < LEAST_SHOWN { stated.share_of_all() } else { stated.share() };
    let cause = if share < GOOD && !one_pose { likely_cause(views, stated, GAIN) } else { None };
    let search = (GOOD..PERFECT).contains(&share) && !one_pose;
    let suspected = if search { likely_cause(views, stated, (1.0 - LEFT) * (1.0 - share)) } else { None };
    StateConsistency { agreement: Some(share), cause, suspected, one_pose, odd, apart: None, recorded: None }
}

/// True if several views have the same pose, which a moving camera never has.
fn one_pose<'v>(views: impl Iterator<Item = &'v View>) -> bool {
    let mut poses = views.map(|v| v.camera.world_to_camera);
    let Some(first) = poses.next() else { return false };
    let mut others = 0;
    poses.all(|p| {
        others += 1;
        p.translation.distance(first.translation) < 1e-9
            && (p.rotation * first.rotation.inverse()).w.abs() > 1.0 - 1e-12
    }) && others > 0
}

impl StateConsistency {
    /// What is wrong with the views of `whose` recording or state.
    pub fn findings(&self, whose: &str) -> Vec<Finding> {
        let jump = self.apart.iter().map(|apart| Finding::Warning(format!("{whose}: {}", apart.described())));
        jump.chain(self.findings_of_connected(whose)).collect()
    }

    /// What is wrong with the views that no jump of the poses separates.
    fn findings_of_connected(&self, whose: &str) -> Vec<Finding> {
        if self.one_pose {
            return vec![Finding::Refused(format!(
                "{whose}: all camera poses are the same; write the pose of every image (camera-to-world)"
            ))];
        }
        if self.odd.are_noise() {
            return vec![Finding::Refused(format!(
                "{whose}: neighbouring depths have no surface in common in {}; check that the depth images are 16-bit distances",
                self.odd.described()
            ))];
        }
        let Some(share) = self.agreement else { return Vec::new() };
        let stated = format!("{whose}: {} of the depth points agree between views", percent(share));
        let suspected = self
            .suspected
            .map(|explained| Finding::Warning(format!("{stated}; {}", explained.sentence(self.recorded))));
        let mut out = match self.cause {
            Some(explained) => vec![Finding::Refused(format!("{stated}; {}", explained.sentence(self.recorded)))],
            None if share < REFUSED || self.odd.are_too_many() => vec![Finding::Refused(format!(
                "{stated}, and no usual mistake explains it: check that poses, depth and images belong together"
            ))],
            None if !self.odd.views.is_empty() => vec![Finding::Warning(format!(
                "{whose}: pose or depth contradicts the other views in {}; they are ignored",
                self.odd.described()
            ))],
            None if share < DOUBTFUL => {
                vec![Finding::Warning(format!("{stated}: poses or depth are inaccurate, and so will be the result"))]
            }
            None => Vec::new(),
        };
        out.extend(suspected);
        out
    }

    /// True if the view of this name is to be ignored.
    pub fn ignores(&self, name: &str) -> bool {
        let is_odd = || !self.odd.are_too_many() && self.odd.views.iter().any(|view| view.name == name);
        let is_apart = || self.apart.as_ref().is_some_and(|apart| apart.names.iter().any(|n| n == name));
        self.cause.is_none() && is_odd() || is_apart()
    }

    /// True if the same mistake was found, where there is one.
    fn is_wrong_like(&self, other: &Self) -> bool {
        let alike = match (self.cause, other.cause) {
            (Some(own), Some(other)) => own.cause.is_like(&other.cause),
            // Single views are named per state.
            (None, None) => {
                let refused = |s: &Self| matches!(s.findings("")[..], [Finding::Refused(_)]);
                self.odd.are_noise() == other.odd.are_noise() && refused(self) && refused(other)
            }
            _ => false,
        };
        alike && self.one_pose == other.one_pose
    }
}

impl Explained {
    /// `recorded`: the stored depths per unit of a recording.
    fn sentence(&self, recorded: Option<f64>) -> String {
        let question = self.cause.question(recorded.is_some(), recorded);
        format!("{} it would be {}: {question}", self.cause.changed(), percent(self.agreement))
    }
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

impl Consistency {
    /// What is wrong, the states first.
    pub fn findings(&self) -> Vec<Finding> {
        let [start, end] = [&self.states[State::START], &self.states[State::END]];
        let wrong = |s: &StateConsistency| !s.findings("").is_empty();
        let mut out = if wrong(start) && wrong(end) && start.is_wrong_like(end) {
            start.findings("both states")
        } else {
            [start.findings("the start state"), end.findings("the end state")].concat()
        };
        if self.copied > COPIED {
            out.push(Finding::Refused(format!(
                "{} of the images of the end state are images of the start state with other poses: its files were copied from there",
                percent(self.copied)
            )));
        }
        let Some(across) = self.across else { return out };
        let stated = format!("{} of the surfaces agree between the two states", percent(across));
        if let Some(explained) = self.end_scale {
            out.push(Finding::Refused(format!("{stated}; {}", explained.sentence(None))));
        } else if self.across_shown.is_some_and(|share| share < NOWHERE) {
            out.push(Finding::Refused(format!(
                "{stated}, also where both are seen: they show different objects, or their poses are in different frames; recordings in \
                 frames of their own are aligned if they are given one by one: artgs reconstruct CLOSED OPEN -o OUT"
            )));
        } else if across < LITTLE_ACROSS {
            out.push(Finding::Warning(format!(
                "{stated}: most of the object moved, or what moved hides most of what rests; if neither is so, check that both states \
                 show one object in one frame"
            )));
        }
        out
    }
}

#[cfg(test)]
mod tests;
