//! What was found is kept or refused by the share of the surfaces that its energy does not explain.

use super::{DiscoverConfig, DiscoverError, Discovery};

/// Joints that are sure, and states in which nothing moved, may leave this many times as much unexplained: thin parts show different sides in
/// the two states, and errors of poses move whole regions.
const OF_SURE: f64 = 2.0;

/// What was found, if the `share` of the surfaces that it leaves unexplained is small enough, with a warning where it is large. Otherwise the
/// states are refused. Joints are sure that explain most of the `moved` points.
pub(super) fn explaining_enough(
    mut found: Discovery,
    share: f64,
    moved: usize,
    config: &DiscoverConfig,
) -> Result<Discovery, DiscoverError> {
    let resting = resting(&found);
    if resting < config.least_resting {
        return Err(DiscoverError::NothingRests(resting));
    }
    let is_sure = found.parts.is_empty() || found.quality(moved) >= config.sure_quality;
    if share > config.most_unexplained * if is_sure { OF_SURE } else { 1.0 } {
        return Err(DiscoverError::Unexplained(share));
    }
    if share > config.most_unexplained {
        let although = if found.parts.is_empty() { "" } else { ", although joints were found: look at the parts" };
        found.warnings.push(format!(
            "{:.0} % of all surfaces differ between the two states and no motion explains them{although}; check that both states show the \
             same object",
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::discover;
    use crate::discover::test_scene::{cabinet_scene, laptop_scene};
    use crate::explain::{ExplainSettings, Explanation, Problem, SearchSettings, Surfels};

    #[test]
    fn what_motions_do_not_explain_contradicts_and_what_is_hidden_does_not() {
        let limit = DiscoverConfig::default().most_unexplained;
        for scene in [cabinet_scene(16, 96), laptop_scene(16, 120)] {
            let found = discover(&scene, 1..=4, &DiscoverConfig::default()).unwrap();
            let surfels = Surfels::new(&scene, &ExplainSettings::DEFAULT);
            let mut problem = Problem::new(&scene, &surfels, ExplainSettings::DEFAULT);
            let explanation = problem.explained(&found, &SearchSettings::default());
            let share = problem.unexplained_share(&explanation);
            assert!(share < limit, "{share}");
            let share = problem.unexplained_share(&Explanation::without_parts(problem.surfels()));
            assert!(share > 1.5 * limit, "{share}");
        }
    }

    #[test]
    fn an_object_of_which_nothing_rests_is_refused() {
        let scene = laptop_scene(16, 120);
        let found = discover(&scene, 1..=4, &DiscoverConfig::default()).unwrap();
        let moved = Discovery { labels: found.labels.as_ref().map(|l| vec![1; l.len()]), ..found };
        let refused = explaining_enough(moved.clone(), 0.0, 1, &DiscoverConfig::default());
        assert!(matches!(refused, Err(DiscoverError::NothingRests(share)) if share == 0.0));
        let any = DiscoverConfig::default().without_refusals();
        assert!(explaining_enough(moved, 1.0, 1, &any).is_ok());
    }
}
