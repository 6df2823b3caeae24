//! Nats of one surfel under the motion of one part.

use super::energy::{Edge, Evidence, Explanation};
use super::evidence::Seen;
use super::noise::Noise;
use super::settings::ExplainSettings;
use crate::connected::connected_components;
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
    /// Part of every surfel of the state.
    labels: Vec<u16>,
    /// Part of every surfel of the other state.
    others: Vec<u16>,
    /// For each part, 0 to 1: how far it is believed, from the share of its surfels that are seen on its own surface.
    believed: Vec<f32>,
    /// For each surfel the least of that and of the number of independent surfels that are seen so in its connected piece of the part: what is
    /// apart from the rest of a body needs evidence of its own. What stands still is one body.
    piece: Vec<f32>,
    /// A part that is believed without surfels of its own: it was just added.
    pub(super) fresh: Option<u16>,
}

impl Context {
    /// For surfels of `state`, which `edges` connect and of which `shared` neighbours count as one. `evidence` is that of the static part and
    /// of every motion.
    pub(super) fn new(
        explanation: &Explanation,
        evidence: &[Evidence],
        state: State,
        (edges, shared): (&[Edge], f32),
        settings: &ExplainSettings,
    ) -> Self {
        let (labels, others) = (&explanation.labels[state], &explanation.labels[state.other()]);
        let seen = |s: State, i: usize| &evidence[usize::from(explanation.labels[s][i])][s][i];
        let ends = edges.iter().map(|(i, j, _)| (*i as usize, *j as usize));
        let of_one_part = |(i, j): &(usize, usize)| labels[*i] == labels[*j] && labels[*i] > 0;
        let pieces = connected_components(labels.len(), ends.filter(of_one_part));
        let mut of_parts = vec![Counts::default(); evidence.len()];
        let mut of_pieces = vec![Counts::default(); pieces.iter().max().map_or(0, |last| *last as usize + 1)];
        for (i, label) in labels.iter().enumerate() {
            let seen = seen(state, i);
            let own = seen.is_founded(*label, others) && !seen.lands_on_another(*label, others);
            of_parts[usize::from(*label)].add(own);
            of_pieces[pieces[i] as usize].add(own);
        }
        let believed: Vec<f32> = of_parts.iter().map(|counts| counts.believed(settings)).collect();
        let piece = |(label, piece): (&u16, &u32)| match *label {
            0 => believed[0],
            part => (of_pieces[*piece as usize].own / shared).min(believed[usize::from(part)]),
        };
        Self {
            founded: others
                .iter()
                .enumerate()
                .map(|(i, part)| seen(state.other(), i).is_founded(*part, labels))
                .collect(),
            piece: labels.iter().zip(&pieces).map(piece).collect(),
            labels: labels.clone(),
            others: others.clone(),
            believed,
            fresh: None,
        }
    }

    /// How far surfel `i` is believed to be of a part, 0 to 1.
    pub(super) fn believed(&self, part: u16, i: usize) -> f32 {
        if self.fresh == Some(part) {
            1.0
        } else if self.labels[i] == part {
            self.piece[i]
        } else {
            self.believed[usize::from(part)]
        }
    }
}

/// Surfels, and those of them that are seen on the surface of their own part.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    own: f32,
    all: f32,
}

impl Counts {
    fn add(&mut self, own: bool) {
        self.own += f32::from(u8::from(own));
        self.all += 1.0;
    }

    fn believed(self, settings: &ExplainSettings) -> f32 {
        (self.own / self.all.max(1.0) / settings.supported).min(1.0)
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

/// Of a surfel that is believed so far, 0 to 1, to be of part `part`, whose motion it has.
///
/// What is hidden is cheap if most of what hides it is founded, that is, seen in both states, and if it is believed. Else the
/// explanation could take any surface behind another one to be rid of it. What faces away from all views is cheap behind the front of its
/// own part.
pub(super) fn cost(
    seen: &Seen,
    part: u16,
    believed: f32,
    context: &Context,
    prices: &Prices,
    settings: &ExplainSettings,
) -> Cost {
    let doubt = 1.0 - believed;
    let shown = f32::from(seen.hit + seen.through);
    if shown > 0.0 {
        let nats = mean_nats(seen, prices);
        let sure = shown / (shown + settings.views);
        return Cost::Visible(
            capped(nats, settings.most) * sure * (1.0 - doubt) + capped(prices.hidden, settings.most) * doubt,
        );
    }
    let full = capped(prices.hidden, settings.most);
    let least = match seen.hidden {
        // At first a part takes only what is seen of it, or of its other face.
        0 if context.fresh == Some(part) && seen.backed => settings.hidden,
        _ if context.fresh == Some(part) => full,
        0 if seen.is_hidden_by(|o| context.others[o] == part) => settings.hidden,
        0 => settings.unseen,
        _ if seen.is_hidden_by(|o| context.founded[o]) => settings.hidden,
        _ => full,
    };
    Cost::Hidden(least + (full - least).max(0.0) * doubt)
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

#[cfg(test)]
mod tests {
    use super::super::evidence::{NOBODY, Seen};
    use super::*;

    const PRICES: Prices = Prices { through: 10.0, hidden: 6.0 };

    fn seen(hit: u16, through: u16, occluders: [u32; 4]) -> Seen {
        Seen { misfit: 0.0, hit, through, hidden: 4, backed: false, occluders, landing: [NOBODY; 4] }
    }

    fn of(seen: &Seen, believed: f32) -> f32 {
        let context = Context {
            founded: vec![true, true, false, false],
            labels: Vec::new(),
            others: vec![2, 2, 2, 1],
            believed: Vec::new(),
            piece: Vec::new(),
            fresh: None,
        };
        cost(seen, 1, believed, &context, &PRICES, &ExplainSettings::DEFAULT).nats()
    }

    #[test]
    fn hits_are_free_and_contradictions_are_capped() {
        assert!(of(&seen(5, 0, [NOBODY; 4]), 1.0) < 1e-6);
        let half = of(&seen(2, 2, [NOBODY; 4]), 1.0);
        let all = of(&seen(0, 5, [NOBODY; 4]), 1.0);
        let one = of(&seen(0, 1, [NOBODY; 4]), 1.0);
        assert!(half > 1.5 && half < all && all < ExplainSettings::DEFAULT.most, "{half} {all}");
        assert!(one > 0.5 && 1.5 * one < all, "a view alone counts less: {one} {all}");
    }

    #[test]
    fn hiding_is_cheap_only_behind_founded_surface_and_in_believed_parts() {
        let (by_founded, by_others) = (seen(0, 0, [0, 1, 2, NOBODY]), seen(0, 0, [0, 2, 3, NOBODY]));
        assert!((of(&by_founded, 1.0) - ExplainSettings::DEFAULT.hidden).abs() < 1e-6);
        for dear in [of(&by_others, 1.0), of(&by_founded, 0.0), of(&seen(0, 0, [NOBODY; 4]), 1.0)] {
            assert!(dear > 2.5, "{dear}");
        }
        let between = of(&by_founded, 0.5);
        assert!(between > 1.0 && between < 2.5, "{between}");
    }

    #[test]
    fn a_part_that_is_not_believed_gains_nothing_by_being_seen_or_by_leaving_all_views() {
        assert!(of(&seen(5, 0, [NOBODY; 4]), 0.0) > 2.5);
        let outside = Seen { hidden: 0, ..seen(0, 0, [NOBODY; 4]) };
        assert!((of(&outside, 1.0) - ExplainSettings::DEFAULT.unseen).abs() < 1e-6);
        assert!(of(&outside, 0.0) > 2.5);
    }
}
