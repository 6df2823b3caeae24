//! Parts that move alike: one motion, several rigid bodies. Points of both states are brought together in the frame of the
//! start state, where each body is seen from both states; then bodies are told apart by the space between them.

use super::cloud::{Cloud, IndexedCloud, components};
use super::front::Front;
use super::scene::Scene;
use super::visibility::ViewVotes;
use artgs_core::{PerState, Rigid, State};
use glam::Vec3;

/// Settings of the search for parts that move alike. Calibrated on `twin_drawers`, `drawers_12` and single drawers and doors
/// of the stand-ins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct InstanceSettings {
    /// Two points this close belong to one body, spacings.
    pub(crate) reach: f32,
    /// Least share of a part's points in a body.
    pub(crate) least_share: f32,
    /// Least points of a body in each state.
    pub(crate) least_points: usize,
    /// Of the shortest connections between two bodies at least this share must cross space shown as empty.
    pub(crate) least_empty: f32,
    /// Thickness of the front of a drawer, spacings: it is ignored where boxes behind it are told apart.
    pub(crate) front: f32,
    /// Least gap between boxes, spacings.
    pub(crate) gap: usize,
    /// Most points in each step of the gap, share of the mean.
    pub(crate) in_gap: f32,
    /// Least ratio of the widths of two boxes behind neighbouring fronts, and of their heights.
    pub(crate) alike: [f32; 2],
}

impl Default for InstanceSettings {
    fn default() -> Self {
        Self {
            reach: 2.6,
            least_share: 0.12,
            least_points: 24,
            least_empty: 0.5,
            front: 5.0,
            gap: 2,
            in_gap: 0.02,
            alike: [0.7, 0.3],
        }
    }
}

/// One part in the frame of the start state.
struct Body<'a> {
    scene: &'a Scene,
    motion: &'a Rigid,
    /// State and index of each point.
    origin: Vec<(State, usize)>,
    cloud: Cloud,
}

/// Bodies of one part: for every point its body, 0.. , and their number.
type Bodies = (Vec<usize>, usize);

impl InstanceSettings {
    /// Splits parts whose points are several bodies: new labels (part `k` keeps the largest body, the others get new
    /// numbers) and, of each new part, the part it comes from.
    pub(super) fn split(
        &self,
        scene: &Scene,
        labels: &mut PerState<Vec<u16>>,
        motions: &[Rigid],
        front: Option<Front>,
        directions: &[Vec3],
    ) -> Vec<usize> {
        let mut sources = Vec::new();
        for (k, motion) in motions.iter().enumerate() {
            let body = Body::new(scene, labels, k as u16 + 1, motion);
            let split = self.pieces(&body).or_else(|| self.boxes(&body, front, directions));
            let Some((of_point, count)) = split else { continue };
            let first = motions.len() + sources.len() + 1;
            for (point, (state, index)) in of_point.iter().zip(&body.origin) {
                if *point > 0 {
                    labels[*state][*index] = (first + point - 1) as u16;
                }
            }
            sources.extend(std::iter::repeat_n(k, count - 1));
        }
        sources
    }

    /// Bodies that do not touch, with empty space on the shortest ways between them.
    fn pieces(&self, body: &Body<'_>) -> Option<Bodies> {
        let all: Vec<usize> = (0..body.cloud.len()).collect();
        let groups = components(&body.cloud, &all, self.reach * body.scene.lengths.spacing, 1);
        let large: Vec<&Vec<usize>> = groups.iter().filter(|g| self.is_large(body, g)).collect();
        let mut bodies: Vec<Vec<usize>> = Vec::new();
        for group in large {
            // A piece that may be connected with a body out of sight belongs to it.
            match bodies.iter_mut().find(|other| !self.is_apart(body, other, group)) {
                Some(other) => other.extend(group),
                None => bodies.push(group.clone()),
            }
        }
        (bodies.len() > 1).then(|| (body.nearest(&bodies), bodies.len()))
    }

    /// True if a group has enough of the part's points in each state.
    fn is_large(&self, body: &Body<'_>, group: &[usize]) -> bool {
        State::ALL.into_iter().all(|s| {
            let total = body.origin.iter().filter(|o| o.0 == s).count();
            let own = group.iter().filter(|&&i| body.origin[i].0 == s).count();
            own >= self.least_points.max((self.least_share * total as f32) as usize)
        })
    }

    /// True if most of the shortest connections between two groups cross space that a state shows as empty.
    fn is_apart(&self, body: &Body<'_>, a: &[usize], b: &[usize]) -> bool {
        /// Points compared, and the share of the shortest connections that count.
        const SAMPLES: usize = 600;
        const SHORTEST: usize = 5;
        let target = body.cloud.select(b);
        let tree = IndexedCloud::new(&target);
        let stride = a.len().div_ceil(SAMPLES);
        let mut ways: Vec<(f32, Vec3, Vec3)> = a
            .iter()
            .step_by(stride)
            .filter_map(|&i| {
                let from = body.cloud.points[i];
                let (j, d) = tree.nearest_within(from, f32::INFINITY)?;
                Some((d, from, target.points[j]))
            })
            .collect();
        ways.sort_by(|x, y| x.0.total_cmp(&y.0));
        ways.truncate(ways.len().div_ceil(SHORTEST));
        let middles: Vec<Vec3> = ways.iter().map(|w| 0.5 * (w.1 + w.2)).collect();
        let empty = body.empty_in_any_state(&middles);
        empty.iter().filter(|e| **e).count() as f32 >= self.least_empty * ways.len() as f32
    }

    /// Boxes behind fronts that touch each other: behind the front there is a gap between them all the way.
    fn boxes(&self, body: &Body<'_>, front: Option<Front>, directions: &[Vec3]) -> Option<Bodies> {
        let slide = body.motion.translation.as_vec3().normalize_or_zero();
        let opening = front.map(|f| f.direction).filter(|d| body.motion.angle() < 0.01 && d.dot(slide).abs() > 0.8)?;
        let spacing = body.scene.lengths.spacing;
        let depth = |i: usize| body.cloud.points[i].dot(opening);
        let all: Vec<usize> = (0..body.cloud.len()).collect();
        let plate = front_plate(&body.cloud, opening, spacing)?;
        let behind: Vec<usize> = all.iter().copied().filter(|&i| depth(i) < plate - self.front * spacing).collect();
        let across = directions.iter().filter(|d| d.dot(opening).abs() < 0.2);
        for direction in across {
            let cuts = self.gaps(body, &behind, opening, *direction);
            if !cuts.is_empty() {
                let of_point = all.iter().map(|&i| {
                    let height = body.cloud.points[i].dot(*direction);
                    cuts.iter().filter(|cut| height > **cut).count()
                });
                return Some((of_point.collect(), cuts.len() + 1));
            }
        }
        None
    }

    /// Heights along `direction` at which the points behind the front leave a gap between boxes that are alike.
    fn gaps(&self, body: &Body<'_>, behind: &[usize], opening: Vec3, direction: Vec3) -> Vec<f32> {
        let spacing = body.scene.lengths.spacing;
        let other = opening.cross(direction).normalize_or_zero();
        let mut heights: Vec<(f32, usize)> =
            behind.iter().map(|&i| (body.cloud.points[i].dot(direction), i)).collect();
        heights.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (Some(first), Some(last)) = (heights.first(), heights.last()) else { return Vec::new() };
        let bins = ((last.0 - first.0) / spacing) as usize + 1;
        let mut counts = vec![0usize; bins];
        heights.iter().for_each(|(h, _)| counts[(((h - first.0) / spacing) as usize).min(bins - 1)] += 1);
        let few = self.in_gap * heights.len() as f32 / bins as f32;
        let mut cuts = Vec::new();
        let mut run = 0;
        for bin in 0..bins {
            if counts[bin] as f32 <= few {
                run += 1;
                continue;
            }
            if run >= self.gap && bin > run {
                cuts.push(first.0 + (bin as f32 - 0.5 * run as f32) * spacing);
            }
            run = 0;
        }
        // Boxes between the cuts must be large and alike; otherwise the gap is one within a single drawer.
        let mut edges = vec![f32::NEG_INFINITY];
        edges.extend(&cuts);
        edges.push(f32::INFINITY);
        let extents: Vec<[f32; 2]> = edges
            .windows(2)
            .filter_map(|edge| {
                let inside = heights.iter().filter(|(h, _)| *h > edge[0] && *h <= edge[1]);
                let group: Vec<usize> = inside.map(|(_, i)| *i).collect();
                let large = group.len() as f32 >= self.least_share * heights.len() as f32;
                let wide = |d: Vec3| {
                    let along = || group.iter().map(|&i| body.cloud.points[i].dot(d));
                    Some(percentile(along(), 0.98)? - percentile(along(), 0.02)?)
                };
                if large { Some([wide(other)?, wide(direction)?]) } else { None }
            })
            .collect();
        let alike = (0..2).all(|axis| {
            let (lo, hi) = extents.iter().fold((f32::INFINITY, 0.0f32), |(lo, hi), e| (lo.min(e[axis]), hi.max(e[axis])));
            lo >= self.alike[axis] * hi
        });
        if extents.len() == cuts.len() + 1 && alike { cuts } else { Vec::new() }
    }
}

impl<'a> Body<'a> {
    fn new(scene: &'a Scene, labels: &PerState<Vec<u16>>, part: u16, motion: &'a Rigid) -> Self {
        let mut body = Self { scene, motion, origin: Vec::new(), cloud: Cloud::default() };
        for s in State::ALL {
            let members: Vec<usize> = (0..labels[s].len()).filter(|&i| labels[s][i] == part).collect();
            let mut own = scene.states[s].cloud.select(&members);
            let back = if s == State::START { Rigid::IDENTITY } else { motion.inverse() };
            own.points.iter_mut().for_each(|p| *p = back.apply(p.as_dvec3()).as_vec3());
            own.normals.iter_mut().for_each(|n| *n = back.turn(n.as_dvec3()).as_vec3());
            body.cloud.append(&own);
            body.origin.extend(members.into_iter().map(|i| (s, i)));
        }
        body
    }

    /// Whether a state shows each place of the part's frame as empty.
    fn empty_in_any_state(&self, places: &[Vec3]) -> Vec<bool> {
        let mut out = vec![false; places.len()];
        for s in State::ALL {
            let there = if s == State::START { Rigid::IDENTITY } else { *self.motion };
            let moved: Vec<Vec3> = places.iter().map(|p| there.apply(p.as_dvec3()).as_vec3()).collect();
            let votes = ViewVotes::of_all(&self.scene.states[s].views, &moved, self.scene.tolerance);
            out.iter_mut().zip(votes).for_each(|(empty, votes)| *empty |= votes.is_empty_space());
        }
        out
    }

    /// Body of every point: the one it is nearest to.
    fn nearest(&self, bodies: &[Vec<usize>]) -> Vec<usize> {
        let clouds: Vec<Cloud> = bodies.iter().map(|b| self.cloud.select(b)).collect();
        let trees: Vec<IndexedCloud<'_>> = clouds.iter().map(IndexedCloud::new).collect();
        let distance = |tree: &IndexedCloud<'_>, p: Vec3| tree.nearest_within(p, f32::INFINITY).map_or(f32::INFINITY, |n| n.1);
        let of_point = |p: &Vec3| {
            let distances = trees.iter().map(|tree| distance(tree, *p)).enumerate();
            distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |best| best.0)
        };
        self.cloud.points.iter().map(of_point).collect()
    }
}

/// Depth, along `opening`, of the plate that most of the points that face the opening lie on; handles stand out of it.
fn front_plate(cloud: &Cloud, opening: Vec3, spacing: f32) -> Option<f32> {
    /// Least cosine between the normals of the plate and the opening.
    const FACING: f32 = 0.9;
    let facing = cloud.points.iter().zip(&cloud.normals).filter(|(_, n)| n.dot(opening) > FACING);
    let mut steps: Vec<i64> = facing.map(|(p, _)| (p.dot(opening) / spacing).round() as i64).collect();
    steps.sort_unstable();
    let fullest = steps.chunk_by(|a, b| a == b).max_by_key(|run| run.len())?;
    Some(fullest[0] as f32 * spacing)
}

fn percentile(values: impl Iterator<Item = f32>, at: f32) -> Option<f32> {
    let mut values: Vec<f32> = values.collect();
    let index = (at * values.len().checked_sub(1)? as f32) as usize;
    Some(*values.select_nth_unstable_by(index, f32::total_cmp).1)
}
