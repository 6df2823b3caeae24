//! Which part of the object a place belongs to, and how far it is from the true surface.

use artgs::evaluate::sample_surface;

use artgs_core::{Inside, Mesh, PerState, Rigid, State};
use artgs_io::GroundTruth;
use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

/// Points of the true surface of each part.
const SAMPLES: usize = 40_000;
/// Distance between the rays that decide what is inside, as a share of the diagonal.
const RAYS: f64 = 0.005;

/// The true surface, as labelled points.
struct Surface {
    tree: ImmutableKdTree<f64, 3>,
    labels: Vec<u16>,
}

impl Surface {
    fn new(parts: &[Vec<[f64; 3]>]) -> Option<Self> {
        let points: Vec<[f64; 3]> = parts.iter().flatten().copied().collect();
        let labels = parts.iter().enumerate().flat_map(|(k, part)| vec![k as u16; part.len()]).collect();
        ImmutableKdTree::new_from_slice(&points).ok().filter(|_| !points.is_empty()).map(|tree| Self { tree, labels })
    }

    fn at(&self, p: [f32; 3]) -> (u16, f64) {
        let found = self.tree.query(&p.map(f64::from)).nearest_one::<SquaredEuclidean<f64>>().execute();
        (self.labels[found.item as usize], found.distance.sqrt())
    }
}

/// The ground truth of an object, ready for questions about places. Part 0 is static, part `k` has the joint `k - 1`.
pub(super) struct TrueParts {
    surfaces: PerState<Surface>,
    canonical: Surface,
    inside: PerState<Option<Inside>>,
    /// Motion from canonical to end, `[K]`, that of the static part first.
    pub(super) half_motions: Vec<Rigid>,
    /// Mean of the surface of every part in the canonical frame, `[K]`.
    pub(super) centres: Vec<DVec3>,
    /// Of the box around the object at start, scene units.
    pub(super) diagonal: f64,
}

impl TrueParts {
    /// None if a part has no surface.
    pub(super) fn new(truth: &GroundTruth) -> Option<Self> {
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let meshes = |state: State| -> Vec<&Mesh> {
            std::iter::once(&truth.fixed[state]).chain(truth.movable.iter().map(|m| &m[state])).collect()
        };
        let sampled: PerState<Vec<Vec<[f64; 3]>>> =
            PerState::from_fn(|s| meshes(s).into_iter().map(|m| sample_surface(m, SAMPLES, &mut rng)).collect());
        let half = (0..truth.joints.len()).map(|k| truth.start_to_end(k).power(0.5));
        let half_motions: Vec<Rigid> = std::iter::once(Rigid::IDENTITY).chain(half).collect();
        let moved = |(points, motion): (&Vec<[f64; 3]>, &Rigid)| -> Vec<[f64; 3]> {
            points.iter().map(|p| motion.apply(DVec3::from_array(*p)).to_array()).collect()
        };
        let canonical: Vec<_> = sampled[State::START].iter().zip(&half_motions).map(moved).collect();
        let mean = |points: &Vec<[f64; 3]>| {
            points.iter().map(|p| DVec3::from_array(*p)).sum::<DVec3>() / points.len().max(1) as f64
        };
        let whole = &truth.whole;
        let diagonal = box_diagonal(&whole[State::START]);
        Some(Self {
            surfaces: PerState::try_from_fn(|s| Surface::new(&sampled[s]))?,
            centres: canonical.iter().map(mean).collect(),
            canonical: Surface::new(&canonical)?,
            inside: PerState::from_fn(|s| inside(&whole[s], RAYS * diagonal)),
            half_motions,
            diagonal,
        })
    }

    /// Number of parts, the static one included.
    pub(super) fn parts(&self) -> usize {
        self.half_motions.len()
    }

    /// Part of the nearest true surface in a state, and the distance from it.
    pub(super) fn at(&self, p: [f32; 3], state: State) -> (u16, f64) {
        self.surfaces[state].at(p)
    }

    /// The same in the canonical frame.
    pub(super) fn at_canonical(&self, p: [f32; 3]) -> (u16, f64) {
        self.canonical.at(p)
    }

    /// True if the object encloses a place in a state.
    pub(super) fn encloses(&self, p: [f32; 3], state: State) -> bool {
        let place = DVec3::from_array(p.map(f64::from));
        self.inside[state].as_ref().is_some_and(|inside| inside.holds(place))
    }
}

fn inside(mesh: &Mesh, finest: f64) -> Option<Inside> {
    let points: Vec<DVec3> = mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from))).collect();
    Inside::of(&points, &mesh.triangles, finest)
}

fn box_diagonal(mesh: &Mesh) -> f64 {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for v in &mesh.vertices {
        let p = DVec3::from_array(v.map(f64::from));
        (low, high) = (low.min(p), high.max(p));
    }
    if mesh.vertices.is_empty() { 1.0 } else { (high - low).length().max(1e-12) }
}
