//! What moved between two states, found from distances alone.

use super::CanonicalError;
use super::tree::Tree;
use artgs_core::{PerState, State};
use serde::{Deserialize, Serialize};

/// Distances of each state's points to the other state.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionAnalysis {
    /// Squared distance of every point to the nearest point of the other state, per state.
    pub squared_distances: PerState<Vec<f32>>,
    /// The state whose points are farther from the other on average (of the squares), where moved parts show best.
    /// Equal means give the end.
    pub more_motion_state: State,
}

/// When a point counts as static.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StaticRule {
    /// Fraction of the reference distance below which a point is static; applied to squares if `squared`.
    pub ratio: f32,
    /// Whether `ratio` applies to squared distances, as published code does (0.02 is then 0.14 of the distance),
    /// rather than to distances as the paper says.
    pub squared: bool,
    /// The reference is this quantile of a state's distances: 1 for the maximum, less to be safe from floaters.
    pub quantile: f64,
}

impl Default for StaticRule {
    fn default() -> Self {
        Self { ratio: 0.02, squared: true, quantile: 1.0 }
    }
}

impl StaticRule {
    /// True for every static point of a state, from its squared distances.
    pub fn mask(&self, squared_distances: &[f32]) -> Vec<bool> {
        let mut sorted = squared_distances.to_vec();
        sorted.sort_unstable_by(f32::total_cmp);
        let rank = (self.quantile.clamp(0.0, 1.0) * sorted.len().saturating_sub(1) as f64).round() as usize;
        let ratio = if self.squared { self.ratio } else { self.ratio * self.ratio };
        let threshold = ratio * sorted.get(rank).copied().unwrap_or(0.0);
        squared_distances.iter().map(|&d| d < threshold).collect()
    }
}

/// Squared distance from every point of `from` to the nearest of `to`.
pub(crate) fn nearest_squared(from: &[[f32; 3]], to: &[[f32; 3]]) -> Result<Vec<f32>, CanonicalError> {
    Ok(Tree::new(to)?.nearest_all(from).into_iter().map(|hit| hit.1).collect())
}

/// Compares two states, both ways.
pub fn analyse(states: PerState<&[[f32; 3]]>) -> Result<MotionAnalysis, CanonicalError> {
    let squared_distances =
        PerState::from_fn(|state| nearest_squared(states[state], states[state.other()])).transpose()?;
    let mean = |d: &[f32]| d.iter().map(|&v| f64::from(v)).sum::<f64>() / d.len().max(1) as f64;
    let [start, end] = State::ALL.map(|state| mean(&squared_distances[state]));
    let more_motion_state = if start <= end { State::END } else { State::START };
    Ok(MotionAnalysis { squared_distances, more_motion_state })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_state_that_sticks_out_has_more_motion_and_its_moved_points_are_not_static() {
        let body: Vec<[f32; 3]> = (0..400).map(|i| [(i % 20) as f32, (i / 20) as f32, 0.0]).collect();
        let closed = [body.clone(), vec![[5.0, 5.0, 0.5]; 30]].concat();
        let open = [body, vec![[5.0, 5.0, 8.0]; 30]].concat();
        let motion = analyse(PerState::new(&open, &closed)).unwrap();
        assert_eq!(motion.more_motion_state, State::START);
        assert_eq!(analyse(PerState::new(&closed, &open)).unwrap().more_motion_state, State::END);
        assert_eq!(analyse(PerState::new(&open, &open)).unwrap().more_motion_state, State::END);
        let mask = StaticRule::default().mask(&motion.squared_distances[State::START]);
        assert!(mask.iter().enumerate().all(|(i, &fixed)| fixed == (i < 400)));
        assert_eq!(motion.squared_distances[State::START][400], 7.5 * 7.5);
    }

    #[test]
    fn thresholds_apply_to_squares_or_distances_of_a_quantile() {
        let squares: Vec<f32> = (0..=100).map(|i| (i * i) as f32).collect();
        let count = |rule: StaticRule| rule.mask(&squares).iter().filter(|s| **s).count();
        assert_eq!(count(StaticRule { ratio: 0.04, ..Default::default() }), 20);
        assert_eq!(count(StaticRule { ratio: 0.04, squared: false, ..Default::default() }), 4);
        assert_eq!(count(StaticRule { ratio: 0.25, quantile: 0.5, ..Default::default() }), 25);
        assert!(StaticRule::default().mask(&[]).is_empty());
    }
}
