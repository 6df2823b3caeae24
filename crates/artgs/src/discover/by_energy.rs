//! Parts that the rules missed: the energy of explanations searches their motions from what the rules found, and decides.

use super::refinement::{Parts, Refinement};
use super::{Cloud, Discovery};
use crate::explain::{ExplainSettings, Explanation, Problem, SearchSettings, Surfels};
use artgs_core::{PerState, Rigid};
use std::ops::RangeInclusive;

/// Parts with other motions than those found and a lower energy; none if there are none.
pub(super) fn with_parts_by_energy(
    found: &Discovery,
    (problem, coarse): (&mut Problem<'_>, &PerState<Cloud>),
    work: &Refinement<'_>,
    movable: &RangeInclusive<usize>,
    pool: &[Rigid],
    result: &dyn Fn(Parts) -> Discovery,
) -> Option<Discovery> {
    let (settings, search) = (ExplainSettings::DEFAULT, SearchSettings::default());
    let start = problem.explained(found, &search);
    let best = problem.searched(&start, pool, &search);
    if best.motions == start.motions || best.motions.is_empty() {
        return None;
    }
    // Bodies that move alike are parts, too.
    let total = |problem: &mut Problem<'_>, explanation: &Explanation, parts: usize| {
        problem.terms(explanation).total() + search.part * parts as f64
    };
    let least = total(problem, &start, found.parts.len());
    let by_rules = || result(work.parts(&best.motions, movable));
    let by_labels = || {
        let fine = ExplainSettings { spacing: 1.0, ..settings };
        let all = Surfels::new(work.scene, &fine);
        let mut fine = Problem::new(work.scene, &all, fine);
        let labels = fine.labels_like(coarse, &best.labels);
        let cut = fine.relabelled(&Explanation { labels, ..best.clone() });
        result(work.of_labels(&cut.motions, cut.labels, *movable.end()))
    };
    let mut is_better = |next: &Discovery| {
        let explanation = problem.explained(next, &search);
        movable.contains(&next.parts.len()) && total(problem, &explanation, next.parts.len()) < least
    };
    let next = by_rules();
    if is_better(&next) {
        return Some(next);
    }
    Some(by_labels()).filter(is_better)
}
