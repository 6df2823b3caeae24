//! Nats of one surfel under the motion of one part.

use super::energy::{Evidence, Explanation};
use super::evidence::{NOBODY, Seen};
use super::noise::Noise;
use super::settings::ExplainSettings;
use artgs_core::{PerState, State};

/// Prices of what contradicts the prediction that a surfel is seen, nats against a usual hit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prices {
    /// A view looks through the place of the surfel.
    pub(super) through: f32,
    /// No view shows the place of the surfel.
    pub(super) hidden: f32,
}

impl Prices {
    /// From the densities of depth: a hit is spread over the measured deviation, anything else over the diagonal.
    pub(super) fn measured(noise: &PerState<Noise>, diagonal: f32) -> Self {
        /// Least share, so that what was never measured keeps a finite price.
        const LEAST: f32 = 1e-4;
        let mean = |of: &dyn Fn(&Noise) -> f32| noise.iter().map(of).sum::<f32>() / 2.0;
        let spread = mean(&|n| n.deviation[2]) * (std::f32::consts::TAU * std::f32::consts::E).sqrt();
        let price =
            |kind: usize| (diagonal / spread * mean(&|n| n.rates[0]) / mean(&|n| n.rates[kind]).max(LEAST)).ln();
        Self { through: price(2), hidden: price(1) }
    }
}

/// What an explanation says about the surfels of one state and of those of the other state that they meet.
pub(super) struct Context {
    /// Surfels of the other state that are seen where their parts take them.
    founded: Vec<bool>,
    /// For each part, 0 to 1: how far it is believed, from the share of its surfels that are seen on its own surface.
    believed: Vec<f32>,
    /// A part that is believed without surfels of its own: it was just added.
    pub(super) fresh: Option<u16>,
}

impl Context {
    /// For surfels of `state`. `evidence` is that of the static part and of every motion.
    pub(super) fn new(
        explanation: &Explanation,
        evidence: &[Evidence],
        state: State,
        settings: &ExplainSettings,
    ) -> Self {
        let labels = &explanation.labels[state.other()];
        let seen = |s: State, i: usize| &evidence[usize::from(explanation.labels[s][i])][s][i];
        let mut counts = vec![(0f32, 0f32); evidence.len()];
        for (i, label) in explanation.labels[state].iter().enumerate() {
            let seen = seen(state, i);
            let own = seen.is_founded() && !seen.lands_on_another(*label, labels);
            let count = &mut counts[usize::from(*label)];
            *count = (count.0 + f32::from(u8::from(own)), count.1 + 1.0);
        }
        Self {
            founded: (0..labels.len()).map(|i| seen(state.other(), i).is_founded()).collect(),
            believed: counts.iter().map(|(own, all)| (own / all.max(1.0) / settings.supported).min(1.0)).collect(),
            fresh: None,
        }
    }

    fn believed(&self, part: Option<u16>) -> f32 {
        let known = part.filter(|part| self.fresh != Some(*part));
        known.map_or(1.0, |part| self.believed.get(usize::from(part)).copied().unwrap_or(0.0))
    }
}

/// What a surfel costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cost {
    /// Some view shows its place.
    Visible(f32),
    /// None does.
    Hidden(f32),
}

impl Cost {
    pub(super) fn nats(self) -> f32 {
        let (Self::Visible(nats) | Self::Hidden(nats)) = self;
        nats
    }
}

/// Of a surfel in part `part`; none is a part that does not exist yet.
///
/// What is hidden is cheap if most of what hides it is founded, that is, seen in both states, and if its part is believed. Else the
/// explanation could take any surface behind another one to be rid of it.
pub(super) fn cost(
    seen: &Seen,
    part: Option<u16>,
    context: &Context,
    prices: &Prices,
    settings: &ExplainSettings,
) -> Cost {
    let doubt = 1.0 - context.believed(part);
    let shown = f32::from(seen.hit + seen.through);
    if shown > 0.0 {
        let nats = mean_nats(seen, prices);
        let sure = shown / (shown + settings.views);
        return Cost::Visible(
            capped(nats, settings.most) * sure * (1.0 - doubt) + capped(prices.hidden, settings.most) * doubt,
        );
    }
    let full = capped(prices.hidden, settings.most);
    Cost::Hidden(if is_hidden_by_most(seen, &context.founded) {
        settings.hidden + (full - settings.hidden).max(0.0) * doubt
    } else if seen.hidden == 0 {
        settings.unseen
    } else {
        full
    })
}

/// Nats of the views that show the place of a surfel, in the mean; 0 if none does.
pub(super) fn mean_nats(seen: &Seen, prices: &Prices) -> f32 {
    let shown = f32::from((seen.hit + seen.through).max(1));
    (seen.misfit + prices.through * f32::from(seen.through)) / shown
}

/// Nats of a surfel that is wrong itself with a probability of `exp(-most)`.
fn capped(nats: f32, most: f32) -> f32 {
    let wrong = (-most).exp();
    -((1.0 - wrong) * (-nats).exp() + wrong).ln()
}

/// True if most of what hides a surfel is of the surfels `founded` of the other state.
fn is_hidden_by_most(seen: &Seen, founded: &[bool]) -> bool {
    let known = || seen.occluders.iter().filter(|o| **o != NOBODY);
    2 * known().filter(|o| founded[**o as usize]).count() > known().count()
}

#[cfg(test)]
mod tests {
    use super::super::evidence::Seen;
    use super::*;

    const PRICES: Prices = Prices { through: 10.0, hidden: 6.0 };

    fn seen(hit: u16, through: u16, occluders: [u32; 4]) -> Seen {
        Seen { misfit: 0.0, hit, through, hidden: 4, occluders, landing: [NOBODY; 4] }
    }

    fn of(seen: &Seen, part: Option<u16>, believed: f32) -> f32 {
        let context = Context { founded: vec![true, true, false, false], believed: vec![1.0, believed], fresh: None };
        cost(seen, part, &context, &PRICES, &ExplainSettings::DEFAULT).nats()
    }

    #[test]
    fn hits_are_free_and_contradictions_are_capped() {
        assert!(of(&seen(5, 0, [NOBODY; 4]), Some(1), 1.0) < 1e-6);
        let half = of(&seen(2, 2, [NOBODY; 4]), Some(1), 1.0);
        let all = of(&seen(0, 5, [NOBODY; 4]), Some(1), 1.0);
        let one = of(&seen(0, 1, [NOBODY; 4]), Some(1), 1.0);
        assert!(half > 1.5 && half < all && all < ExplainSettings::DEFAULT.most, "{half} {all}");
        assert!(one > 0.5 && 1.5 * one < all, "a view alone counts less: {one} {all}");
    }

    #[test]
    fn hiding_is_cheap_only_behind_founded_surface_and_in_believed_parts() {
        let (by_founded, by_others) = (seen(0, 0, [0, 1, 2, NOBODY]), seen(0, 0, [0, 2, 3, NOBODY]));
        assert!((of(&by_founded, Some(1), 1.0) - ExplainSettings::DEFAULT.hidden).abs() < 1e-6);
        for dear in
            [of(&by_others, Some(1), 1.0), of(&by_founded, Some(1), 0.0), of(&seen(0, 0, [NOBODY; 4]), Some(1), 1.0)]
        {
            assert!(dear > 2.5, "{dear}");
        }
        let between = of(&by_founded, Some(1), 0.5);
        assert!(between > 1.0 && between < 2.5, "{between}");
        // A part that is only asked about has no surfels yet.
        assert!(of(&by_founded, None, 0.0) < 0.1);
    }

    #[test]
    fn a_part_that_is_not_believed_gains_nothing_by_being_seen() {
        assert!(of(&seen(5, 0, [NOBODY; 4]), Some(1), 0.0) > 2.5);
    }
}
