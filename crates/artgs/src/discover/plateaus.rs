//! Slides by the plateaus of the relief: a drawer's front is the outermost surface in both states, and the change of its height is the
//! length of its slide.

use super::Discovery;
use super::confidence::DOUBTFUL;
use super::refinement::{Parts, Refinement};
use super::relief::{Plateau, Relief};
use artgs_core::{JointEstimate, JointKind, Rigid};
use std::ops::RangeInclusive;

/// Parts that slide as the fronts of the object do, if these agree better with the heights of the fronts than what was `found`.
pub(super) fn with_plateaus(
    found: &Discovery,
    relief: &Relief,
    movable: &RangeInclusive<usize>,
    work: &Refinement<'_>,
    result: &dyn Fn(Parts) -> Discovery,
) -> Option<Discovery> {
    /// What a change must raise the sum of quality and agreement by.
    const WORTH: f64 = 0.02;
    /// Least share of the cells that what was found moves otherwise, unless there are fewer parts or more slides.
    const DISAGREED: f64 = 0.05;
    let plateaus = relief.plateaus();
    let total = work.evidence.total();
    let value = |of: &Discovery| of.quality(total) + relief.agreement(&plateaus, of);
    let mut best: Option<Discovery> = None;
    let mut sets = vec![turns_of(found, 0.0), turns_of(found, DOUBTFUL)];
    sets.dedup();
    let (given, mut next) = (sets.len(), 0);
    while let Some(turns) = sets.get(next) {
        next += 1;
        let Some(other) = explained_with(relief, turns, plateaus.clone(), movable, work, result) else { continue };
        // Turns that explain nothing beside the slides.
        let remaining = turns_of(&other, DOUBTFUL);
        if remaining.len() < sets.iter().map(Vec::len).min().unwrap_or_default() {
            sets.push(remaining);
        }
        let fewer = other.parts.len() < found.parts.len();
        let worth = if fewer { 0.0 } else { WORTH };
        let rises = relief.agreement(&plateaus, &other) > relief.agreement(&plateaus, found) + DISAGREED;
        // One part or a small turn may stand for several drawers: then the agreement does not rise.
        let more = count(found) < count(&other) && count(&other) <= plateaus.len();
        let agrees = more || (next <= given && (fewer || rises));
        let better = agrees && value(&other) > best.as_ref().map_or(value(found) + worth, value);
        if better && other.explained() >= KEPT * found.explained() {
            best = Some(other);
        }
    }
    let explained = |turns: &[Rigid]| explained_with(relief, turns, plateaus.clone(), movable, work, result);
    while let Some(other) = without_a_turn(best.as_ref().unwrap_or(found), &value, &explained) {
        best = Some(other);
    }
    best
}

/// Share of the explained points that must remain explained.
const KEPT: f64 = 0.9;

/// Number of slides.
fn count(of: &Discovery) -> usize {
    of.parts.iter().filter(|p| p.kind == JointKind::Prismatic).count()
}

/// The same slides without one of the turns, if that has a greater `value`: a turn can take what only one state shows of a drawer onto
/// what only the other state shows of another one, where their slides hide it. `explained` finds the parts of other turns.
fn without_a_turn(
    found: &Discovery,
    value: &dyn Fn(&Discovery) -> f64,
    explained: &dyn Fn(&[Rigid]) -> Option<Discovery>,
) -> Option<Discovery> {
    /// Turns that are tried without: each needs a refinement.
    const MOST: usize = 3;
    let turns = turns_of(found, 0.0);
    let but =
        |k: usize| -> Vec<Rigid> { turns.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, turn)| *turn).collect() };
    let is_better = |other: &Discovery| {
        other.parts.len() < found.parts.len()
            && count(other) == count(found)
            && value(other) > value(found)
            && other.explained() >= KEPT * found.explained()
    };
    let others = (0..turns.len().min(MOST)).filter_map(|k| explained(&but(k))).filter(is_better);
    others.max_by(|a, b| value(a).total_cmp(&value(b)))
}

/// The motions of the hinges and screws that have at least this confidence.
fn turns_of(found: &Discovery, least: f64) -> Vec<Rigid> {
    let turns = found.parts.iter().filter(|p| p.kind != JointKind::Prismatic);
    turns.filter(|p| p.confidence.is_some_and(|c| c >= least)).map(|p| p.motion).collect()
}

/// Parts that slide as `plateaus` do, and others that turn by `turns`; none if the plateaus are none, or too many.
fn explained_with(
    relief: &Relief,
    turns: &[Rigid],
    mut plateaus: Vec<Plateau>,
    movable: &RangeInclusive<usize>,
    work: &Refinement<'_>,
    result: &dyn Fn(Parts) -> Discovery,
) -> Option<Discovery> {
    /// A plateau of which a smaller share moves along is none of a front: a door may have turned there.
    const LEAST: f64 = 0.3;
    /// So is one whose points nearly all move onto other movable parts.
    const CONTESTED: f64 = 0.99;
    while !plateaus.is_empty() {
        let slides = slides(relief, &plateaus);
        let motions: Vec<Rigid> = slides.iter().chain(turns).copied().collect();
        let refined = work.refined_but(slides.len(), &motions);
        let found = result(divided(relief, refined, &slides, &plateaus, work));
        let count = plateaus.len();
        let is_contested = |plateau: &Plateau| {
            let slide = relief.slide(plateau.length).translation;
            let is_its = |part: &JointEstimate| {
                part.kind == JointKind::Prismatic && part.motion.translation.distance(slide) < relief.same()
            };
            let parts = found.parts.iter().zip(&found.support);
            parts.filter(|(part, _)| is_its(part)).any(|(_, support)| support.contested >= CONTESTED)
        };
        let agrees = |plateau: &Plateau| relief.agreement(std::slice::from_ref(plateau), &found) >= LEAST;
        plateaus.retain(agrees);
        if plateaus.len() == count {
            plateaus.retain(|plateau| !is_contested(plateau));
        }
        if plateaus.len() == count {
            return movable.contains(&found.parts.len()).then_some(found);
        }
    }
    None
}

/// Slides by the different lengths of plateaus, those of the largest ones first.
fn slides(relief: &Relief, plateaus: &[Plateau]) -> Vec<Rigid> {
    let mut lengths: Vec<f64> = Vec::new();
    for plateau in plateaus {
        if lengths.iter().all(|length| (length - plateau.length).abs() > relief.same()) {
            lengths.push(plateau.length);
        }
    }
    lengths.into_iter().map(|length| relief.slide(length)).collect()
}

/// Parts of which the first ones move by `slides`, with one part for each plateau: points go to the nearest one of the plateaus that
/// changed by about the length of their slide.
fn divided(relief: &Relief, mut found: Parts, slides: &[Rigid], plateaus: &[Plateau], work: &Refinement<'_>) -> Parts {
    let off = |plateau: &Plateau, i: &usize| slides[*i].translation.distance(relief.slide(plateau.length).translation);
    let nearest = |plateau: &Plateau| {
        (0..slides.len()).min_by(|a, b| off(plateau, a).total_cmp(&off(plateau, b))).unwrap_or_default()
    };
    let of_slide: Vec<usize> = plateaus.iter().map(nearest).collect();
    let mut parts_of: Vec<usize> = Vec::new();
    for (i, plateau) in plateaus.iter().enumerate() {
        let part = match of_slide[..i].contains(&of_slide[i]) {
            false => of_slide[i],
            true => {
                found.parts.push(JointEstimate::new(JointKind::Prismatic, slides[of_slide[i]]));
                found.parts.len() - 1
            }
        };
        found.parts[part].motion = relief.slide(plateau.length);
        parts_of.push(part);
    }
    for slide in 0..slides.len() {
        let own: Vec<usize> = (0..plateaus.len()).filter(|i| of_slide[*i] == slide).collect();
        if own.len() > 1 {
            let of = |i: &usize| &plateaus[*i];
            let parts: Vec<usize> = own.iter().map(|i| parts_of[*i]).collect();
            relief.distribute(slide, &own.iter().map(of).collect::<Vec<_>>(), &parts, &mut found.labels, work);
        }
    }
    for part in parts_of {
        found.parts[part].motion = relief.registered(part, &found, work);
    }
    work.aligned(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::test_scene::{cabinet_scene, with_refinement};
    use crate::discover::{DiscoverConfig, Support, discover};
    use glam::DVec3;

    /// Parts that slide and turn, which explain as many points.
    fn explaining(points: f64, kinds: &[JointKind]) -> Discovery {
        let part = |(k, kind): (usize, &JointKind)| {
            let motion = match kind {
                JointKind::Prismatic => Rigid::shift(DVec3::X * (k + 1) as f64),
                _ => Rigid::about(DVec3::Z, DVec3::ZERO, (k + 1) as f64),
            };
            JointEstimate { confidence: Some(0.8), ..JointEstimate::new(*kind, motion) }
        };
        let support = Support { moved: points, explained: 1.0, ..Support::default() };
        Discovery {
            parts: kinds.iter().enumerate().map(part).collect(),
            support: vec![support],
            ..Discovery::default()
        }
    }

    #[test]
    fn a_turn_that_slides_explain_as_well_is_removed() {
        use JointKind::{Prismatic, Revolute};
        let found = explaining(100.0, &[Prismatic, Revolute, Revolute]);
        let turns = turns_of(&found, 0.0);
        // Only the second turn is needed.
        let with = |points: f64, kinds: &'static [JointKind]| {
            let second = turns[1];
            move |left: &[Rigid]| (left == [second]).then(|| explaining(points, kinds))
        };
        let value = |worth: f64| move |of: &Discovery| if of.parts.len() == 2 { worth } else { 0.5 };
        let fewer: &[JointKind] = &[Prismatic, Revolute];
        let right = without_a_turn(&found, &value(0.6), &with(95.0, fewer)).unwrap();
        assert_eq!(right.parts.len(), 2);
        assert!(without_a_turn(&found, &value(0.4), &with(95.0, fewer)).is_none(), "worse");
        assert!(without_a_turn(&found, &value(0.6), &with(80.0, fewer)).is_none(), "explains less");
        // The plateau of an open door is no drawer.
        assert!(without_a_turn(&found, &value(0.6), &with(95.0, &[Prismatic, Prismatic])).is_none());
    }

    #[test]
    fn a_drawer_with_a_wrong_length_gets_the_length_of_its_front() {
        let scene = cabinet_scene(16, 96);
        let found = discover(&scene, 2..=2, &DiscoverConfig::default()).unwrap();
        with_refinement(&scene, |work| {
            let result =
                |parts: Parts| work.evidence.result(work.scene, work.clouds, parts, Vec::new(), &[], work.settings);
            let relief = Relief::of(work.front.unwrap(), work);
            let drawer = found.parts.iter().position(|p| p.kind == JointKind::Prismatic).unwrap();
            let truth = found.parts[drawer].motion.translation;
            let mut parts = found.parts.clone();
            parts[drawer].motion = Rigid::shift(truth * 0.6);
            let short = result(Parts { parts, labels: found.labels.clone() });
            let right = with_plateaus(&short, &relief, &(1..=4), work, &result).unwrap();
            assert_eq!(right.parts.len(), 2);
            let slide = right.parts.iter().find(|p| p.kind == JointKind::Prismatic).unwrap().motion.translation;
            assert!(slide.distance(truth) < 0.01 * found.diagonal, "{slide} {truth}");
            let hinge = |of: &Discovery| of.parts.iter().find(|p| p.kind == JointKind::Revolute).unwrap().motion;
            assert!((hinge(&found).inverse() * hinge(&right)).angle().to_degrees() < 1.0);
            // What agrees with the fronts stays, and so do parts that would be too many.
            assert!(with_plateaus(&found, &relief, &(1..=4), work, &result).is_none());
            assert!(with_plateaus(&short, &relief, &(1..=1), work, &result).is_none());
            // A plateau of which the points move onto other parts is none of a drawer.
            let contested = |mut found: Discovery, share: f64| {
                found.support.iter_mut().for_each(|support| support.contested = share);
                found
            };
            let with = |share: f64| {
                let result = |parts: Parts| contested(result(parts), share);
                with_plateaus(&contested(short.clone(), share), &relief, &(1..=4), work, &result)
            };
            assert!(with(0.5).is_some() && with(0.995).is_none());
        });
    }
}
