//! Part discovery from depth: what moved, by which motion, and which part every surface point belongs to.
//!
//! A point that the other state's depth maps look through has moved; one they hide is merely unseen. Motions are
//! searched for clusters of moved points, then parts and motions are refined in turn.

mod correct;
pub mod cut;
pub mod field;
mod glimpse;
pub mod label;
pub mod observe;
pub mod propose;
pub mod register;
mod scene;
pub mod select;

use artgs_core::{Joint, JointEstimate, JointKind, Rigid};
pub use correct::{CorrectError, correct};
use field::Field;
use glam::Vec3;
pub use glimpse::{Glimpse, glimpse};
use label::{AtRest, LabelCosts};
use observe::{Cloud, Sightings};
use propose::{Scales, Side};
use register::{Match, RegisterOptions, Searchable};
pub use scene::{DepthPicture, Scene, pixel_step};
use serde::{Deserialize, Serialize};

/// Settings of part discovery. Lengths are fractions of the object's diagonal unless said otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DiscoverConfig {
    /// Distance between the surface points that are labelled; never below one pixel.
    pub spacing: f64,
    /// Edge of a cube of the lookup grid.
    pub voxel: f64,
    /// A motion must explain at least this fraction of all moved points.
    pub least_share: f64,
    /// Rounds of labelling and registering.
    pub rounds: usize,
    /// Motions that turn less than this are slides, degrees, unless a hinge fits clearly better.
    pub revolute_deg: f64,
    /// Decide between hinge and slide and register parts on their joints. Otherwise, an ablation, they keep general rigid
    /// motions, and those that turn by more than `revolute_deg` are told revolute in the end.
    pub decide_joints: bool,
}

impl Default for DiscoverConfig {
    fn default() -> Self {
        Self {
            spacing: 1.0 / 160.0,
            voxel: 1.0 / 110.0,
            least_share: 0.004,
            rounds: 3,
            revolute_deg: 3.0,
            decide_joints: true,
        }
    }
}

/// Labelled surface points of both states and the motions of the parts.
#[derive(Clone, Debug, Default)]
pub struct Discovery {
    /// Surface points at start and end, world frame of each.
    pub clouds: [Cloud; 2],
    /// Part of every point; 0 is static.
    pub labels: [Vec<u16>; 2],
    /// Parts 1.., largest first.
    pub parts: Vec<JointEstimate>,
    /// Diagonal of the object's bounding box, scene units.
    pub diagonal: f64,
    /// Distance between neighbouring points, scene units.
    pub spacing: f64,
    /// Depth tolerance used, scene units.
    pub tolerance: f64,
    /// What was odd, one sentence each.
    pub warnings: Vec<String>,
}

/// Why parts could not be found.
#[derive(Debug, thiserror::Error)]
pub enum DiscoverError {
    /// No usable depth.
    #[error("no surface point could be back-projected from the {0} state: its depth maps are empty or torn")]
    NoSurface(&'static str),
    /// Nothing moved.
    #[error("nothing moved between the two states: check that `start` and `end` show different joint positions")]
    NothingMoved,
}

/// Finds the movable parts (`movable` of them) and labels every surface point.
pub fn discover(scene: &Scene, movable: usize, config: &DiscoverConfig) -> Result<Discovery, DiscoverError> {
    let search = scene.states.each_ref().map(|s| Searchable::new(&s.cloud));
    let seen = Seen::new(scene)?;
    let pool = seen.proposals(scene, &search, movable, config);
    let chosen = select::select(scene, &search, &seen.moved, &pool, movable);
    let mut warnings = Vec::new();
    if chosen.len() < movable {
        let found = chosen.len();
        warnings.push(format!("{movable} movable parts were asked for but only {found} distinct motions were found"));
    }
    let motions: Vec<Rigid> = chosen.iter().map(|&c| pool[c].motion).collect();
    let kinds = vec![None; motions.len()];
    let (parts, labels) = settle(scene, &search, &seen.at_rest, &motions, &kinds, config);
    Ok(seen.told(scene, parts, labels, warnings))
}

/// What the depth maps of the other state say about the points of each state.
struct Seen {
    at_rest: [Vec<AtRest>; 2],
    /// Points that the other state looks through.
    moved: [Vec<usize>; 2],
    /// Points that the other state does not see.
    unsure: [Vec<usize>; 2],
}

impl Seen {
    fn new(scene: &Scene) -> Result<Self, DiscoverError> {
        let at_rest = [0, 1].map(|s| scene.at_rest(s));
        let [moved, unsure] = [AtRest::Gone, AtRest::Unseen]
            .map(|what| at_rest.each_ref().map(|at| (0..at.len()).filter(|&i| at[i] == what).collect::<Vec<usize>>()));
        let seen = Self { at_rest, moved, unsure };
        if seen.total() < 24 { Err(DiscoverError::NothingMoved) } else { Ok(seen) }
    }

    fn total(&self) -> usize {
        self.moved[0].len() + self.moved[1].len()
    }

    /// Candidate motions for `movable` parts.
    fn proposals(
        &self,
        scene: &Scene,
        search: &[Searchable<'_>; 2],
        movable: usize,
        config: &DiscoverConfig,
    ) -> Vec<propose::Proposal> {
        let pad = Vec3::splat(0.05 * scene.scales.diagonal);
        let voxel = config.voxel as f32 * scene.scales.diagonal;
        let fields = [0, 1].map(|s| {
            let (lower, upper) = (scene.lower - pad, scene.upper + pad);
            Field::new(search[s].cloud, &scene.states[s].views, lower, upper, voxel, scene.tolerance)
        });
        let side =
            |s: usize| Side { points: &search[s], field: &fields[s], moved: &self.moved[s], unsure: &self.unsure[s] };
        let least = (config.least_share * self.total() as f64).max(24.0);
        propose::propose([&side(0), &side(1)], &scene.scales, movable + 2, 120, least)
    }

    /// The result, with doubts.
    fn told(
        &self,
        scene: &Scene,
        mut parts: Vec<JointEstimate>,
        labels: [Vec<u16>; 2],
        mut warnings: Vec<String>,
    ) -> Discovery {
        for (k, part) in parts.iter_mut().enumerate() {
            part.confidence = borne_out(scene, &labels, k as u16 + 1, &part.motion);
        }
        let clouds = scene.states.each_ref().map(|s| &s.cloud);
        warnings.extend(doubts(clouds, &labels, &self.moved, &parts, scene.tolerance));
        Discovery { labels, parts, warnings, ..undiscovered(scene) }
    }
}

/// Labels points and registers parts in turn, from motions start to end; the last round decides each joint, unless its
/// kind is known.
fn settle(
    scene: &Scene,
    search: &[Searchable<'_>; 2],
    at_rest: &[Vec<AtRest>; 2],
    motions: &[Rigid],
    kinds: &[Option<JointKind>],
    config: &DiscoverConfig,
) -> (Vec<JointEstimate>, [Vec<u16>; 2]) {
    let clouds = [search[0].cloud, search[1].cloud];
    let mut parts: Vec<JointEstimate> = motions.iter().map(|m| JointEstimate::new(JointKind::Screw, *m)).collect();
    let graphs = clouds.map(|c| label::neighbour_graph(&c.points, &c.normals, &c.colors, 10, scene.scales.spacing));
    let mut labels = [Vec::new(), Vec::new()];
    for round in 0..config.rounds.max(1) {
        let motions: Vec<Rigid> = parts.iter().map(|p| p.motion).collect();
        labels = label_points(scene, search, at_rest, &graphs, &motions);
        let last = round + 1 == config.rounds.max(1);
        for (k, part) in parts.iter_mut().enumerate() {
            refine(part, clouds, &labels, k as u16 + 1, &scene.scales, last, kinds[k], config);
        }
    }
    (parts, labels)
}

/// Signs that the number of parts is wrong: much that moved and fits no part, parts that hardly move or hardly exist.
fn doubts(
    clouds: [&Cloud; 2],
    labels: &[Vec<u16>; 2],
    moved: &[Vec<usize>; 2],
    parts: &[JointEstimate],
    tolerance: f32,
) -> Vec<String> {
    /// On clean captures with the right number of parts it is less than 0.002; with one part too few 0.013 and more.
    const LEFT_OVER: f64 = 0.01;
    let total = moved[0].len() + moved[1].len();
    let left = [0, 1].map(|s| moved[s].iter().filter(|&&i| labels[s][i] == 0).count()).iter().sum::<usize>();
    let mut said = Vec::new();
    let share = left as f64 / total.max(1) as f64;
    if share > LEFT_OVER {
        let percent = (100.0 * share).round();
        said.push(format!(
            "{percent} % of what moved fits none of the found motions: are there more parts than asked for?"
        ));
    }
    for (k, part) in parts.iter().enumerate() {
        let own: Vec<Vec3> =
            (0..labels[0].len()).filter(|&i| usize::from(labels[0][i]) == k + 1).map(|i| clouds[0].points[i]).collect();
        let way = |p: &Vec3| part.motion.apply(p.as_dvec3()).distance(p.as_dvec3());
        let farthest = own.iter().map(way).fold(0.0, f64::max);
        if farthest < 3.0 * f64::from(tolerance) {
            let number = k + 1;
            said.push(format!("part {number} hardly moves or is hardly seen: are there fewer parts than asked for?"));
        }
    }
    said
}

/// Share of a part's points that `motion` (start to end) takes onto a surface of the other state, of those that it takes
/// where that state is seen; none where too few points are in view there.
pub(crate) fn borne_out(scene: &Scene, labels: &[Vec<u16>; 2], part: u16, motion: &Rigid) -> Option<f64> {
    /// With fewer points in view the share says nothing.
    const FEW: usize = 24;
    let mut told = [0, 0];
    for state in 0..2 {
        let there = if state == 0 { *motion } else { motion.inverse() };
        let own = scene.states[state].cloud.points.iter().zip(&labels[state]).filter(|(_, label)| **label == part);
        let images: Vec<Vec3> = own.map(|(p, _)| there.apply(p.as_dvec3()).as_vec3()).collect();
        for seen in Sightings::of_all(&scene.states[1 - state].views, &images, scene.tolerance) {
            told[0] += usize::from(seen.is_surface());
            told[1] += usize::from(!seen.is_surface() && seen.is_empty_space());
        }
    }
    let total = told[0] + told[1];
    (total >= FEW).then(|| told[0] as f64 / total as f64)
}

/// Part of every point of both states under motions from start to end.
fn label_points(
    scene: &Scene,
    search: &[Searchable<'_>; 2],
    at_rest: &[Vec<AtRest>; 2],
    graphs: &[Vec<(u32, u32, f32)>; 2],
    motions: &[Rigid],
) -> [Vec<u16>; 2] {
    let costs = LabelCosts::default();
    let parts = motions.len() + 1;
    let landings = [0, 1].map(|s| {
        let moving = motions.iter().map(|m| if s == 0 { *m } else { m.inverse() });
        let to_other: Vec<Rigid> = std::iter::once(Rigid::IDENTITY).chain(moving).collect();
        scene.pair(search, s).landings(&to_other, &costs)
    });
    let label = |s: usize| {
        let spoken = label::part_costs(&landings[s], &landings[1 - s], &at_rest[1 - s], parts, &costs);
        let mut data = spoken.clone();
        label::add_astray_costs(&mut data, parts, &graphs[s], costs.astray);
        let mut labels = label::cheapest(&data, parts);
        cut::expand(&data, parts, &graphs[s], costs.smooth, &mut labels, 2);
        label::drop_islands(&mut labels, &spoken, parts, search[s].cloud, 1.8 * scene.scales.spacing);
        labels
    };
    let (start, end) = rayon::join(|| label(0), || label(1));
    [start, end]
}

/// Surface points of both states and nothing else: no parts, all labels static.
pub fn undiscovered(scene: &Scene) -> Discovery {
    let clouds = [&scene.states[0].cloud, &scene.states[1].cloud];
    Discovery {
        clouds: [clouds[0].clone(), clouds[1].clone()],
        labels: clouds.map(|c| vec![0; c.len()]),
        parts: Vec::new(),
        diagonal: scene.scales.diagonal.into(),
        spacing: scene.scales.spacing.into(),
        tolerance: scene.tolerance.into(),
        warnings: Vec::new(),
    }
}

/// Registers the points of one part; in the last round decides its joint, if asked to, and stays on it.
fn refine(
    part: &mut JointEstimate,
    clouds: [&Cloud; 2],
    labels: &[Vec<u16>; 2],
    label: u16,
    scales: &Scales,
    last: bool,
    known: Option<JointKind>,
    config: &DiscoverConfig,
) {
    let own = [0, 1].map(|s| {
        let members: Vec<usize> = (0..labels[s].len()).filter(|&i| labels[s][i] == label).collect();
        clouds[s].select(&members)
    });
    if own.iter().any(|c| c.len() < 12) {
        if last && config.decide_joints {
            // Too little to fit anything to: the motion as proposed, on the likelier joint.
            let turns = part.motion.angle().to_degrees() > config.revolute_deg;
            part.kind = known.unwrap_or(if turns { JointKind::Revolute } else { JointKind::Prismatic });
            part.motion = Joint::from_motion(part.kind, &part.motion).start_to_end();
        }
        return;
    }
    let points = [Searchable::new(&own[0]), Searchable::new(&own[1])];
    let spacing = f64::from(scales.spacing);
    let (iterations, max_points) = if last { (20, 20_000) } else { (12, 4000) };
    let options = RegisterOptions { first_reach: 3.0 * spacing, last_reach: spacing, iterations, max_points };
    let free = register::register(Match::mutual(&points[0], &points[1]), part.motion, None, &options);
    *part = JointEstimate { kind: JointKind::Screw, motion: free.motion, rms: free.rms, confidence: None };
    if last && config.decide_joints {
        let (kind, fit) = match known {
            Some(kind) => (kind, on_joint(&points, &free, kind, &options)),
            None => choose_joint(&points, &free, &options, config.revolute_deg),
        };
        *part = JointEstimate { kind, motion: fit.motion, rms: fit.rms, confidence: None };
    }
}

/// Registration on a joint of the given kind, from a free one.
fn on_joint(
    points: &[Searchable<'_>; 2],
    free: &register::Registration,
    kind: JointKind,
    options: &RegisterOptions,
) -> register::Registration {
    let guess = match kind {
        // A screw is whatever a rigid motion is.
        JointKind::Screw => return *free,
        JointKind::Revolute => Joint::from_motion(JointKind::Revolute, &free.motion).start_to_end(),
        JointKind::Prismatic => {
            // The shift of the part's centre, so that a small turn does not throw the slide off.
            let c = &points[0].cloud.points;
            let centre = (c.iter().sum::<Vec3>() / c.len() as f32).as_dvec3();
            Rigid::shift(free.motion.apply(centre) - centre)
        }
    };
    register::register(Match::mutual(&points[0], &points[1]), guess, Some(kind), options)
}

/// Slide or hinge: the simpler joint wins unless the other fits clearly better.
fn choose_joint(
    points: &[Searchable<'_>; 2],
    free: &register::Registration,
    options: &RegisterOptions,
    revolute_deg: f64,
) -> (JointKind, register::Registration) {
    let fit = |kind| on_joint(points, free, kind, options);
    if free.motion.angle().to_degrees() < 0.05 {
        return (JointKind::Prismatic, fit(JointKind::Prismatic));
    }
    let hinge = fit(JointKind::Revolute);
    if free.motion.angle().to_degrees() > 4.0 * revolute_deg {
        return (JointKind::Revolute, hinge);
    }
    let slide = fit(JointKind::Prismatic);
    let rms = |r: &register::Registration| r.rms.unwrap_or(f64::INFINITY);
    let hinge_wins = free.motion.angle().to_degrees() > revolute_deg
        || (rms(&hinge) < 0.7 * rms(&slide) && hinge.pairs as f64 > 0.95 * slide.pairs as f64);
    if hinge_wins { (JointKind::Revolute, hinge) } else { (JointKind::Prismatic, slide) }
}
