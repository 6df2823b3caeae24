//! What contradicts an explanation: surface that the found motions take to where the other state shows empty space. A place that
//! the other state hides says nothing.

use super::scene::Scene;
use super::visibility::{Occupancy, ViewVotes};
use super::{DiscoverConfig, DiscoverError, Discovery, Evidence};
use artgs_core::State;
use glam::Vec3;

/// What was found, if it explains enough of what the states show, or if the joints are sure of most of what moved, with a warning: thin
/// parts show different sides in the two states. Otherwise the states are refused.
pub(super) fn explaining_enough(
    mut found: Discovery,
    evidence: &Evidence,
    scene: &Scene,
    config: &DiscoverConfig,
) -> Result<Discovery, DiscoverError> {
    let resting = resting(&found);
    if resting < config.least_resting {
        return Err(DiscoverError::NothingRests(resting));
    }
    let unexplained = unexplained(&found, evidence);
    let share = if scene.spreading { unexplained } else { unexplained.max(contradicted(&found, scene)) };
    if share > config.most_unexplained {
        if found.quality(evidence.total()) < config.sure_quality {
            return Err(DiscoverError::Unexplained(share));
        }
        found.warnings.push(format!(
            "{:.0} % of all surfaces differ between the two states and no motion explains them, although joints were found: look at the \
             parts, and check that both states show the same object",
            100.0 * share
        ));
    }
    Ok(found)
}

/// Share of the points of a state that are of the static part; of both states the larger share.
fn resting(found: &Discovery) -> f64 {
    let share =
        |labels: &Vec<u16>| labels.iter().filter(|label| **label == 0).count() as f64 / labels.len().max(1) as f64;
    found.labels.iter().map(share).fold(0.0, f64::max)
}

/// Share of all points that moved for certain and that no motion explains.
fn unexplained(found: &Discovery, evidence: &Evidence) -> f64 {
    let points: usize = evidence.occupancy.iter().map(Vec::len).sum();
    (evidence.total() as f64 - found.explained()) / points.max(1) as f64
}

/// Of the points of a state that the motions of their parts take to places that the other state shows, the share in empty space; of
/// both states the larger share: a small object that is hidden within a large one contradicts nothing, but the large one does.
fn contradicted(found: &Discovery, scene: &Scene) -> f64 {
    let share = |state: State| {
        let to_other = |(p, label): (&Vec3, &u16)| match usize::from(*label).checked_sub(1) {
            Some(k) => found.parts[k].motion.away_from(state).apply(p.as_dvec3()).as_vec3(),
            None => *p,
        };
        let images: Vec<Vec3> = found.clouds[state].points.iter().zip(&found.labels[state]).map(to_other).collect();
        let votes = ViewVotes::of_all(&scene.states[state.other()].views, &images, scene.tolerance);
        let (mut empty, mut surface) = (0usize, 0usize);
        for votes in votes {
            empty += usize::from(votes.occupancy() == Occupancy::Empty);
            surface += usize::from(votes.occupancy() == Occupancy::Surface);
        }
        empty as f64 / (empty + surface).max(1) as f64
    };
    State::ALL.map(share).into_iter().fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::test_scene::{cabinet_scene, laptop_scene};
    use crate::discover::{StepSettings, discover};

    #[test]
    fn places_in_empty_space_contradict_and_hidden_places_do_not() {
        for scene in [cabinet_scene(16, 96), laptop_scene(16, 120)] {
            let found = discover(&scene, 1..=4, &DiscoverConfig::default()).unwrap();
            let share = contradicted(&found, &scene);
            assert!(share < 0.02, "{share}");
            let at_rest = Discovery { labels: found.labels.as_ref().map(|l| vec![0; l.len()]), ..found };
            let share = contradicted(&at_rest, &scene);
            assert!(share > 0.1, "{share}");
        }
    }

    #[test]
    fn an_object_of_which_nothing_rests_is_refused() {
        let scene = laptop_scene(16, 120);
        let found = discover(&scene, 1..=4, &DiscoverConfig::default()).unwrap();
        let evidence = Evidence::new(&scene, &StepSettings::default()).unwrap();
        let moved = Discovery { labels: found.labels.as_ref().map(|l| vec![1; l.len()]), ..found };
        let refused = explaining_enough(moved.clone(), &evidence, &scene, &DiscoverConfig::default());
        assert!(matches!(refused, Err(DiscoverError::NothingRests(share)) if share == 0.0));
        let any = DiscoverConfig::default().without_refusals();
        assert!(explaining_enough(moved, &evidence, &scene, &any).is_ok());
    }
}
