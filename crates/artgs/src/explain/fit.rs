//! The motion of one part: as it is, free, or of fewer numbers, whichever the energy prefers.

use super::energy::{Explanation, Problem};
use super::search::is_slide;
use artgs_core::{JointKind, Rigid, State};
use glam::DVec3;

impl Problem<'_> {
    /// The motion of part `part` (from 1) registered, as it is, as a slide, or as a slide in a direction of another part, whichever has
    /// the lowest energy with these labels; then labels cut.
    pub fn fitted(&mut self, explanation: &Explanation, part: usize) -> Explanation {
        let free = self.registered(explanation, part).motion;
        let mut options = Vec::new();
        if self.can_move(&free, explanation, part) {
            options.push((free, JointKind::Revolute.numbers()));
        }
        let middles = self.middles(explanation);
        let shift = |m: &Rigid| m.apply(middles[part]) - middles[part];
        let slides = [explanation.motions[part - 1], free].map(|m| shift(&m));
        for slide in slides {
            options.push((Rigid::shift(slide), JointKind::Prismatic.numbers()));
            for direction in self.directions(explanation, part) {
                options.push((Rigid::shift(direction * slide.dot(direction)), 1));
            }
        }
        let (mut best, mut least) = (explanation.clone(), self.terms(explanation).total());
        for (motion, numbers) in options {
            let mut with = explanation.clone();
            with.motions[part - 1] = motion;
            with.numbers[part - 1] = numbers;
            let total = self.terms(&with).total();
            if total < least {
                (best, least) = (with, total);
            }
        }
        self.relabelled(&best)
    }

    /// Distinct directions of the slides of parts other than `but`.
    pub(super) fn directions(&self, explanation: &Explanation, but: usize) -> Vec<DVec3> {
        let mut out: Vec<DVec3> = Vec::new();
        for (k, m) in explanation.motions.iter().enumerate() {
            let length = m.translation.length();
            if k + 1 == but || !is_slide(m) || length < 1e-6 {
                continue;
            }
            let d = m.translation / length;
            if out.iter().all(|o| o.dot(d).abs() < 0.999) {
                out.push(d);
            }
        }
        out
    }

    /// Mean start point of every part, the static part first; the mean of all where a part has none.
    pub(super) fn middles(&self, explanation: &Explanation) -> Vec<DVec3> {
        let cloud = self.clouds[State::START].cloud;
        let labels = &explanation.labels[State::START];
        let all = cloud.middle().as_dvec3();
        (0..=explanation.motions.len())
            .map(|k| {
                let own = cloud.points.iter().zip(labels).filter(|(_, l)| usize::from(**l) == k);
                let (sum, n) = own.fold((DVec3::ZERO, 0.0), |(sum, n), (p, _)| (sum + p.as_dvec3(), n + 1.0));
                if n > 0.0 { sum / n } else { all }
            })
            .collect()
    }
}
