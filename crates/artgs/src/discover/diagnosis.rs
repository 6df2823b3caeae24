//! How well the result fits what both states show, and warnings where it does not.

use super::scene::Scene;
use super::visibility::ViewVotes;
use artgs_core::{JointEstimate, PerState, Rigid, State};
use glam::Vec3;

/// Settings of warnings and of the fit of visible points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DiagnosisSettings {
    /// A warning if more than this fraction of the moved points fits no part. On clean captures with the right number of
    /// parts it is less than 0.002; with one part too few 0.013 and more.
    pub(crate) unexplained: f64,
    /// A warning if no point of a part moves by more, depth tolerances.
    pub(crate) least_motion: f64,
    /// With fewer visible points the fit is none.
    pub(crate) least_visible: usize,
}

impl Default for DiagnosisSettings {
    fn default() -> Self {
        Self { unexplained: 0.01, least_motion: 3.0, least_visible: 24 }
    }
}

impl DiagnosisSettings {
    /// Warnings that the number of parts is wrong: many moved points that fit no part, parts that hardly move.
    pub(super) fn warnings(
        &self,
        scene: &Scene,
        labels: &PerState<Vec<u16>>,
        moved: &PerState<Vec<usize>>,
        parts: &[JointEstimate],
    ) -> Vec<String> {
        let total: usize = moved.iter().map(Vec::len).sum();
        let unexplained: usize =
            State::ALL.into_iter().map(|s| moved[s].iter().filter(|&&i| labels[s][i] == 0).count()).sum();
        let mut warnings = Vec::new();
        let share = unexplained as f64 / total.max(1) as f64;
        if share > self.unexplained {
            let percent = (100.0 * share).round();
            warnings.push(format!(
                "{percent} % of what moved fits none of the found motions: there may be more parts than these"
            ));
        }
        for (k, part) in parts.iter().enumerate() {
            let distance = |p: &Vec3| part.motion.apply(p.as_dvec3()).distance(p.as_dvec3());
            let farthest = points_of(scene, labels, k as u16 + 1, State::START).map(distance).fold(0.0, f64::max);
            if farthest < self.least_motion * f64::from(scene.tolerance) {
                let number = k + 1;
                warnings.push(format!("part {number} hardly moves or is hardly seen: it may not be a part"));
            }
        }
        warnings
    }

    /// Fit of a part: of its points that `motion` (start to end) moves to where the other state shows a surface
    /// or empty space, the share on a surface; none if fewer than [`Self::least_visible`] points are visible.
    pub(crate) fn fit(&self, scene: &Scene, labels: &PerState<Vec<u16>>, part: u16, motion: &Rigid) -> Option<f64> {
        let (mut on_surface, mut in_empty) = (0, 0);
        for state in State::ALL {
            let motion = motion.away_from(state);
            let images: Vec<Vec3> =
                points_of(scene, labels, part, state).map(|p| motion.apply(p.as_dvec3()).as_vec3()).collect();
            for votes in ViewVotes::of_all(&scene.states[state.other()].views, &images, scene.tolerance) {
                on_surface += usize::from(votes.is_surface());
                in_empty += usize::from(!votes.is_surface() && votes.is_empty_space());
            }
        }
        let total = on_surface + in_empty;
        (total >= self.least_visible).then(|| on_surface as f64 / total as f64)
    }
}

/// Points of a part in a state.
fn points_of<'a>(
    scene: &'a Scene,
    labels: &'a PerState<Vec<u16>>,
    part: u16,
    state: State,
) -> impl Iterator<Item = &'a Vec3> {
    let points = scene.states[state].cloud.points.iter().zip(&labels[state]);
    points.filter(move |(_, label)| **label == part).map(|(p, _)| p)
}
