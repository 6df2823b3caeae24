//! Parts that the rules missed: the energy of explanations searches their motions from what the rules found, and decides.

use super::Discovery;
use super::refinement::{Parts, Refinement};
use crate::explain::{ExplainSettings, Explanation, Problem, SearchSettings, Surfels};
use std::ops::RangeInclusive;

/// Parts with other motions than those found and a lower energy; none if there are none.
pub(super) fn with_parts_by_energy(
    found: &Discovery,
    work: &Refinement<'_>,
    movable: &RangeInclusive<usize>,
    result: &dyn Fn(Parts) -> Discovery,
) -> Option<Discovery> {
    let (settings, search) = (ExplainSettings::DEFAULT, SearchSettings::default());
    let surfels = Surfels::new(work.scene, &settings);
    let mut problem = Problem::new(work.scene, &surfels, settings);
    let start = problem.explained(found, &search);
    let best = problem.searched(&start, &search);
    if best.motions == start.motions || best.motions.is_empty() {
        return None;
    }
    // Bodies that move alike are parts, too.
    let total = |problem: &mut Problem<'_>, explanation: &Explanation, parts: usize| {
        problem.terms(explanation).total() + search.part * parts as f64
    };
    let least = total(&mut problem, &start, found.parts.len());
    let by_rules = || result(work.parts(&best.motions, movable));
    let by_labels = || {
        let fine = ExplainSettings { spacing: 1.0, ..settings };
        let all = Surfels::new(work.scene, &fine);
        let mut problem = Problem::new(work.scene, &all, fine);
        let labels = problem.labels_like(&surfels.clouds, &best.labels);
        let cut = problem.relabelled(&Explanation { labels, ..best.clone() });
        result(work.of_labels(&cut.motions, cut.labels, *movable.end()))
    };
    let mut is_better = |next: &Discovery| {
        let explanation = problem.explained(next, &search);
        movable.contains(&next.parts.len()) && total(&mut problem, &explanation, next.parts.len()) < least
    };
    let next = by_rules();
    if is_better(&next) {
        return Some(next);
    }
    Some(by_labels()).filter(is_better)
}
