//! What the stages of the published method decided, as sentences for people.

use super::trace::PublishedTrace;
use super::types::TypeConfig;
use crate::articulation::Trained;
use artgs_core::{PerState, Splats};

/// Part counts beyond this are not listed one by one.
const LISTED: usize = 12;

/// What the canonical start decided.
pub(super) fn start(trace: &PublishedTrace, single: &PerState<Splats>) -> String {
    let state = trace.source();
    let [start, end] = &trace.clusters;
    let sizes = (1..trace.centres.len()).map(|k| {
        let of_part = start.iter().chain(end).filter(|c| usize::from(c.1) == k).count();
        format!("part {k} {of_part}")
    });
    let (pairs, all, copied) = (trace.pairs.len(), single[state].len(), trace.copied.len());
    format!(
        "canonical start: {pairs} pairs matched; {copied} of the {all} Gaussians at the {} copied as static; moved: {} at \
         the start, {} at the end, in clusters: {}",
        state.name(),
        start.len(),
        end.len(),
        listed(sizes),
    )
}

/// Which parts turn; none if that was not decided.
pub(super) fn types(trace: &PublishedTrace, config: &TypeConfig) -> Option<String> {
    let angles = trace.types.last()?.half_angles_deg();
    let kind = |turns: &bool| if *turns { "revolute" } else { "prismatic" };
    let each = angles.iter().zip(&trace.turns).enumerate();
    let parts = each.map(|(k, (angle, turns))| format!("part {} {} ({angle:.1} degrees)", k + 1, kind(turns)));
    let limit = config.half_angle_deg;
    Some(format!("joint types, revolute where half the motion turns by more than {limit} degrees: {}", listed(parts)))
}

/// How many Gaussians every part has in the end.
pub(super) fn end(trained: &Trained) -> String {
    let count = |k: usize| trained.members(k).count();
    let parts = (0..=trained.joints.len()).map(|k| format!("part {k} {}", count(k)));
    format!("assignment: of {} Gaussians, {}", trained.splats.len(), listed(parts))
}

fn listed(items: impl Iterator<Item = String>) -> String {
    let all: Vec<String> = items.collect();
    let more = all.len().saturating_sub(LISTED);
    let mut text = all[..all.len() - more].join(", ");
    if more > 0 {
        text += &format!(" and {more} more");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::trace::TraceSample;
    use super::*;
    use artgs_core::Rigid;
    use glam::DVec3;

    #[test]
    fn sentences_have_the_numbers() {
        let mut single = Splats::empty(0);
        single.means = vec![[0.0; 3]; 9];
        let single = PerState::new(single.clone(), single);
        let turn = |degrees: f64| Rigid::about(DVec3::Z, DVec3::ZERO, f64::to_radians(degrees));
        let trace = PublishedTrace {
            state: 1,
            pairs: vec![[[0.0; 3]; 2]; 4],
            copied: vec![0, 1],
            clusters: [vec![(2, 1)], vec![(3, 2), (4, 2)]],
            centres: vec![[0.0; 3]; 3],
            types: vec![TraceSample { half_motions: vec![turn(31.0), turn(2.0)], ..TraceSample::default() }],
            turns: vec![true, false],
            ..PublishedTrace::default()
        };
        let text = start(&trace, &single);
        assert!(text.contains("4 pairs matched; 2 of the 9 Gaussians at the end copied as static"), "{text}");
        assert!(text.ends_with("1 at the start, 2 at the end, in clusters: part 1 1, part 2 2"), "{text}");
        let text = types(&trace, &TypeConfig::paper()).unwrap();
        assert!(text.ends_with("part 1 revolute (31.0 degrees), part 2 prismatic (2.0 degrees)"), "{text}");
        assert_eq!(types(&PublishedTrace::default(), &TypeConfig::paper()), None);
        assert_eq!(listed((0..14).map(|i| i.to_string())), "0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11 and 2 more");
    }
}
