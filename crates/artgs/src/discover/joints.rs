//! Motions of parts from their labelled points, and the joints that they are on.

use super::DiscoverConfig;
use super::cloud::{Cloud, IndexedCloud};
use super::front::Front;
use super::registration::{
    Matching, Registration, RegistrationOptions, matched, register, register_along, shows_other_side,
};
use super::scene::{HingeBall, Lengths, Scene};
use super::screws::{ScrewSettings, turned};
use artgs_core::{Joint, JointEstimate, JointKind, PerState, Rigid, State};
use glam::DVec3;

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
    /// The same of a slide against a motion that turns, where depth noise spreads points.
    pub(crate) noisy_as_many: f64,
    /// A root mean square distance below this many depth tolerances is noise there.
    pub(crate) noisy_rms: f64,
    /// Slides that differ by less from the front keep their direction in the last round, degrees.
    pub(crate) wandered_deg: f64,
    /// A surely turning motion is general, neither slide nor hinge, if it slides along its axis by at least so many depth
    /// tolerances,
    pub(crate) slide_tolerances: f64,
    /// and so many spacings,
    pub(crate) slide_spacings: f64,
    /// and matches at least so many times the hinge's pairs,
    pub(crate) more: f64,
    /// or nearly as many (`as_many`) with a root mean square distance below this fraction of the hinge's.
    pub(crate) much_better: f64,
    /// Screws of parts that look alike from many sides.
    pub(crate) screws: ScrewSettings,
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
            noisy_as_many: 0.9,
            noisy_rms: 0.3,
            wandered_deg: 3.0,
            slide_tolerances: 4.0,
            slide_spacings: 3.0,
            more: 1.2,
            much_better: 0.5,
            screws: ScrewSettings::default(),
        }
    }
}

/// Estimates joints from labelled points.
pub(super) struct JointFit<'a> {
    pub(super) lengths: &'a Lengths,
    /// Where hinges can be.
    pub(super) hinges: HingeBall,
    /// Depth tolerance, scene units.
    pub(super) tolerance: f64,
    pub(super) settings: &'a JointSettings,
    pub(super) config: &'a DiscoverConfig,
    /// Depth noise spreads points: a small turn may be an error.
    pub(super) spreading: bool,
    /// Direction that slides probably follow; none without such noise.
    pub(super) opening: Option<DVec3>,
    /// The last round works with all points.
    pub(super) last: bool,
}

/// A joint and, where neither a slide nor a hinge fits, the general motion that does.
#[derive(Clone, Copy, Debug)]
pub(super) struct Decided {
    /// The joint that fits best, of the kind that the user gave or of a slide and a hinge.
    pub(super) joint: JointEstimate,
    /// A motion that fits clearly better than the joint: that of a screw, or of a part that another one carries.
    pub(super) general: Option<JointEstimate>,
    /// How much worse the joint fits than a motion that is free, nats.
    pub(super) misfit: f64,
}

impl<'a> JointFit<'a> {
    /// For parts of a scene that opens towards `front`. Works with all points if it is the `last` round.
    pub(super) fn new(
        scene: &'a Scene,
        front: Option<Front>,
        settings: &'a JointSettings,
        config: &'a DiscoverConfig,
        last: bool,
    ) -> Self {
        let Scene { lengths, spreading, .. } = scene;
        let opening = front.filter(|_| *spreading).map(|front| front.direction.as_dvec3());
        Self {
            lengths,
            hinges: scene.hinges(),
            tolerance: scene.tolerance.into(),
            settings,
            config,
            spreading: *spreading,
            opening,
            last,
        }
    }

    /// Registers the points of one part, `own`, on a general motion, beginning with the estimate so far.
    pub(super) fn refine(&self, part: &JointEstimate, own: &PerState<Cloud>) -> JointEstimate {
        if self.too_few(own) {
            return *part;
        }
        let points = own.as_ref().map(|own| IndexedCloud::gridded(own, self.lengths.spacing));
        let options = self.options(&points, &part.motion);
        let free = register(both(&points), part.motion, None, &options);
        let slide = || self.slide(&points, &free, &options);
        let slides = self.may_slide(&free).then(slide).filter(|slide| self.as_many(slide, &free));
        general(&slides.unwrap_or(free))
    }

    /// Registers the points of one part on its joint, beginning with the motion so far. `known` is the type if the user
    /// gave it.
    pub(super) fn decide(&self, part: &JointEstimate, own: &PerState<Cloud>, known: Option<JointKind>) -> Decided {
        if self.too_few(own) {
            return Decided { joint: self.unregistered(part, known), general: None, misfit: f64::INFINITY };
        }
        let points = own.as_ref().map(|own| IndexedCloud::gridded(own, self.lengths.spacing));
        let options = self.options(&points, &part.motion);
        let free = register(both(&points), part.motion, None, &options);
        let (kind, fit) = match known {
            Some(kind) => (kind, on_joint(&points, &free, kind, &options)),
            None => self.choose(&points, &free, &options),
        };
        let joint = JointEstimate { rms: fit.rms, ..JointEstimate::new(kind, fit.motion) };
        let is_general = self.is_general(&free, &fit, kind);
        let may_turn = known.is_none_or(|known| known == JointKind::Screw);
        let turn = may_turn.then(|| self.turn(&points, &free, is_general, kind, &options)).flatten();
        let turn = turn.map(|screw| general(&screw));
        if let (Some(screw), Some(JointKind::Screw)) = (turn, known) {
            return Decided { joint: screw, general: None, misfit: 0.0 };
        }
        let misfit = if turn.is_some() { f64::INFINITY } else { self.misfit(&free, &fit) };
        Decided { joint, general: turn.or(is_general.then(|| general(&free))), misfit }
    }

    /// The turn of a part that looks alike from many sides and slides by more than noise; none of parts that slide and
    /// turn in a way that their surface shows.
    fn turn(
        &self,
        points: &PerState<IndexedCloud<'_>>,
        free: &Registration,
        is_general: bool,
        kind: JointKind,
        options: &RegistrationOptions,
    ) -> Option<Registration> {
        let middle = points[State::START].cloud.middle().as_dvec3();
        let may_turn = match kind {
            JointKind::Screw => true,
            JointKind::Prismatic => self.slides(free.motion.apply(middle).distance(middle)),
            JointKind::Revolute => is_general,
        };
        let spacing = f64::from(self.lengths.spacing);
        may_turn.then(|| turned(points, &free.motion, options, spacing, &self.settings.screws)).flatten()
    }

    fn too_few(&self, own: &PerState<Cloud>) -> bool {
        own.iter().any(|c| c.len() < self.settings.least_points)
    }

    fn options(&self, points: &PerState<IndexedCloud<'_>>, motion: &Rigid) -> RegistrationOptions {
        let spacing = f64::from(self.lengths.spacing);
        let (iterations, max_points) = self.settings.effort[usize::from(self.last)];
        let first_reach = self.settings.reach * spacing;
        let either_side = shows_other_side(both(points), motion, first_reach);
        RegistrationOptions { first_reach, last_reach: spacing, iterations, max_points, either_side }
    }

    /// True if the turn of a free motion may be an error of noisy points.
    fn may_slide(&self, free: &Registration) -> bool {
        let turn = free.motion.angle().to_degrees();
        self.spreading && self.config.decide_joints && turn < self.settings.sure_turn * self.config.revolute_deg
    }

    /// The slide of a part; along the opening if that matches nearly as many points: a flat face says little about shifts along itself.
    fn slide(
        &self,
        points: &PerState<IndexedCloud<'_>>,
        free: &Registration,
        options: &RegistrationOptions,
    ) -> Registration {
        let any = on_joint(points, free, JointKind::Prismatic, options);
        let Some(opening) = self.opening else { return any };
        // In the end, the direction of a slide that has not wandered off is better than that of the front; see `rails`.
        let off = any.motion.translation.angle_between(opening).to_degrees();
        if self.last && off.min(180.0 - off) < self.settings.wandered_deg {
            return any;
        }
        let length = register_along(both(points), opening, any.motion.translation.dot(opening), options);
        let along = Rigid::shift(opening * length);
        let pairs =
            |motion: &Rigid| matched(both(points), motion, options.last_reach, options.max_points, false) as f64;
        let as_many = pairs(&along) > self.settings.noisy_as_many * pairs(&any.motion);
        if as_many { Registration { motion: along, ..any } } else { any }
    }

    /// True if a slide matches nearly as many points as a motion that turns, too.
    fn as_many(&self, slide: &Registration, other: &Registration) -> bool {
        slide.pairs as f64 > self.settings.noisy_as_many * other.pairs as f64
    }

    /// True if a slide along an axis is more than noise.
    fn slides(&self, slide: f64) -> bool {
        let least = self.settings.slide_spacings * f64::from(self.lengths.spacing);
        slide.abs() > least.max(self.settings.slide_tolerances * self.tolerance)
    }

    /// True if a motion surely turns and slides along its axis, and fits clearly better than the `joint` of this kind.
    fn is_general(&self, free: &Registration, joint: &Registration, kind: JointKind) -> bool {
        let screw = free.motion.screw();
        let surely = screw.angle.to_degrees() > self.settings.sure_turn * self.config.revolute_deg;
        if kind == JointKind::Screw || !surely || !self.slides(screw.slide) {
            return false;
        }
        let rms = |r: &Registration| r.rms.unwrap_or(f64::INFINITY);
        let (pairs, as_joint) = (free.pairs as f64, joint.pairs as f64);
        let better = pairs > self.settings.as_many * as_joint && rms(free) < self.settings.much_better * rms(joint);
        better || pairs > self.settings.more * as_joint
    }

    /// Nats by which a joint fits worse than a free motion: residuals of normal distributions, and pairs that it does not match.
    fn misfit(&self, free: &Registration, joint: &Registration) -> f64 {
        /// Pairs of which the errors count as one.
        const SHARED: f64 = 100.0;
        /// Least root mean square distance, depth tolerances: below it, residuals are errors of the measurement.
        const LEAST: f64 = 0.5;
        let rms = |r: &Registration| r.rms.unwrap_or(f64::INFINITY).max(LEAST * self.tolerance);
        let (all, matched) = (free.pairs.max(1) as f64, joint.pairs.max(1) as f64);
        all / SHARED * ((rms(joint) / rms(free)).ln().max(0.0) + (all / matched).ln().max(0.0))
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
            return (JointKind::Prismatic, self.slide(points, free, options));
        }
        let hinge = fit(JointKind::Revolute);
        if !self.hinges.can_move(&hinge.motion) {
            return (JointKind::Prismatic, self.slide(points, free, options));
        }
        if turn > settings.sure_turn * revolute_deg {
            return (JointKind::Revolute, hinge);
        }
        let slide = self.slide(points, free, options);
        let rms = |r: &Registration| r.rms.unwrap_or(f64::INFINITY);
        let as_many = hinge.pairs as f64 > settings.as_many * slide.pairs as f64;
        let within_noise =
            self.spreading && self.as_many(&slide, &hinge) && rms(&slide) < settings.noisy_rms * self.tolerance;
        let better = rms(&hinge) < settings.better * rms(&slide) && as_many;
        let hinge_wins = !within_noise && (turn > revolute_deg || better);
        if hinge_wins { (JointKind::Revolute, hinge) } else { (JointKind::Prismatic, slide) }
    }
}

fn general(fit: &Registration) -> JointEstimate {
    JointEstimate { rms: fit.rms, ..JointEstimate::new(JointKind::Screw, fit.motion) }
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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A front of 0.6 x 0.3 with a box behind it, seen at the start and moved by `motion`, with noise along the normals.
    fn drawer(motion: &Rigid, noise: f32) -> PerState<Cloud> {
        let mut clouds = PerState::<Cloud>::default();
        let wave = |i: usize, s: State| noise * ((i * (3 + 4 * s.index())) as f32 * 0.7).sin();
        let mut add = |i: usize, p: Vec3, n: Vec3| {
            for s in State::ALL {
                let at = p + n * wave(i, s);
                let (p, n) = match s {
                    State::START => (at, n),
                    _ => (motion.apply(at.as_dvec3()).as_vec3(), motion.turn(n.as_dvec3()).as_vec3()),
                };
                let cloud = &mut clouds[s];
                cloud.points.push(p);
                cloud.normals.push(n);
                cloud.colors.push(Vec3::ZERO);
                cloud.roughness.push(noise);
            }
        };
        for i in 0..1800 {
            let (u, v) = ((i % 60) as f32 * 0.01, (i / 60) as f32 * 0.01);
            add(i, Vec3::new(u, 0.0, v), Vec3::NEG_Y);
        }
        for i in 0..300 {
            let (u, v) = ((i % 20) as f32 * 0.01, (i / 20) as f32 * 0.01);
            add(i, Vec3::new(0.05, u, v), Vec3::NEG_X);
        }
        clouds
    }

    fn decided(motion: &Rigid, spreading: bool) -> JointEstimate {
        let (lengths, settings, config) =
            (Lengths { spacing: 0.01, diagonal: 1.6 }, JointSettings::default(), DiscoverConfig::default());
        let opening = spreading.then_some(DVec3::NEG_Y);
        let fit = JointFit {
            lengths: &lengths,
            hinges: HingeBall { middle: DVec3::ZERO, radius: 1.6 },
            tolerance: 0.012,
            settings: &settings,
            config: &config,
            spreading,
            opening,
            last: true,
        };
        let own = drawer(motion, 0.002);
        fit.decide(&fit.refine(&JointEstimate::new(JointKind::Screw, *motion), &own), &own, None).joint
    }

    #[test]
    fn a_small_turn_of_noisy_points_is_a_slide_along_the_opening() {
        // What noise makes of a drawer that opens by 0.15: it turns by half a degree and drifts aside.
        let turned = Rigid::about(DVec3::Z, DVec3::new(0.3, 0.0, 0.0), 0.5f64.to_radians());
        let wandered = Rigid::shift(DVec3::new(0.004, -0.15, 0.003)) * turned;
        let slide = decided(&wandered, true);
        assert_eq!(slide.kind, JointKind::Prismatic);
        let off = slide.motion.translation.angle_between(DVec3::NEG_Y).to_degrees();
        assert!(off < 2.0 && (slide.motion.translation.length() - 0.15).abs() < 0.004, "{:?}", slide.motion);
    }

    #[test]
    fn a_small_turn_about_an_axis_far_from_the_object_is_a_slide() {
        // 3 degrees about an axis that is 4 away.
        let turned = decided(&Rigid::about(DVec3::Z, DVec3::new(4.0, 0.0, 0.0), 3f64.to_radians()), false);
        assert_eq!(turned.kind, JointKind::Prismatic);
        let door = decided(&Rigid::about(DVec3::Z, DVec3::new(0.7, 0.0, 0.0), 3f64.to_radians()), false);
        assert_eq!(door.kind, JointKind::Revolute);
    }

    #[test]
    fn a_door_that_opens_a_little_stays_a_hinge_where_depth_is_noisy() {
        let door = decided(&Rigid::about(DVec3::Z, DVec3::ZERO, 9f64.to_radians()), true);
        assert_eq!(door.kind, JointKind::Revolute);
        assert!((door.motion.angle().to_degrees() - 9.0).abs() < 0.5, "{:?}", door.motion);
    }
}
