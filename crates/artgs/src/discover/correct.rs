//! Parts as a user corrects them: some added, moved, deleted, merged or split, joints given.

mod mark;
mod split;

use super::candidates::Candidate;
use super::config::StepSettings;
use super::joints::JointFit;
use super::parents::Numbering;
use super::refinement::{Parts, Refinement, points_of_part};
use super::{DiscoverConfig, DiscoverError, Discovery, Evidence, Scene, with_intervals};
use crate::explain::{ExplainSettings, Problem, Surfels};
use artgs_core::{JointAlternative, JointEstimate, JointKind, Rigid, State};
use artgs_io::{CentreEdit, Corrections};
use glam::{DVec3, Vec3};
use split::Split;

/// Why corrections cannot be applied.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CorrectError {
    /// They name a part that does not exist.
    #[error(
        "corrections.json names part {part}, but there are parts 1 to {count}; they are numbered as they were found, added ones last"
    )]
    NoSuchPart {
        /// As the file says.
        part: usize,
        /// Movable parts found or added until then.
        count: usize,
    },
    /// Nothing that moves was found where a part was added.
    #[error(
        "corrections.json adds a part at {position:?}, but no motion explains what is there; put its centre on a part that moved"
    )]
    NothingThere {
        /// As the file says.
        position: [f64; 3],
    },
    /// Nothing is on one side of a cut.
    #[error(
        "corrections.json splits part {part}, but all of its points are on one side; move the plane, or choose other points"
    )]
    NothingSplit {
        /// As the file says.
        part: usize,
    },
    /// No part remains.
    #[error("corrections.json deletes every movable part")]
    NothingLeft,
    /// Parts cannot be found at all.
    #[error(transparent)]
    Discover(#[from] DiscoverError),
}

/// A part while corrections are applied.
#[derive(Clone, Copy)]
struct Kept {
    /// Number in what was found; added ones have the next.
    number: usize,
    motion: Rigid,
}

/// Distance up to which a position is on a part, fraction of the diagonal.
const ON_PART: f32 = 0.1;
/// Radius of the Gaussian window around a position in which a motion must explain points, fraction of the diagonal.
const WINDOW: f32 = 0.12;
/// Least weighted points in that window.
const LEAST_WEIGHT: f32 = 12.0;
/// Motions that differ by less around a position are the same, spacings.
const SAME_MOTION: f32 = 2.0;

/// What was found, corrected: edits in their order, then points are labelled and parts registered again. Parts keep their
/// order; added ones come last. A part moved to where its points are not stands for another one at that place.
pub fn correct(
    scene: &Scene,
    found: &Discovery,
    corrections: &Corrections,
    config: &DiscoverConfig,
) -> Result<Discovery, CorrectError> {
    let clouds = scene.indexed_clouds();
    let settings = StepSettings::default();
    let evidence = Evidence::new(scene, &settings)?;
    let needs_motion = |e: &CentreEdit| matches!(e, CentreEdit::Add { .. } | CentreEdit::Move { .. });
    let wanted = found.parts.len() + 2;
    let pool = match corrections.centres.iter().any(needs_motion) {
        true => evidence.candidates(scene, &clouds, &(wanted..=wanted), config, &settings),
        false => Vec::new(),
    };
    let mut kept: Vec<Kept> =
        found.parts.iter().enumerate().map(|(k, p)| Kept { number: k + 1, motion: p.motion }).collect();
    let mut split = Split::default();
    // Parts found and added so far.
    let mut count = found.parts.len();
    for edit in &corrections.centres {
        match edit {
            CentreEdit::Delete { part } => {
                let part = checked(*part, count)?;
                if !split.delete(part) {
                    kept.retain(|k| k.number != part);
                }
            }
            CentreEdit::Merge { part, into } => {
                let (part, into) = (checked(*part, count)?, checked(*into, count)?);
                if !split.merge(part, into) {
                    kept.retain(|k| k.number != part);
                }
            }
            CentreEdit::Add { position } => {
                let motion = motion_at(scene, &pool, *position, &kept)?;
                count += 1;
                kept.push(Kept { number: count, motion });
            }
            CentreEdit::Split { part, plane, points } => {
                let part = checked(*part, count)?;
                count += 1;
                split.cut(part, count, plane.as_ref(), points);
            }
            CentreEdit::Move { part, position } => {
                let part = checked(*part, count)?;
                if part > found.parts.len() || !is_on_part(found, part, *position) {
                    let others: Vec<Kept> = kept.iter().copied().filter(|k| k.number != part).collect();
                    let motion = motion_at(scene, &pool, *position, &others)?;
                    if !split.start(part, motion) {
                        kept.iter_mut().filter(|k| k.number == part).for_each(|k| k.motion = motion);
                    }
                }
            }
        }
    }
    for mark in &corrections.joints {
        checked(mark.part, count)?;
        let Some(joint) = &mark.joint else { continue };
        let found_motion = kept.iter().find(|k| k.number == split.root(mark.part)).map(|k| k.motion);
        let before = found_motion.unwrap_or(Rigid::IDENTITY);
        let motion = mark::motion(mark.kind, joint, found, split.root(mark.part), &before);
        if !split.start(mark.part, motion) {
            kept.iter_mut().filter(|k| k.number == mark.part).for_each(|k| k.motion = motion);
        }
    }
    let kind = |part: usize| corrections.joints.iter().find(|mark| mark.part == part).map(|mark| mark.kind);
    // The kind of a part that is split may be that of one piece only.
    let kinds: Vec<Option<JointKind>> =
        kept.iter().map(|k| kind(k.number).filter(|_| !split.concerns(k.number))).collect();
    let motions: Vec<Rigid> = kept.iter().map(|k| k.motion).collect();
    let front = evidence.front(scene, &clouds, &settings);
    let refinement =
        Refinement { scene, clouds: &clouds, evidence: &evidence, config, settings: &settings, front, begun: &|| () };
    // Corrections and the page name parts by their numbers.
    let Parts { parts, labels } = refinement.refined_as(&motions, 0, &kinds, Numbering::Kept);
    let numbers: Vec<usize> = kept.iter().map(|k| k.number).collect();
    let pieces = split.apply(&clouds, &numbers, &parts, labels)?;
    if pieces.numbers.is_empty() {
        return Err(CorrectError::NothingLeft);
    }
    // Pieces are registered on their own points and not labelled again: equal motions would mix their points.
    let fit = JointFit::new(scene, None, &settings.joints, config, true);
    let refined = |(k, number): (usize, &usize)| match pieces.starts[k] {
        None => parts[numbers.iter().position(|n| n == number).unwrap_or_default()],
        Some(start) => {
            let own = points_of_part(&clouds, &pieces.labels, k as u16 + 1);
            fit.decide(&JointEstimate::new(JointKind::Screw, start), &own, kind(*number)).joint
        }
    };
    let parts: Vec<JointEstimate> = pieces.numbers.iter().enumerate().map(refined).collect();
    let alternatives = pieces.numbers.iter().map(|part| untouched(found, corrections, *part)).collect();
    let corrected =
        evidence.result(scene, &clouds, Parts { parts, labels: pieces.labels }, Vec::new(), &pool, &settings);
    let surfels = Surfels::new(scene, &ExplainSettings::DEFAULT);
    let problem = Problem::new(scene, &surfels, ExplainSettings::DEFAULT);
    Ok(with_intervals(Discovery { alternatives, ..corrected }, &problem))
}

/// Alternatives of a part as they were found; none for one whose points or joint are corrected.
fn untouched(found: &Discovery, corrections: &Corrections, part: usize) -> Vec<JointAlternative> {
    let named = |e: &CentreEdit| match e {
        CentreEdit::Merge { part: other, into } => part == *other || part == *into,
        CentreEdit::Move { part: other, .. } | CentreEdit::Split { part: other, .. } => part == *other,
        CentreEdit::Add { .. } | CentreEdit::Delete { .. } => false,
    };
    let decided = corrections.joints.iter().any(|mark| mark.part == part);
    let found = found.alternatives.get(part - 1).filter(|_| !decided && !corrections.centres.iter().any(named));
    found.cloned().unwrap_or_default()
}

/// The part number if there are so many parts.
fn checked(part: usize, count: usize) -> Result<usize, CorrectError> {
    if part <= count { Ok(part) } else { Err(CorrectError::NoSuchPart { part, count }) }
}

/// True if a position is near a part's points at the start.
fn is_on_part(found: &Discovery, part: usize, position: [f64; 3]) -> bool {
    let at = DVec3::from_array(position).as_vec3();
    let points = found.clouds[State::START].points.iter().zip(&found.labels[State::START]);
    let own = points.filter(|(_, label)| usize::from(**label) == part);
    own.map(|(p, _)| p.distance(at)).fold(f32::INFINITY, f32::min) < ON_PART * found.diagonal as f32
}

/// The candidate that explains most of what moved around a position, other than the motions of `taken` parts.
fn motion_at(scene: &Scene, pool: &[Candidate], position: [f64; 3], taken: &[Kept]) -> Result<Rigid, CorrectError> {
    let at = DVec3::from_array(position).as_vec3();
    let reach = WINDOW * scene.lengths.diagonal;
    let weight = |c: &Candidate| -> f32 {
        let near = |s: State, centre: Vec3| -> f32 {
            let points = &scene.states[s].cloud.points;
            let distances = c.explained[s].iter().map(|&i| points[i].distance(centre));
            distances.map(|d| (-0.5 * (d / reach) * (d / reach)).exp()).sum()
        };
        // At the end the part is where the candidate takes the position.
        let at_end = c.motion.apply(at.as_dvec3()).as_vec3();
        (near(State::START, at) + near(State::END, at_end)) * (1.0 - c.implausibility)
    };
    let alike = |c: &Candidate| {
        let gap = |k: &Kept, x: Vec3| k.motion.apply(x.as_dvec3()).distance(c.motion.apply(x.as_dvec3()));
        let around = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|d| at + d * reach);
        let same = f64::from(SAME_MOTION * scene.lengths.spacing);
        taken.iter().any(|k| around.iter().all(|x| gap(k, *x) < same))
    };
    let best = pool.iter().filter(|c| !alike(c)).map(|c| (weight(c), c)).max_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|b| b.0 > LEAST_WEIGHT).map(|b| b.1.motion).ok_or(CorrectError::NothingThere { position })
}
