//! Order of candidate motions: what they explain, how plausible they are, and that every part keeps some.

use super::candidates::{Candidate, sample_of};
use super::cloud::IndexedCloud;
use super::front::Front;
use super::scene::Lengths;
use artgs_core::{PerState, Rigid, State};
use glam::Vec3;

/// Settings of the plausibility of a motion. Calibrated on the stand-ins of the paper's objects (`artgs synth paper`):
/// an ordinary door has an implausibility of about 0.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RankingSettings {
    /// Implausibility of a turn by half a circle.
    pub(crate) turn: f32,
    /// Implausibility of a shift by the object's diagonal.
    pub(crate) shift: f32,
    /// Implausibility of a hinge whose axis is one diagonal away from the part, or that slides along its axis that far.
    pub(crate) far_axis: f32,
    /// Implausibility of a slide across the front of the object of a part that stands out of it: open drawers that look
    /// alike slide back, and do not exchange places in front of it. Weighted by the share of the part's points that stand
    /// out before or after, so that panels that slide within the front keep their motion. More than the cost of what an exchange would show and a drawer that
    /// closes hides (`LabelCosts::hidden_moved`), far less than the cost of a motion that is not explained.
    pub(crate) across_front: f32,
    /// Neither of these two distances counts beyond this fraction of the diagonal.
    pub(crate) farthest_axis: f32,
    /// Motions that turn less have no axis worth judging, radians.
    pub(crate) least_turn: f32,
    /// Largest implausibility.
    pub(crate) most: f32,
    /// Rate at which the second ranking, which keeps small motions from being displaced by large ones to a part that
    /// looks the same, falls with implausibility.
    pub(crate) small_motion_rate: f32,
    /// Weight of a point that a candidate ranked before explains, per such candidate.
    pub(crate) repeated: f64,
}

impl Default for RankingSettings {
    fn default() -> Self {
        Self {
            turn: 0.1,
            shift: 0.4,
            far_axis: 0.8,
            across_front: 0.25,
            farthest_axis: 0.2,
            least_turn: 0.1,
            most: 0.6,
            small_motion_rate: 15.0,
            repeated: 0.5,
        }
    }
}

impl RankingSettings {
    /// Between motions that explain the same, the one that moves and turns less and whose hinge is on the part is more
    /// plausible: two equal doors can be confused by every other measure. Between 0 (rest) and `most`. `front` is the
    /// side on which the object opens, if it has one.
    pub(super) fn implausibility(
        &self,
        motion: &Rigid,
        sample: &[(Vec3, Vec3)],
        lengths: &Lengths,
        front: Option<Front>,
    ) -> f32 {
        let count = sample.len().max(1) as f32;
        let moved = |p: Vec3| motion.apply(p.as_dvec3()).as_vec3();
        let shift = sample.iter().map(|(p, _)| moved(*p).distance(*p)).sum::<f32>() / count / lengths.diagonal;
        let angle = motion.angle() as f32;
        let (mut far, mut across) = (0.0, 0.0);
        if angle > self.least_turn {
            let screw = motion.screw();
            let (axis, origin) = (screw.axis.as_vec3(), screw.origin.as_vec3());
            let gap = sample.iter().map(|(p, _)| (*p - origin).cross(axis).length()).fold(f32::INFINITY, f32::min);
            far = (gap / lengths.diagonal).min(self.farthest_axis)
                + (screw.slide.abs() as f32 / lengths.diagonal).min(self.farthest_axis);
        }
        if let Some(front) = front.filter(|_| angle <= self.least_turn && shift * lengths.diagonal > lengths.spacing) {
            let total = sample.iter().map(|(p, _)| moved(*p) - *p).sum::<Vec3>();
            let before = front.share_standing_out(sample.iter().map(|(p, _)| *p));
            let after = front.share_standing_out(sample.iter().map(|(p, _)| moved(*p)));
            let sine_squared = 1.0 - total.normalize_or(front.direction).dot(front.direction).powi(2);
            across = sine_squared * before.max(after);
        }
        (self.across_front * across
            + self.turn * angle / std::f32::consts::PI
            + self.shift * shift
            + self.far_axis * far)
            .min(self.most)
    }

    /// Factor of the second ranking.
    pub(super) fn small_motion(&self, implausibility: f32) -> f32 {
        (-self.small_motion_rate * implausibility).exp()
    }

    /// Order in which candidates are worth keeping, at most `count` of them: each time the one that explains most, times
    /// its `factor`, where a point counts less each time that one taken before explains it. Without that, a hundred
    /// variants of one good motion would displace the only one of another part.
    pub(super) fn diverse_order(
        &self,
        candidates: &[Candidate],
        clouds: PerState<&IndexedCloud<'_>>,
        count: usize,
        factor: impl Fn(&Candidate) -> f64,
    ) -> Vec<usize> {
        let mut weights = clouds.map(|c| vec![1.0f64; c.cloud.len()]);
        let value = |c: &Candidate, weights: &PerState<Vec<f64>>| {
            let explained = c.explained.iter().zip(weights);
            factor(c) * explained.map(|(points, w)| points.iter().map(|&i| w[i]).sum::<f64>()).sum::<f64>()
        };
        // Values only fall, so a candidate that still leads after its value is computed again is the best.
        let mut waiting: Vec<(f64, usize)> = candidates.iter().map(|c| value(c, &weights)).zip(0..).collect();
        let ascending = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1));
        waiting.sort_by(ascending);
        let mut order = Vec::new();
        while order.len() < count
            && let Some((_, best)) = waiting.pop()
        {
            let current = (value(&candidates[best], &weights), best);
            if waiting.last().is_some_and(|next| ascending(&current, next).is_lt()) {
                let place = waiting.partition_point(|w| ascending(w, &current).is_lt());
                waiting.insert(place, current);
                continue;
            }
            order.push(best);
            for (points, w) in candidates[best].explained.iter().zip(&mut weights) {
                points.iter().for_each(|&i| w[i] *= self.repeated);
            }
        }
        order
    }
}

/// The state that shows more of what a candidate explains, the first of equal ones.
pub(super) fn better_seen(explained: &PerState<Vec<usize>>) -> State {
    let mut best = State::START;
    for (state, points) in explained.enumerate() {
        if points.len() > explained[best].len() {
            best = state;
        }
    }
    best
}

/// True if a motion takes the points explained by a candidate to the same places as the candidate does.
pub(super) fn alike(
    motion: &Rigid,
    candidate: &Candidate,
    clouds: PerState<&IndexedCloud<'_>>,
    lengths: &Lengths,
) -> bool {
    /// Points compared.
    const SAMPLES: usize = 50;
    /// Places this close are the same, spacings.
    const SAME: f32 = 0.5;
    let state = better_seen(&candidate.explained);
    let (a, b) = (motion.away_from(state), candidate.motion.away_from(state));
    let sample = sample_of(clouds[state].cloud, &candidate.explained[state], SAMPLES);
    let gap = |p: Vec3| a.apply(p.as_dvec3()).distance(b.apply(p.as_dvec3()));
    sample.iter().map(|(p, _)| gap(*p)).fold(0.0, f64::max) < f64::from(SAME * lengths.spacing)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn small_motions_about_an_axis_on_the_part_are_plausible() {
        let (settings, lengths) = (RankingSettings::default(), Lengths { spacing: 0.01, diagonal: 1.0 });
        let sample: Vec<(Vec3, Vec3)> = (0..20).map(|i| (Vec3::X * (0.3 * i as f32 / 19.0), Vec3::Y)).collect();
        let judge = |motion: Rigid| settings.implausibility(&motion, &sample, &lengths, None);
        let own = judge(Rigid::about(DVec3::Z, DVec3::ZERO, 1.0));
        let far = judge(Rigid::about(DVec3::Z, DVec3::new(0.15, 0.3, 0.0), 1.0));
        assert!(judge(Rigid::IDENTITY) == 0.0 && own < 0.15 && far > own + 0.1, "{own} {far}");
        assert!(judge(Rigid::shift(DVec3::X * 0.1)) < judge(Rigid::shift(DVec3::X * 0.3)));
        assert!(settings.small_motion(far) < 0.3 * settings.small_motion(own));
    }
}
