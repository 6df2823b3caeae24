//! How far a result is right: number of parts, types, parents, and every joint.

use super::overlap::pairs;
use super::row::{JointRow, Row};
use super::truth::{diagonal, middle};
use artgs::discover::Discovery;
use artgs::evaluate::axis_angle_deg;
use artgs_core::{Joint, JointEstimate, JointKind, Mesh, State};
use artgs_io::{GroundTruth, RunFolder};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Largest angle between the axes of a correct joint, degrees.
pub(super) const AXIS_DEG: f64 = 5.0;
/// Largest error of the place of a correct joint as a share of the diagonal of its part, and of its motion as a share of the true
/// motion. A motion is also correct if it moves no point of the part farther from its true place than this share of the
/// diagonal, which is the laxer condition for small motions.
pub(super) const SHARE: f64 = 0.05;
/// From this confidence on, a wrong joint is no answer to an undecidable object.
pub(super) const CERTAIN: f64 = 0.9;

/// The parts that a run found. After a whole run, their joints are those of the replica. None if there is no result.
pub(super) fn result_of(run: &RunFolder) -> Result<Option<Discovery>, String> {
    let Some(mut found) = artgs::run::found_parts(run) else { return Ok(None) };
    if !run.has_replica() {
        return Ok(Some(found));
    }
    let replica = artgs_io::read_replica(run.root()).map_err(|e| e.to_string())?;
    if replica.parts.len() == found.parts.len() + 1 {
        for (index, part) in found.parts.iter_mut().enumerate() {
            let Some(joint) = replica.joint(index + 1) else { continue };
            let parent = replica.parts[index + 1].parent.unwrap_or(0);
            let confidence = replica.parts[index + 1].confidence;
            let motion = replica.world_motion(index + 1);
            *part = JointEstimate { kind: joint.kind, motion, parent, confidence, ..*part };
        }
    }
    Ok(Some(found))
}

/// Fills in everything about the found parts. `overlaps[found][true]` are the intersections over unions of movable parts;
/// `decidable` of the row is read.
pub(super) fn score(row: &mut Row, found: &Discovery, truth: &GroundTruth, overlaps: &[Vec<f64>]) {
    let (parts, truths) = (found.parts.len(), truth.joints.len());
    let pairs = pairs(overlaps, truths);
    let paired = pairs.iter().flatten().count();
    row.parts_true = truths as u32;
    row.parts_found = parts as u32;
    row.missing = (truths - paired) as u32;
    row.extra = (parts - paired) as u32;
    row.count_right = row.missing == 0 && row.extra == 0;
    row.joints = (0..parts).map(|k| joint_row(found, truth, overlaps, &pairs, k)).collect();
    row.types_right = row.count_right && row.joints.iter().all(|joint| joint.kind == joint.kind_true);
    row.parents_right = row.count_right && (0..parts).all(|k| has_true_parent(found, truth, &pairs, k));
    row.right = row.types_right && row.parents_right;
    if !row.decidable && row.parents_right && (0..parts).all(|k| has_true_type(found, truth, &pairs, k)) {
        let certain = |joint: &JointRow| joint.confidence.is_some_and(|confidence| confidence > CERTAIN);
        row.right |= !row.joints.iter().any(|joint| certain(joint) && !joint.correct);
    }
    row.joints_right = row.right && row.joints.iter().all(|joint| joint.correct);
    row.warnings = found.warnings.len() as u32;
}

/// The true type is that of the joint or of one of its alternatives.
fn has_true_type(found: &Discovery, truth: &GroundTruth, pairs: &[Option<usize>], k: usize) -> bool {
    let Some(kind) = pairs[k].map(|j| truth.joints[j].kind) else { return false };
    let others = found.alternatives.get(k).map_or(&[][..], Vec::as_slice);
    found.parts[k].kind == kind || others.iter().any(|other| other.kind == kind)
}

/// The parent of the found part is the part that covers the true parent.
fn has_true_parent(found: &Discovery, truth: &GroundTruth, pairs: &[Option<usize>], k: usize) -> bool {
    pairs[k].is_some_and(|j| true_carrier(truth, pairs, j) == Some(found.parts[k].parent))
}

/// The found part that covers the true parent of part `j`, 0 for the static part; none if no part covers it.
fn true_carrier(truth: &GroundTruth, pairs: &[Option<usize>], j: usize) -> Option<usize> {
    match truth.parents.get(j).copied().flatten() {
        None => Some(0),
        Some(parent) => pairs.iter().position(|pair| *pair == Some(parent)).map(|k| k + 1),
    }
}

fn joint_row(
    found: &Discovery,
    truth: &GroundTruth,
    overlaps: &[Vec<f64>],
    pairs: &[Option<usize>],
    k: usize,
) -> JointRow {
    let part = &found.parts[k];
    let row = JointRow { kind: part.kind.name().into(), confidence: part.confidence, ..JointRow::default() };
    let Some(j) = pairs[k] else {
        let overlap = overlaps[k].iter().copied().fold(0.0, f64::max);
        return JointRow { overlap, ..row };
    };
    let (target, mesh) = (&truth.joints[j], &truth.movable[j][State::START]);
    let row = JointRow { truth: Some(j as u32), kind_true: target.kind.name().into(), overlap: overlaps[k][j], ..row };
    if part.kind != target.kind {
        return row;
    }
    // Against the true parent where it was found: a wrong parent is counted elsewhere.
    let carrier = true_carrier(truth, pairs, j).filter(|carrier| *carrier != k + 1);
    let against = JointEstimate { parent: carrier.unwrap_or(part.parent), ..*part };
    let errors = Errors::of(&against.joint_near(&found.parts, middle(mesh)), target, mesh);
    let finite = |number: f64| Some(number).filter(|number| number.is_finite());
    let of = |error: f64, half: Option<f64>| half.and_then(|half| finite(error / half));
    let interval = part.interval;
    JointRow {
        axis_of_interval: of(errors.axis_deg, interval.map(|i| i.axis_deg)),
        position_of_interval: errors.apart.and_then(|apart| of(apart, interval.and_then(|i| i.position))),
        motion_of_interval: of(errors.change, interval.map(|i| i.motion)),
        axis_deg: finite(errors.axis_deg),
        position: errors.position.and_then(finite),
        motion: finite(errors.motion),
        correct: errors.are_small(),
        ..row
    }
}

/// Errors of a joint of the true type.
#[derive(Clone, Copy, Debug)]
struct Errors {
    /// Angle between the axes as lines, degrees.
    axis_deg: f64,
    /// Distance of the axes where the part is, scene units; none of slides.
    apart: Option<f64>,
    /// The same as a share of the diagonal of the part.
    position: Option<f64>,
    /// Error of the motion: radians, of slides scene units.
    change: f64,
    /// Error of the motion as a share of the true one; of screws the larger one of turn and slide.
    motion: f64,
    /// The distance by which the error of the motion moves the part, as a share of its diagonal.
    moved: f64,
}

impl Errors {
    fn of(found: &Joint, truth: &Joint, part: &Mesh) -> Self {
        let size = diagonal(part);
        let sign = if found.axis.dot(truth.axis) < 0.0 { -1.0 } else { 1.0 };
        let (own, wanted) = (sign * change(found), change(truth));
        let slides =
            |joint: &Joint, change: f64| if joint.kind == JointKind::Screw { joint.pitch * change } else { 0.0 };
        let (motion, change, moved) = match truth.kind {
            JointKind::Prismatic => ((own - wanted).abs() / wanted.abs(), (own - wanted).abs(), (own - wanted).abs()),
            JointKind::Revolute | JointKind::Screw => {
                let turn = wrapped(own - wanted);
                let (slide, true_slide) = (slides(found, own), slides(truth, wanted));
                let off = (slide - true_slide).abs();
                let share = if true_slide == 0.0 { 0.0 } else { off / true_slide.abs() };
                let moved = (2.0 * arm(truth, part) * (0.5 * turn).sin()).hypot(off);
                ((turn / wanted.abs()).max(share), turn, moved)
            }
        };
        let place = truth.with_origin_near(middle(part)).origin;
        let apart = (place - found.origin).reject_from(found.axis.normalize_or(DVec3::Z)).length();
        let apart = (truth.kind != JointKind::Prismatic).then_some(apart);
        let (axis_deg, position) = (axis_angle_deg(found.axis, truth.axis), apart.map(|apart| apart / size));
        Self { axis_deg, apart, position, change, motion, moved: moved / size }
    }

    /// The definition of a correct joint.
    fn are_small(&self) -> bool {
        self.axis_deg <= AXIS_DEG
            && self.position.is_none_or(|position| position <= SHARE)
            && (self.motion <= SHARE || self.moved <= SHARE)
    }
}

/// Value at the end minus value at the start.
fn change(joint: &Joint) -> f64 {
    joint.state_values[State::END] - joint.state_values[State::START]
}

/// Size of an angle, at most half a circle: turns that end at the same place are the same.
fn wrapped(angle: f64) -> f64 {
    let rest = angle.rem_euclid(TAU);
    if rest > PI { TAU - rest } else { rest }
}

/// Largest distance of a part from the axis of its joint.
fn arm(joint: &Joint, part: &Mesh) -> f64 {
    let axis = joint.axis.normalize_or(DVec3::Z);
    let distance = |v: &[f32; 3]| (DVec3::from_array(v.map(f64::from)) - joint.origin).reject_from(axis).length();
    part.vertices.iter().map(distance).fold(0.0, f64::max)
}

#[cfg(test)]
#[path = "score_tests.rs"]
mod tests;
