//! Part discovery from depth: what moved, by which motion, and which part every surface point belongs to.
//!
//! A point at whose place the other state's depth maps show empty space has moved; a place that they do not show says
//! nothing. `candidates` searches motions for clusters of moved points, `selection` chooses among them, and then parts
//! and motions are refined in turn: `segmentation` labels the points, `joints` registers the parts. `diagnosis`
//! reports what does not fit.
//!
//! ```no_run
//! use artgs::discover::{DepthPicture, DiscoverConfig, Scene, discover};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let capture = artgs_io::load_capture("my_capture".as_ref())?;
//! let pictures = capture.states.as_ref().map(|state| {
//!     let views = state.train.iter();
//!     views.filter_map(|view| Some(DepthPicture { view, depth: view.depth.as_ref()? })).collect::<Vec<_>>()
//! });
//! let config = DiscoverConfig::default();
//! let scene = Scene::new(pictures.as_ref().map(Vec::as_slice), &config)?;
//! let found = discover(&scene, 2, &config)?;
//! for part in &found.parts {
//!     println!("{:?} with confidence {:?}", part.kind, part.confidence);
//! }
//! # Ok(())
//! # }
//! ```

mod candidates;
pub(crate) mod cloud;
mod config;
mod correct;
pub(crate) mod diagnosis;
mod front;
mod graph_cut;
mod joints;
mod landing;
mod moved_points;
mod parents;
mod poses;
mod ranking;
pub(crate) mod registration;
pub(crate) mod scene;
mod screws;
mod segmentation;
mod selection;
mod space_grid;
pub(crate) mod visibility;

use artgs_core::{JointEstimate, JointKind, PerState, Rigid, State};
use candidates::{Candidate, Search, SearchState};
pub use cloud::Cloud;
use cloud::IndexedCloud;
pub use config::DiscoverConfig;
use config::StepSettings;
pub use correct::{CorrectError, correct};
use glam::{DVec3, Vec3};
use joints::JointFit;
pub use moved_points::{MovedPoints, moved_points};
use parents::{Carriers, Numbering, parents_first};
pub use scene::{DepthPicture, Scene, pixel_step};
use segmentation::Labelling;
use space_grid::SpaceGrid;
use visibility::Occupancy;

/// Labelled surface points of both states and the motions of the parts.
#[derive(Clone, Debug, Default)]
pub struct Discovery {
    /// Surface points, world frame of each state.
    pub clouds: PerState<Cloud>,
    /// Part of every point; 0 is static.
    pub labels: PerState<Vec<u16>>,
    /// Parts 1.., largest first, but parts that carry others before those.
    pub parts: Vec<JointEstimate>,
    /// Diagonal of the object's bounding box, scene units.
    pub diagonal: f64,
    /// Distance between neighbouring points, scene units.
    pub spacing: f64,
    /// Depth tolerance used, scene units.
    pub tolerance: f64,
    /// What is doubtful, one sentence each.
    pub warnings: Vec<String>,
}

impl Discovery {
    /// Mean of a part's points in a state, world frame; the origin if it has none there.
    pub fn middle(&self, part: usize, state: State) -> DVec3 {
        let points = self.clouds[state].points.iter().zip(&self.labels[state]);
        let own = points.filter(|(_, label)| usize::from(**label) == part).map(|(p, _)| p.as_dvec3());
        let (sum, count) = own.fold((DVec3::ZERO, 0usize), |(sum, count), p| (sum + p, count + 1));
        sum / count.max(1) as f64
    }
}

/// Why parts could not be found.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DiscoverError {
    /// No usable depth.
    #[error("no surface point could be computed from the {0} state: its depth maps are empty or too noisy")]
    NoSurface(&'static str),
    /// Nothing moved.
    #[error("nothing moved between the two states: check that `start` and `end` show different joint positions")]
    NothingMoved,
}

/// Finds the movable parts (`movable` of them) and labels every surface point.
pub fn discover(scene: &Scene, movable: usize, config: &DiscoverConfig) -> Result<Discovery, DiscoverError> {
    let clouds = scene.indexed_clouds();
    let evidence = Evidence::new(scene)?;
    let settings = StepSettings::default();
    let pool = evidence.candidates(scene, &clouds, movable, config, &settings);
    let chosen = selection::select(scene, &clouds, &evidence.moved, &pool, movable, &settings.selection);
    let mut warnings = Vec::new();
    if chosen.len() < movable {
        let found = chosen.len();
        warnings.push(format!("{movable} movable parts were asked for but only {found} distinct motions were found"));
    }
    let motions: Vec<Rigid> = chosen.iter().map(|&c| pool[c].motion).collect();
    let kinds = vec![None; motions.len()];
    let order = Numbering::ParentsFirst;
    let (parts, labels) = refine_parts(scene, &clouds, &evidence, &motions, &kinds, order, config, &settings);
    Ok(evidence.result(scene, parts, labels, warnings, &settings))
}

/// What the depth maps of the other state show at the points of each state.
struct Evidence {
    occupancy: PerState<Vec<Occupancy>>,
    /// Points at whose place the other state shows empty space.
    moved: PerState<Vec<usize>>,
    /// Points whose place the other state does not show.
    unseen: PerState<Vec<usize>>,
}

/// Fewer moved points are noise.
const LEAST_MOVED: usize = 24;

impl Evidence {
    fn new(scene: &Scene) -> Result<Self, DiscoverError> {
        let occupancy = PerState::from_fn(|s| scene.occupancy_elsewhere(s));
        let [moved, unseen] = [Occupancy::Empty, Occupancy::Unseen]
            .map(|what| occupancy.as_ref().map(|at| (0..at.len()).filter(|&i| at[i] == what).collect::<Vec<usize>>()));
        let evidence = Self { occupancy, moved, unseen };
        if evidence.total() < LEAST_MOVED { Err(DiscoverError::NothingMoved) } else { Ok(evidence) }
    }

    /// Number of moved points.
    fn total(&self) -> usize {
        self.moved.iter().map(Vec::len).sum()
    }

    /// Candidate motions for `movable` parts.
    fn candidates(
        &self,
        scene: &Scene,
        clouds: &PerState<IndexedCloud<'_>>,
        movable: usize,
        config: &DiscoverConfig,
        settings: &StepSettings,
    ) -> Vec<Candidate> {
        /// Largest number of candidates.
        const POOL: usize = 120;
        /// Rounds of the search beyond one per part, for parts whose first motion is wrong.
        const EXTRA_ROUNDS: usize = 2;
        /// The grid reaches past the object by this fraction of its diagonal.
        const MARGIN: f32 = 0.05;
        let pad = Vec3::splat(MARGIN * scene.lengths.diagonal);
        let voxel = config.voxel as f32 * scene.lengths.diagonal;
        let grids = PerState::from_fn(|s| {
            let (lower, upper) = (scene.lower - pad, scene.upper + pad);
            SpaceGrid::new(clouds[s].cloud, &scene.states[s].views, lower, upper, voxel, scene.tolerance)
        });
        let states = PerState::from_fn(|s| SearchState {
            points: &clouds[s],
            grid: &grids[s],
            moved: &self.moved[s],
            unseen: &self.unseen[s],
        });
        let poses = &settings.candidates.poses;
        let search = Search {
            states,
            lengths: scene.lengths,
            front: settings.front.find(clouds, &self.occupancy, poses, scene.lengths.diagonal),
            settings: settings.candidates,
            ranking: settings.ranking,
            least_gain: (config.least_share * self.total() as f64).max(LEAST_MOVED as f64),
        };
        search.candidates(movable + EXTRA_ROUNDS, POOL)
    }

    /// The result with its confidence and warnings.
    fn result(
        &self,
        scene: &Scene,
        mut parts: Vec<JointEstimate>,
        labels: PerState<Vec<u16>>,
        mut warnings: Vec<String>,
        settings: &StepSettings,
    ) -> Discovery {
        for (k, part) in parts.iter_mut().enumerate() {
            part.confidence = settings.diagnosis.joint_confidence(scene, &labels, k as u16 + 1, &part.motion);
        }
        warnings.extend(settings.diagnosis.warnings(scene, &labels, &self.moved, &parts));
        Discovery { labels, parts, warnings, ..without_parts(scene) }
    }
}

/// Labels points and registers parts in turn, from motions start to end; the last round decides each joint, unless its
/// kind is known, and what carries it.
#[expect(clippy::too_many_arguments, reason = "what was measured, what is known, how to number, and settings")]
fn refine_parts(
    scene: &Scene,
    clouds: &PerState<IndexedCloud<'_>>,
    evidence: &Evidence,
    motions: &[Rigid],
    kinds: &[Option<JointKind>],
    numbering: Numbering,
    config: &DiscoverConfig,
    settings: &StepSettings,
) -> (Vec<JointEstimate>, PerState<Vec<u16>>) {
    let mut parts: Vec<JointEstimate> = motions.iter().map(|m| JointEstimate::new(JointKind::Screw, *m)).collect();
    let graphs = clouds.as_ref().map(|c| settings.graph.graph(c.cloud, scene.lengths.spacing));
    let labelling = Labelling {
        scene,
        clouds,
        graphs: &graphs,
        occupancy: &evidence.occupancy,
        costs: settings.label_costs,
        settings: settings.segmentation,
    };
    let mut labels = PerState::default();
    let rounds = config.rounds.max(1);
    for round in 0..rounds {
        let motions: Vec<Rigid> = parts.iter().map(|p| p.motion).collect();
        labels = labelling.labels(&motions);
        let (lengths, tolerance, last) = (&scene.lengths, scene.tolerance.into(), round + 1 == rounds);
        let fit = JointFit { lengths, tolerance, settings: &settings.joints, config, last };
        let own = |part: usize| points_of_part(clouds, &labels, part as u16);
        if last && config.decide_joints {
            let clouds = (0..=parts.len()).map(own).collect();
            let carriers = Carriers { fit: &fit, settings: &settings.parents, clouds, numbering };
            parts = carriers.joints(&parts, kinds);
        } else {
            parts.iter_mut().enumerate().for_each(|(k, part)| *part = fit.refine(part, &own(k + 1)));
        }
    }
    if numbering == Numbering::ParentsFirst {
        parents_first(&mut parts, &mut labels);
    }
    (parts, labels)
}

/// Points of one part in every state.
fn points_of_part(clouds: &PerState<IndexedCloud<'_>>, labels: &PerState<Vec<u16>>, part: u16) -> PerState<Cloud> {
    PerState::from_fn(|s: State| {
        let members: Vec<usize> = (0..labels[s].len()).filter(|&i| labels[s][i] == part).collect();
        clouds[s].cloud.select(&members)
    })
}

/// Surface points of both states and nothing else: no parts, all labels static.
pub fn without_parts(scene: &Scene) -> Discovery {
    let clouds = scene.states.as_ref().map(|s| s.cloud.clone());
    Discovery {
        labels: clouds.as_ref().map(|c| vec![0; c.len()]),
        clouds,
        parts: Vec::new(),
        diagonal: scene.lengths.diagonal.into(),
        spacing: scene.lengths.spacing.into(),
        tolerance: scene.tolerance.into(),
        warnings: Vec::new(),
    }
}
