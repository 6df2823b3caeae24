//! The energy of explanations searches parts that the rules missed, from what they found or from motions of bodies.

use super::refinement::{Parts, Refinement};
use super::{Cloud, Discovery};
use crate::explain::{ExplainSettings, Explanation, Problem, SearchSettings, Surfels};
use artgs_core::{PerState, Rigid};
use std::ops::RangeInclusive;

/// Energy of an explanation with the price of the parts that were found, of which `alike` may move like others without a price.
fn total(problem: &mut Problem<'_>, explanation: &Explanation, parts: usize, alike: usize) -> f64 {
    let search = SearchSettings::default();
    let more = more_alike(parts, explanation.motions.len(), alike);
    problem.total(explanation, &search) + search.part * more as f64
}

/// Parts that move like another one, beyond `alike`: they cost as parts of their own. The energy does not see which bodies move alike, so fewer
/// of them save nothing.
fn more_alike(parts: usize, motions: usize, alike: usize) -> usize {
    parts.saturating_sub(motions + alike)
}

/// Parts with other motions than those found and a lower energy; none if there are none. The search starts from what was found or from parts that
/// move by `bodies`, whichever has the lower energy, and may add motions of `pool`.
pub(super) fn with_parts_by_energy(
    found: &Discovery,
    bodies: &[Rigid],
    (problem, coarse): (&mut Problem<'_>, &PerState<Cloud>),
    work: &Refinement<'_>,
    movable: &RangeInclusive<usize>,
    pool: &[Rigid],
    result: &dyn Fn(Parts) -> Discovery,
) -> Option<Discovery> {
    let (settings, search) = (ExplainSettings::DEFAULT, SearchSettings::default());
    let start = problem.explained(found, &search);
    let of_bodies = problem.started(bodies, &search);
    let is_lower = !bodies.is_empty() && problem.total(&of_bodies, &search) < problem.total(&start, &search);
    let best = problem.searched(if is_lower { &of_bodies } else { &start }, pool, &search);
    let lowest = problem.total(&best, &search);
    if best.motions.is_empty() || lowest > problem.total(&start, &search) - search.better {
        return None;
    }
    let alike = found.parts.len() - start.motions.len();
    let mut least = total(problem, &start, found.parts.len(), alike);
    let by_rules = || result(work.parts(&best.motions, movable));
    let by_labels = || {
        let fine = ExplainSettings { spacing: 1.0, ..settings };
        let all = Surfels::new(work.scene, &fine);
        let mut fine = Problem::new(work.scene, &all, fine);
        let labels = fine.labels_like(coarse, &best.labels);
        let cut = fine.relabelled(&Explanation { labels, ..best.clone() });
        result(work.of_labels(&cut.motions, cut.labels, *movable.end()))
    };
    // Both refinements lose some of what the search found: the rules parts that their thresholds refuse, the labels bodies that move alike.
    let mut better = None;
    let refinements: [&dyn Fn() -> Discovery; 2] = [&by_rules, &by_labels];
    for refined in refinements {
        let next = refined();
        let explanation = problem.explained(&next, &search);
        let energy = total(problem, &explanation, next.parts.len(), alike);
        if movable.contains(&next.parts.len()) && energy < least {
            (better, least) = (Some(next), energy);
        }
        if least < lowest + search.part {
            break;
        }
    }
    better
}

#[cfg(test)]
mod tests {
    use super::more_alike;

    #[test]
    fn separating_bodies_that_move_alike_costs_and_joining_them_saves_nothing() {
        // Of three parts two move alike.
        assert_eq!([5, 4, 3, 2].map(|parts| more_alike(parts, 2, 1)), [2, 1, 0, 0]);
        assert_eq!(more_alike(4, 4, 1), 0);
    }
}
