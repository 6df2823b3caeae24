//! Parts that the rules missed: the energy of explanations searches their motions from what the rules found, and decides.

use super::Discovery;
use super::refinement::{Parts, Refinement};
use crate::explain::{ExplainSettings, Explanation, Problem, SearchSettings, Surfels, numbers};
use std::ops::RangeInclusive;

/// What was found, or parts with other motions whose energy is lower.
pub(super) fn with_parts_by_energy(
    found: Discovery,
    work: &Refinement<'_>,
    movable: &RangeInclusive<usize>,
    result: &dyn Fn(Parts) -> Discovery,
) -> Discovery {
    let (settings, search) = (ExplainSettings::DEFAULT, SearchSettings::default());
    let surfels = Surfels::new(work.scene, &settings);
    let mut problem = Problem::new(work.scene, &surfels, settings);
    let start = explained(&mut problem, &found, &search);
    let best = problem.searched(&start, &[], &search);
    if best.motions == start.motions || best.motions.is_empty() {
        return found;
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
    let tries: [&dyn Fn() -> Discovery; 2] = [&by_rules, &by_labels];
    for next in tries {
        let next = next();
        let explanation = explained(&mut problem, &next, &search);
        if movable.contains(&next.parts.len()) && total(&mut problem, &explanation, next.parts.len()) < least {
            return next;
        }
    }
    found
}

/// The explanation of what was found.
fn explained(problem: &mut Problem<'_>, found: &Discovery, settings: &SearchSettings) -> Explanation {
    let explanation = Explanation {
        motions: found.parts.iter().map(|p| p.motion).collect(),
        numbers: found.parts.iter().map(|p| numbers(p.kind)).collect(),
        labels: problem.labels_like(&found.clouds, &found.labels),
    };
    problem.settled(&explanation, settings)
}
