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
//! let found = discover(&scene, 1..=8, &config)?;
//! for part in &found.parts {
//!     println!("{:?} with confidence {:?}", part.kind, part.confidence);
//! }
//! # Ok(())
//! # }
//! ```

mod bodies;
mod by_energy;
mod candidates;
pub(crate) mod cloud;
mod confidence;
mod config;
mod contradictions;
mod correct;
mod cube_votes;
mod denoise;
pub(crate) mod diagnosis;
mod extents;
mod face_motions;
mod facets;
mod flatten;
mod front;
pub(crate) mod graph_cut;
mod instances;
mod joints;
mod known;
mod landing;
mod morton;
mod moved_points;
mod narrow;
mod near_grid;
mod oblique;
mod paired_mean;
mod parents;
pub(crate) mod plane_fit;
mod poses;
mod rails;
mod ranking;
mod refinement;
pub(crate) mod registration;
mod same_joint;
pub(crate) mod scene;
mod screws;
pub(crate) mod segmentation;
mod selection;
mod space_grid;
mod support;
mod surface_paths;
#[cfg(test)]
mod test_scene;
mod twins;
pub(crate) mod visibility;

use crate::explain::{ExplainSettings, Explanation, Problem, SearchSettings, Surfels};
use crate::observer::{Share, within};
use artgs_core::{Joint, JointAlternative, JointEstimate, PerState, Rigid, State};
use by_energy::with_parts_by_energy;
use candidates::{Candidate, Search, SearchState};
pub use cloud::Cloud;
use cloud::{IndexedCloud, components};
pub use config::DiscoverConfig;
use config::StepSettings;
use contradictions::explaining_enough;
pub use correct::{CorrectError, correct};
use front::Front;
use glam::{DVec3, Vec3};
use known::{KnownFits, KnownLandings, KnownSamples};
pub use moved_points::{MovedPoints, moved_points};
use narrow::with_doubts_of_narrow;
use oblique::with_doubts_of_oblique;
use refinement::{Parts, Refinement};
pub use scene::{DepthPicture, Scene, pixel_step};
use segmentation::Graph;
use selection::Selection;
use space_grid::SpaceGrid;
use std::cell::RefCell;
use std::ops::RangeInclusive;
pub use support::Support;
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
    /// Other joints that explain part `k + 1` nearly as well, the most likely first. Parts beyond its end have none.
    pub alternatives: Vec<Vec<JointAlternative>>,
    /// Diagonal of the object's bounding box, scene units.
    pub diagonal: f64,
    /// Distance between neighbouring points, scene units.
    pub spacing: f64,
    /// Depth tolerance used, scene units.
    pub tolerance: f64,
    /// True if the tolerance follows from depth noise, false if it follows from the size of a pixel.
    pub noisy: bool,
    /// What is doubtful, one sentence each.
    pub warnings: Vec<String>,
    /// What supports the joint of each part.
    pub support: Vec<Support>,
}

impl Discovery {
    /// Joints of the movable parts against the parts that carry them, in the order of `parts`: world frame of the start state, with the origin
    /// near the part, and values 0 there.
    pub fn joints(&self) -> Vec<Joint> {
        let near = |(i, part): (usize, &JointEstimate)| part.joint_near(&self.parts, self.middle(i + 1, State::START));
        self.parts.iter().enumerate().map(near).collect()
    }

    /// Mean of a part's points in a state, world frame; the origin if it has none there.
    pub fn middle(&self, part: usize, state: State) -> DVec3 {
        let points = self.clouds[state].points.iter().zip(&self.labels[state]);
        let own = points.filter(|(_, label)| usize::from(**label) == part).map(|(p, _)| p.as_dvec3());
        let (sum, count) = own.fold((DVec3::ZERO, 0usize), |(sum, count), p| (sum + p, count + 1));
        sum / count.max(1) as f64
    }

    /// Share of `moved` points, those that moved for certain, that the joints of the parts explain without contradiction, each
    /// weighted by its confidence.
    fn quality(&self, moved: usize) -> f64 {
        let parts = self.parts.iter().zip(&self.support);
        let own = |s: &Support| s.explained * (1.0 - s.contested) * s.moved;
        let explained = parts.map(|(part, s)| part.confidence.unwrap_or(0.0) * own(s)).sum::<f64>();
        explained / moved.max(1) as f64
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
    /// Most of what differs between the states is no motion.
    #[error(
        "{:.0} % of all surfaces differ between the two states and no motion explains them: the states show different objects, or are \
         misaligned; check that both show the same object in the same place", 100.0 * .0
    )]
    Unexplained(f64),
    /// The found motions move the whole object.
    #[error(
        "only {:.0} % of all surfaces rest between the two states: the object was moved as a whole, what rests was hardly recorded, or the \
         poses of the states are in different frames; leave the object where it is, record what rests as well, and give recordings in frames \
         of their own one by one, which aligns them: artgs reconstruct CLOSED OPEN -o OUT", 100.0 * .0
    )]
    NothingRests(f64),
}

/// Finds the movable parts, as many as `movable` allows, and labels every surface point. If it allows none, and no part saves what
/// it costs, there are none: what differs between the states is noise.
pub fn discover(
    scene: &Scene,
    movable: RangeInclusive<usize>,
    config: &DiscoverConfig,
) -> Result<Discovery, DiscoverError> {
    discover_with_progress(scene, movable, config, &mut |_| ())
}

/// The same; `done` takes the share of the work that is done.
pub fn discover_with_progress(
    scene: &Scene,
    movable: RangeInclusive<usize>,
    config: &DiscoverConfig,
    done: Share<'_>,
) -> Result<Discovery, DiscoverError> {
    let may_rest = *movable.start() == 0;
    best_parts(scene, (*movable.start()).max(1)..=*movable.end(), may_rest, config, done)
}

/// Shares of the work until candidate motions, and until the parts of the first explanation are known: rough, to show
/// progress.
const SEARCHED: f64 = 0.4;
const REFINED: f64 = 0.85;

/// Largest number of candidates.
const POOL: usize = 120;

/// Rounds of the search for candidates beyond one per part, for parts whose first motion is wrong.
const EXTRA_ROUNDS: usize = 2;

/// Share of what remains of the refinement that one of its rounds is shown as.
const OF_REMAINING: f64 = 0.4;

/// At least one part; if all `may_rest`, none where no part saves what it costs.
fn best_parts(
    scene: &Scene,
    movable: RangeInclusive<usize>,
    may_rest: bool,
    config: &DiscoverConfig,
    done: Share<'_>,
) -> Result<Discovery, DiscoverError> {
    let clouds = scene.indexed_clouds();
    let settings = StepSettings::default();
    let evidence = Evidence::new(scene, &settings)?;
    let grids = evidence.grids(scene, &clouds, config);
    let search = evidence.search(scene, (&clouds, &grids), &movable, config, &settings);
    let pool = search.candidates(*movable.end() + EXTRA_ROUNDS, POOL, &mut within(done, 0.0, SEARCHED));
    done(SEARCHED);
    let front = evidence.front(scene, &clouds, &settings);
    let ranking = (&settings.ranking, front);
    let selection = Selection::new(scene, &clouds, &evidence.moved, &pool, settings.selection, ranking);
    // Their number is not known before: each takes a part of what is left of the bar.
    let remaining = RefCell::new((1.0, within(done, SEARCHED, REFINED)));
    let begun = || {
        let (remaining, done) = &mut *remaining.borrow_mut();
        done(1.0 - *remaining);
        *remaining *= 1.0 - OF_REMAINING;
    };
    let work =
        Refinement { scene, clouds: &clouds, evidence: &evidence, config, settings: &settings, front, begun: &begun };
    let motions = |chosen: Vec<usize>| chosen.into_iter().map(|c| pool[c].motion).collect::<Vec<Rigid>>();
    let result = |parts: Parts| evidence.result(scene, &clouds, parts, Vec::new(), &pool, &settings);
    let chosen = selection.best(1..=*movable.end());
    let count = chosen.len();
    let mut found = work.parts(&motions(chosen), &movable);
    if found.parts.len() < *movable.start() {
        let count = count + movable.start() - found.parts.len();
        let more = work.parts(&motions(selection.best(count..=count)), &movable);
        if more.parts.len() > found.parts.len() {
            found = more;
        }
    }
    let mut warnings = Vec::new();
    if found.parts.len() < *movable.start() {
        let (count, movable) = (found.parts.len(), movable.start());
        warnings.push(format!("{movable} movable parts were asked for but only {count} distinct motions were found"));
    }
    remaining.borrow_mut().1(1.0);
    let found = evidence.result(scene, &clouds, found, warnings, &pool, &settings);
    let surfels = Surfels::new(scene, &ExplainSettings::DEFAULT);
    let mut problem = Problem::new(scene, &surfels, ExplainSettings::DEFAULT);
    let bodies = settings.bodies.motions(&search, scene, &clouds, &settings);
    let proposed: Vec<Rigid> = pool.iter().map(|c| c.motion).collect();
    let better =
        with_parts_by_energy(&found, &bodies, (&mut problem, &surfels.clouds), &work, &movable, &proposed, &result);
    let moved = evidence.total();
    let mut kept = |found: Discovery| {
        let search = SearchSettings::default();
        let explanation = problem.explained(&found, &search);
        if may_rest && problem.is_at_rest(&explanation, &search) {
            let at_rest = Explanation::without_parts(problem.surfels());
            return explaining_enough(without_parts(scene), problem.unexplained_share(&at_rest), moved, config);
        }
        explaining_enough(found, problem.unexplained_share(&explanation), moved, config)
    };
    // An explanation that would be refused, such as one in which nothing rests, is no better one.
    let found = better.and_then(|better| kept(better).ok()).map_or_else(|| kept(found), Ok)?;
    if found.parts.is_empty() {
        return Ok(found);
    }
    let found = with_intervals(found, &problem);
    Ok(if scene.spreading { with_doubts_of_oblique(with_doubts_of_narrow(found)) } else { found })
}

/// With the interval of each joint.
fn with_intervals(mut found: Discovery, problem: &Problem<'_>) -> Discovery {
    let intervals = problem.intervals(&found);
    found.parts.iter_mut().zip(intervals).for_each(|(part, interval)| part.interval = interval);
    found
}

/// What the depth maps of the other state show at the points of each state, and how these are connected.
struct Evidence {
    occupancy: PerState<Vec<Occupancy>>,
    /// Points at whose place the other state shows empty space.
    moved: PerState<Vec<usize>>,
    /// Points whose place the other state does not show.
    unseen: PerState<Vec<usize>>,
    /// Which points are next to each other.
    graphs: PerState<Graph>,
    /// What refinements have found out.
    landings: KnownLandings,
    samples: KnownSamples,
    fits: KnownFits,
}

/// Fewer moved points are noise.
const LEAST_MOVED: usize = 24;

/// Where depth is noisy, a smaller share of the points is noise.
const LEAST_NOISY_SHARE: f64 = 0.003;

/// Where depth is noisy, moved points are noise if none of their connected groups has this share of the points. Of moved
/// parts in simulated phone captures the smallest group had 2.4 %; of a cabinet that stood still before a structured-light
/// camera the largest had 0.22 %.
const LEAST_NOISY_GROUP: f64 = 0.006;

impl Evidence {
    fn new(scene: &Scene, settings: &StepSettings) -> Result<Self, DiscoverError> {
        let mut occupancy = PerState::from_fn(|s| scene.occupancy_elsewhere(s));
        if scene.noisy {
            for (state, at) in State::ALL.into_iter().zip(occupancy.iter_mut()) {
                scene.without_speckles(state, at);
            }
        }
        let [moved, unseen] = [Occupancy::Empty, Occupancy::Unseen]
            .map(|what| occupancy.as_ref().map(|at| (0..at.len()).filter(|&i| at[i] == what).collect::<Vec<usize>>()));
        let (graphs, landings, samples, fits) = Default::default();
        let evidence = Self { occupancy, moved, unseen, graphs, landings, samples, fits };
        let points: usize = evidence.occupancy.iter().map(Vec::len).sum();
        let least =
            if scene.noisy { LEAST_MOVED.max((LEAST_NOISY_SHARE * points as f64) as usize) } else { LEAST_MOVED };
        let scattered = scene.spreading && evidence.largest_group(scene) < LEAST_NOISY_GROUP;
        if evidence.total() < least || scattered {
            return Err(DiscoverError::NothingMoved);
        }
        let graphs = scene.states.as_ref().map(|s| settings.graph.graph(&s.cloud, scene.lengths.spacing));
        Ok(Self { graphs, ..evidence })
    }

    /// Share of the points of a state in its largest connected group of moved points; of both states the larger one.
    fn largest_group(&self, scene: &Scene) -> f64 {
        let reach = candidates::CandidateSettings::default().cluster_reach * scene.lengths.spacing;
        let share = |state: State| {
            let groups = components(&scene.states[state].cloud, &self.moved[state], reach, 1);
            groups.first().map_or(0, Vec::len) as f64 / self.occupancy[state].len().max(1) as f64
        };
        State::ALL.map(share).into_iter().fold(0.0, f64::max)
    }

    /// Number of moved points.
    fn total(&self) -> usize {
        self.moved.iter().map(Vec::len).sum()
    }

    /// The side on which the object opens, if it has one.
    fn front(&self, scene: &Scene, clouds: &PerState<IndexedCloud<'_>>, settings: &StepSettings) -> Option<Front> {
        let (poses, diagonal) = (&settings.candidates.poses, scene.lengths.diagonal);
        settings.front.find(clouds, &self.occupancy, poses, diagonal, scene.spreading)
    }

    /// What is near each place of the other state.
    fn grids(
        &self,
        scene: &Scene,
        clouds: &PerState<IndexedCloud<'_>>,
        config: &DiscoverConfig,
    ) -> PerState<SpaceGrid> {
        /// The grid reaches past the object by this fraction of its diagonal.
        const MARGIN: f32 = 0.05;
        let pad = Vec3::splat(MARGIN * scene.lengths.diagonal);
        let voxel = config.voxel as f32 * scene.lengths.diagonal;
        let grid = |s: State| {
            let (lower, upper) = (scene.lower - pad, scene.upper + pad);
            SpaceGrid::new(clouds[s].cloud, &scene.states[s].views, lower, upper, voxel, scene.tolerance)
        };
        let (start, end) = rayon::join(|| grid(State::START), || grid(State::END));
        PerState::new(start, end)
    }

    /// Candidate motions for `movable` parts.
    fn candidates(
        &self,
        scene: &Scene,
        clouds: &PerState<IndexedCloud<'_>>,
        movable: &RangeInclusive<usize>,
        config: &DiscoverConfig,
        settings: &StepSettings,
    ) -> Vec<Candidate> {
        let grids = self.grids(scene, clouds, config);
        let search = self.search(scene, (clouds, &grids), movable, config, settings);
        search.candidates(movable.end() + EXTRA_ROUNDS, POOL, &mut |_| ())
    }

    /// The search for motions of `movable` parts.
    fn search<'a>(
        &'a self,
        scene: &Scene,
        (clouds, grids): (&'a PerState<IndexedCloud<'a>>, &'a PerState<SpaceGrid>),
        movable: &RangeInclusive<usize>,
        config: &DiscoverConfig,
        settings: &StepSettings,
    ) -> Search<'a> {
        /// Least share of the moved points that a round explains, where the number of parts is not given.
        const LEAST_ROUND: f64 = 0.01;
        let least_round = if movable.start() == movable.end() { config.least_share } else { LEAST_ROUND };
        let states = PerState::from_fn(|s| SearchState {
            points: &clouds[s],
            grid: &grids[s],
            moved: &self.moved[s],
            unseen: &self.unseen[s],
        });
        Search {
            states,
            lengths: scene.lengths,
            front: self.front(scene, clouds, settings),
            settings: settings.candidates,
            ranking: settings.ranking,
            least_gain: (config.least_share * self.total() as f64).max(LEAST_MOVED as f64),
            least_round: (least_round * self.total() as f64).max(LEAST_MOVED as f64),
        }
    }

    /// The result with its confidence, alternatives among the candidates `pool`, and warnings.
    fn result(
        &self,
        scene: &Scene,
        clouds: &PerState<IndexedCloud<'_>>,
        found: Parts,
        mut warnings: Vec<String>,
        pool: &[Candidate],
        settings: &StepSettings,
    ) -> Discovery {
        let support = settings.support.measure(scene, clouds, self, &found, pool);
        let Parts { mut parts, labels } = found;
        for (k, (part, support)) in parts.iter_mut().zip(&support).enumerate() {
            let fit = settings.diagnosis.fit(scene, &labels, k as u16 + 1, &part.motion);
            part.confidence = Some(settings.confidence.confidence(support, fit));
        }
        if scene.spreading
            && let Some(front) = self.front(scene, clouds, settings)
        {
            parts.iter_mut().for_each(|part| settings.confidence.doubt_across(part, front));
        }
        let others =
            parts.iter().zip(&support).map(|(part, s)| settings.confidence.alternatives(part, s, parts.len(), pool));
        let alternatives = others.collect();
        warnings.extend(settings.diagnosis.warnings(scene, &labels, &self.moved, &parts));
        Discovery { labels, parts, alternatives, support, warnings, ..without_parts(scene) }
    }
}

/// Surface points of both states and nothing else: no parts, all labels static.
pub fn without_parts(scene: &Scene) -> Discovery {
    let clouds = scene.states.as_ref().map(|s| s.cloud.clone());
    Discovery {
        labels: clouds.as_ref().map(|c| vec![0; c.len()]),
        clouds,
        parts: Vec::new(),
        alternatives: Vec::new(),
        diagonal: scene.lengths.diagonal.into(),
        spacing: scene.lengths.spacing.into(),
        tolerance: scene.tolerance.into(),
        noisy: scene.noisy,
        warnings: Vec::new(),
        support: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::test_scene::{laptop_scene, scene_of_two};
    use super::*;

    #[test]
    fn states_of_different_objects_are_refused_unless_any_share_may_be_unexplained() {
        let scene = scene_of_two(["storage", "washer"], 24, 96);
        let found = discover(&scene, 0..=4, &DiscoverConfig::default());
        let Err(DiscoverError::Unexplained(share)) = found else { panic!("{:?}", found.map(|f| f.parts)) };
        assert!(share > 0.5, "{share}");
        let any = DiscoverConfig::default().without_refusals();
        assert!(discover(&scene, 0..=4, &any).is_ok());
        // Joints that are sure may leave more, with a warning.
        let doubtful = DiscoverConfig { most_unexplained: 0.5, sure_quality: 0.0, ..DiscoverConfig::default() };
        let found = discover(&scene, 0..=4, &doubtful).unwrap();
        assert!(found.warnings.iter().any(|w| w.contains("% of all surfaces differ")), "{:?}", found.warnings);
        // Of one object in two states, nearly all is explained.
        let scene = scene_of_two(["storage"; 2], 24, 96);
        let sure = DiscoverConfig { most_unexplained: 0.2, sure_quality: 1.0, ..DiscoverConfig::default() };
        assert!(discover(&scene, 0..=4, &sure).is_ok_and(|found| found.parts.len() == 1));
    }

    #[test]
    fn a_laptop_that_is_closed_in_one_state_is_explained() {
        let found = discover(&laptop_scene(16, 120), 0..=4, &DiscoverConfig::default()).unwrap();
        assert_eq!(found.parts.len(), 1, "{:?}", found.parts);
        let degrees = found.parts[0].motion.angle().to_degrees();
        assert!((degrees - 91.0).abs() < 2.0, "{degrees}");
    }
}
