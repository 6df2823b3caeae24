//! Slides along the front of the object that take a part to what the other state shows.

use super::Discovery;
use super::exchanges::{costs_of, implausibility};
use super::front::Front;
use super::refinement::{Refinement, members_of_part};
use artgs_core::Rigid;

/// Distance between the lengths that are tried, spacings.
pub(super) const STEP: f64 = 0.5;

/// Slides along the front, start to end, by all lengths in both directions, the shortest one in the middle.
pub(super) fn all_lengths(front: Front, work: &Refinement<'_>) -> Vec<Rigid> {
    let lengths = &work.scene.lengths;
    let step = STEP * f64::from(lengths.spacing);
    let longest = f64::from(work.settings.candidates.poses.longest_slide * lengths.diagonal);
    let steps = (longest / step) as i32;
    (-steps..=steps).map(|i| Rigid::shift(front.direction.as_dvec3() * (f64::from(i) * step))).collect()
}

/// Slides along the front, start to end, that cost a part hardly more than its own motion, the cheapest one first. A turn by a
/// quarter takes the front of a drawer to one of its sides, and noise lets that fit nearly as well.
pub(super) fn front_slides(found: &Discovery, k: usize, work: &Refinement<'_>) -> Vec<Rigid> {
    /// Slides that are worth a refinement at most.
    const MOST: usize = 2;
    /// They cost at most this much more than its motion: the labels are those of that motion.
    const SLACK: f64 = 0.15;
    /// Least length, spacings.
    const LEAST: f64 = 2.0;
    let part = &found.parts[k];
    let Some(front) = work.front else { return Vec::new() };
    let members = members_of_part(&found.labels, k as u16 + 1);
    let judged = |motions: &[Rigid]| -> Vec<f64> {
        let costs = costs_of(motions, &members, work);
        costs.iter().zip(motions).map(|(cost, m)| cost + implausibility(&members, m, work)).collect()
    };
    let slides = all_lengths(front, work);
    let (own, costs) = (judged(&[part.motion])[0], judged(&slides));
    let is_long = |i: &usize| slides[*i].translation.length() > LEAST * found.spacing;
    let is_lowest = |i: &usize| costs[*i] <= costs[*i - 1] && costs[*i] < costs[*i + 1];
    let inner = 1..costs.len().saturating_sub(1);
    let mut best: Vec<usize> = inner.filter(is_lowest).filter(is_long).filter(|i| costs[*i] < own + SLACK).collect();
    best.sort_by(|a, b| costs[*a].total_cmp(&costs[*b]));
    best.into_iter().take(MOST).map(|i| slides[i]).collect()
}
