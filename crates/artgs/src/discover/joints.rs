//! Motions of parts from their labelled points, and the joints that they are on.

use super::DiscoverConfig;
use super::cloud::{Cloud, IndexedCloud};
use super::registration::{Matching, Registration, RegistrationOptions, register};
use super::scene::Lengths;
use artgs_core::{Joint, JointEstimate, JointKind, PerState, Rigid, State};

/// Settings of the registration of parts and of the choice of their joints. Calibrated on the demo cabinet and the
/// stand-ins of the paper's objects.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointSettings {
    /// Parts with fewer points in a state are not registered.
    pub(crate) least_points: usize,
    /// Iterations and points of a registration, in rounds before the last and in the last.
    pub(crate) effort: [(usize, usize); 2],
    /// First reach of a registration, spacings; the last one is 1.
    pub(crate) reach: f64,
    /// A motion that turns less is a slide, degrees: the axis of so small a turn is not determined.
    pub(crate) no_turn_deg: f64,
    /// A motion that turns more than this many times `DiscoverConfig::revolute_deg` is not tried as a slide.
    pub(crate) sure_turn: f64,
    /// In between, a hinge is taken if its root mean square distance is below this fraction of the slide's,
    pub(crate) better: f64,
    /// and it matches at least this fraction of the slide's pairs.
    pub(crate) as_many: f64,
}

impl Default for JointSettings {
    fn default() -> Self {
        Self {
            least_points: 12,
            effort: [(12, 4000), (20, 20_000)],
            reach: 3.0,
            no_turn_deg: 0.05,
            sure_turn: 4.0,
            better: 0.7,
            as_many: 0.95,
        }
    }
}

/// Estimates joints from labelled points.
pub(super) struct JointFit<'a> {
    pub(super) lengths: &'a Lengths,
    pub(super) settings: &'a JointSettings,
    pub(super) config: &'a DiscoverConfig,
    /// In the last round joints are decided; before, motions are general.
    pub(super) last: bool,
}

impl JointFit<'_> {
    /// Registers the points of one part, `own`, beginning with the estimate so far. `known` is the type if the user gave
    /// it.
    pub(super) fn refine(
        &self,
        part: &JointEstimate,
        own: &PerState<Cloud>,
        known: Option<JointKind>,
    ) -> JointEstimate {
        let decide = self.last && self.config.decide_joints;
        if own.iter().any(|c| c.len() < self.settings.least_points) {
            return if decide { self.unregistered(part, known) } else { *part };
        }
        let points = own.as_ref().map(IndexedCloud::new);
        let spacing = f64::from(self.lengths.spacing);
        let (iterations, max_points) = self.settings.effort[usize::from(self.last)];
        let options = RegistrationOptions {
            first_reach: self.settings.reach * spacing,
            last_reach: spacing,
            iterations,
            max_points,
        };
        let free = register(both(&points), part.motion, None, &options);
        if !decide {
            return JointEstimate { rms: free.rms, ..JointEstimate::new(JointKind::Screw, free.motion) };
        }
        let (kind, fit) = match known {
            Some(kind) => (kind, on_joint(&points, &free, kind, &options)),
            None => self.choose(&points, &free, &options),
        };
        JointEstimate { rms: fit.rms, ..JointEstimate::new(kind, fit.motion) }
    }

    /// Too few points to fit anything to: the motion as proposed, on the likelier joint.
    fn unregistered(&self, part: &JointEstimate, known: Option<JointKind>) -> JointEstimate {
        let turns = part.motion.angle().to_degrees() > self.config.revolute_deg;
        let kind = known.unwrap_or(if turns { JointKind::Revolute } else { JointKind::Prismatic });
        JointEstimate { kind, motion: Joint::from_motion(kind, &part.motion).start_to_end(), ..*part }
    }

    /// Slide or hinge: the slide, which has fewer parameters, unless the hinge fits clearly better.
    fn choose(
        &self,
        points: &PerState<IndexedCloud<'_>>,
        free: &Registration,
        options: &RegistrationOptions,
    ) -> (JointKind, Registration) {
        let (settings, revolute_deg) = (self.settings, self.config.revolute_deg);
        let fit = |kind| on_joint(points, free, kind, options);
        let turn = free.motion.angle().to_degrees();
        if turn < settings.no_turn_deg {
            return (JointKind::Prismatic, fit(JointKind::Prismatic));
        }
        let hinge = fit(JointKind::Revolute);
        if turn > settings.sure_turn * revolute_deg {
            return (JointKind::Revolute, hinge);
        }
        let slide = fit(JointKind::Prismatic);
        let rms = |r: &Registration| r.rms.unwrap_or(f64::INFINITY);
        let as_many = hinge.pairs as f64 > settings.as_many * slide.pairs as f64;
        let hinge_wins = turn > revolute_deg || (rms(&hinge) < settings.better * rms(&slide) && as_many);
        if hinge_wins { (JointKind::Revolute, hinge) } else { (JointKind::Prismatic, slide) }
    }
}

fn both<'a>(points: &'a PerState<IndexedCloud<'a>>) -> Matching<'a> {
    Matching::mutual(&points[State::START], &points[State::END])
}

/// Registration on a joint of the given kind, from a free one.
fn on_joint(
    points: &PerState<IndexedCloud<'_>>,
    free: &Registration,
    kind: JointKind,
    options: &RegistrationOptions,
) -> Registration {
    let guess = match kind {
        // Every rigid motion is a screw.
        JointKind::Screw => return *free,
        JointKind::Revolute => Joint::from_motion(JointKind::Revolute, &free.motion).start_to_end(),
        JointKind::Prismatic => {
            // The shift of the part's centre, so that a small turn does not change the slide.
            let centre = points[State::START].cloud.middle().as_dvec3();
            Rigid::shift(free.motion.apply(centre) - centre)
        }
    };
    register(both(points), guess, Some(kind), options)
}
