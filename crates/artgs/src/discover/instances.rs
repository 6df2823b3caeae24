//! Parts that move alike: one motion, several rigid bodies. Points of both states are brought together in the frame of the
//! start state, where each body is seen from both states; then bodies are separated by the space between them.

use super::cloud::{Cloud, IndexedCloud, components};
use super::front::Front;
use super::scene::Scene;
use super::visibility::ViewVotes;
use crate::trimmed::quantile;
use artgs_core::{PerState, Rigid, State};
use glam::Vec3;

/// Settings of the search for parts that move alike. Calibrated on `twin_drawers` and on single drawers and doors of the
/// stand-ins, which must stay whole.
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
    /// Thickness of the front of a drawer, spacings: it is ignored where boxes behind it are separated.
    pub(crate) front: f32,
    /// Least share of the points behind a front in a box.
    pub(crate) least_box: f32,
    /// Least extent of a box in both directions across the opening, spacings.
    pub(crate) least_extent: f32,
    /// Least share of a box that is behind a front, seen along the opening.
    pub(crate) least_covered: f32,
    /// Least extent of a box towards the other boxes, as a share of the extent of its front.
    pub(crate) least_width: f32,
    /// Least share of a part's points in a body that only one state shows; where depth noise spreads points.
    pub(crate) least_single: f32,
}

impl Default for InstanceSettings {
    fn default() -> Self {
        Self {
            reach: 2.6,
            least_share: 0.12,
            least_points: 24,
            least_empty: 0.5,
            front: 5.0,
            least_box: 0.06,
            least_extent: 4.0,
            least_covered: 0.5,
            least_width: 0.5,
            least_single: 0.25,
        }
    }
}

/// Least cosine between the normals of a front and the opening.
const FACING: f32 = 0.9;

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
    /// Splits parts whose points are several bodies: new labels (part `k` keeps the first body, the others get new
    /// numbers) and, of each new part, the part it comes from. At most `most` parts are made.
    pub(super) fn split(
        &self,
        scene: &Scene,
        labels: &mut PerState<Vec<u16>>,
        motions: &[Rigid],
        front: Option<Front>,
        most: usize,
    ) -> Vec<usize> {
        let mut sources: Vec<usize> = (0..motions.len()).collect();
        let mut next = 0;
        while next < sources.len() {
            let motion = &motions[sources[next]];
            let body = Body::new(scene, labels, next as u16 + 1, motion);
            let split = self.pieces(&body).or_else(|| self.boxes(&body, front));
            let split = split.filter(|split| self.all_large(&body, split));
            let Some((of_point, count)) = split.filter(|(_, count)| sources.len() + count - 1 <= most) else {
                next += 1;
                continue;
            };
            // Bodies may be several again: the first one is looked at once more, the others in their turn.
            for (point, (state, index)) in of_point.iter().zip(&body.origin) {
                if *point > 0 {
                    labels[*state][*index] = (sources.len() + point) as u16;
                }
            }
            sources.extend(std::iter::repeat_n(sources[next], count - 1));
        }
        sources.split_off(motions.len())
    }

    /// Bodies that do not touch, with empty space on the shortest ways between them.
    fn pieces(&self, body: &Body<'_>) -> Option<Bodies> {
        let all: Vec<usize> = (0..body.cloud.len()).collect();
        let groups = components(&body.cloud, &all, self.reach * body.scene.lengths.spacing, 1);
        let bodies = self.apart(body, groups.into_iter().filter(|g| self.is_large(body, g)).collect());
        (bodies.len() > 1).then(|| (body.nearest(&bodies), bodies.len()))
    }

    /// Joins groups that may be connected out of sight: inside a wall, or where nothing is shown.
    fn apart(&self, body: &Body<'_>, groups: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
        let mut bodies: Vec<Vec<usize>> = Vec::new();
        for group in groups {
            match bodies.iter_mut().find(|other| !self.is_apart(body, other, &group)) {
                Some(other) => other.extend(group),
                None => bodies.push(group),
            }
        }
        bodies
    }

    /// True if every body has enough of the part's points in each state.
    fn all_large(&self, body: &Body<'_>, (of_point, count): &Bodies) -> bool {
        let group = |k: usize| (0..of_point.len()).filter(|&i| of_point[i] == k).collect::<Vec<usize>>();
        (0..*count).all(|k| self.is_large(body, &group(k)))
    }

    /// True if a group has enough of the part's points.
    fn is_large(&self, body: &Body<'_>, group: &[usize]) -> bool {
        let total = PerState::from_fn(|s| body.origin.iter().filter(|o| o.0 == s).count());
        let own = PerState::from_fn(|s| group.iter().filter(|&&i| body.origin[i].0 == s).count());
        self.is_enough(&own, &total, body.scene.spreading)
    }

    /// True if `own` of the `total` points of a part in each state are enough for a body. Where depth noise spreads points, more of
    /// them in one state are enough: a motion that is too long hides a drawer that closes inside of the object.
    fn is_enough(&self, own: &PerState<usize>, total: &PerState<usize>, spreading: bool) -> bool {
        let has = |share: f32, s: State| own[s] >= self.least_points.max((share * total[s] as f32) as usize);
        let in_each = State::ALL.into_iter().all(|s| has(self.least_share, s));
        in_each || spreading && State::ALL.into_iter().any(|s| has(self.least_single, s))
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

    /// Boxes behind fronts that touch each other: behind the front they do not touch. A front belongs to the box behind it.
    fn boxes(&self, body: &Body<'_>, front: Option<Front>) -> Option<Bodies> {
        /// Parts that turn more are no drawers, radians.
        const TURN: f64 = 0.1;
        let middle = body.cloud.middle().as_dvec3();
        let slide = (body.motion.apply(middle) - middle).as_vec3().normalize_or_zero();
        let opening = front.map(|f| f.direction).filter(|d| body.motion.angle() < TURN && d.dot(slide).abs() > 0.8)?;
        let spacing = body.scene.lengths.spacing;
        let depth = |i: usize| body.cloud.points[i].dot(opening);
        let plate = front_plate(&body.cloud, opening, spacing)?;
        let behind: Vec<usize> = (0..body.cloud.len()).filter(|&i| depth(i) < plate - self.front * spacing).collect();
        let groups = components(&body.cloud, &behind, self.reach * spacing, 1);
        let least = (self.least_box * behind.len() as f32) as usize;
        let is_box =
            |group: &Vec<usize>| group.len() >= least.max(self.least_points) && self.is_box(body, group, opening);
        let mut boxes: Vec<Vec<usize>> = groups.into_iter().filter(is_box).collect();
        self.keep_behind_fronts(body, opening, &mut boxes);
        let beside = self.are_beside(body, opening, &boxes);
        let distinct = beside.then(|| self.behind_fronts(body, opening, boxes.clone(), true)).flatten();
        distinct.or_else(|| self.behind_fronts(body, opening, self.apart(body, boxes), false))
    }

    /// True if, seen along the opening, a gap separates every box from every other one: noise does not make two boxes of one there.
    fn are_beside(&self, body: &Body<'_>, opening: Vec3, boxes: &[Vec<usize>]) -> bool {
        /// Least width of the gap, spacings.
        const GAP: f32 = 3.0;
        let across = |k: usize| boxes[k].iter().map(|&i| body.cloud.points[i].reject_from_normalized(opening));
        let middle = |k: usize| across(k).sum::<Vec3>() / boxes[k].len().max(1) as f32;
        let gap = |a: usize, b: usize| {
            let direction = (middle(b) - middle(a)).normalize_or_zero();
            let along = |k: usize| across(k).map(|p| p.dot(direction)).collect::<Vec<f32>>();
            quantile(along(b), 0.02).zip(quantile(along(a), 0.98)).map_or(0.0, |(lower, upper)| lower - upper)
        };
        let least = GAP * body.scene.lengths.spacing;
        (0..boxes.len()).all(|a| (0..a).all(|b| gap(a, b) > least))
    }

    /// Points by the box that they belong to, if every box reaches behind enough of its front in the direction of the next one, and with
    /// `across` also in the direction across that and the opening.
    fn behind_fronts(
        &self,
        body: &Body<'_>,
        opening: Vec3,
        mut boxes: Vec<Vec<usize>>,
        across: bool,
    ) -> Option<Bodies> {
        // Seen along the opening, so that a front is nearest to its own box.
        let mut seen = Body { cloud: body.cloud.clone(), origin: Vec::new(), ..*body };
        seen.cloud.points.iter_mut().for_each(|p| *p = p.reject_from_normalized(opening));
        let of_point = self.joined(body, &seen, &mut boxes)?;
        let fronts: Vec<Vec<usize>> = (0..boxes.len())
            .map(|k| (0..of_point.len()).filter(|&i| of_point[i] == k && body.faces(i, opening)).collect())
            .collect();
        let is_wide = self.as_wide(&seen.cloud, &boxes, &fronts, across.then_some(opening));
        is_wide.then_some((of_point, boxes.len()))
    }

    /// The box that each point is nearest to as seen along the opening. A box with too few of the points is a piece of the box that
    /// is nearest to it: its points join that one. None if fewer than two boxes remain.
    fn joined(&self, body: &Body<'_>, seen: &Body<'_>, boxes: &mut Vec<Vec<usize>>) -> Option<Vec<usize>> {
        while boxes.len() > 1 {
            let of_point = seen.nearest(boxes);
            let group = |k: usize| (0..of_point.len()).filter(|&i| of_point[i] == k).collect::<Vec<usize>>();
            let small = (0..boxes.len()).filter(|&k| !self.is_large(body, &group(k)));
            let Some(smallest) = small.min_by_key(|&k| boxes[k].len()) else { return Some(of_point) };
            let piece = boxes.remove(smallest);
            let nearest = seen.nearest_box(boxes, &piece);
            boxes[nearest].extend(piece);
        }
        None
    }

    /// True if every box reaches behind enough of its front in the direction of the nearest other box. The two sides of one drawer
    /// do not. With `opening`, also in the direction across both, which a single side does not.
    fn as_wide(&self, seen: &Cloud, boxes: &[Vec<usize>], fronts: &[Vec<usize>], opening: Option<Vec3>) -> bool {
        let middles: Vec<Vec3> = boxes.iter().map(|b| seen.select(b).middle()).collect();
        let is_wide = |k: usize| {
            let others = (0..boxes.len()).filter(|other| *other != k).map(|other| middles[other] - middles[k]);
            let nearest =
                others.min_by(|a, b| a.length().total_cmp(&b.length())).map_or(Vec3::ZERO, Vec3::normalize_or_zero);
            let reaches = |axis| extent(seen, &boxes[k], axis) >= self.least_width * extent(seen, &fronts[k], axis);
            reaches(nearest) && opening.is_none_or(|opening| reaches(nearest.cross(opening).normalize_or_zero()))
        };
        (0..boxes.len()).all(is_wide)
    }

    /// Keeps the groups that are behind points that face the opening, seen along it. Fronts of drawers that share a motion at
    /// first have different depths.
    fn keep_behind_fronts(&self, body: &Body<'_>, opening: Vec3, groups: &mut Vec<Vec<usize>>) {
        let points = &body.cloud.points;
        let facing: Vec<usize> = (0..points.len()).filter(|&i| body.faces(i, opening)).collect();
        let mut fronts = body.cloud.select(&facing);
        fronts.points.iter_mut().for_each(|p| *p = p.reject_from_normalized(opening));
        let fronts = IndexedCloud::new(&fronts);
        let limit = (self.reach * body.scene.lengths.spacing).powi(2);
        let covered = |i: usize| fronts.nearest_within(points[i].reject_from_normalized(opening), limit).is_some();
        groups.retain(|group| {
            let count = group.iter().filter(|&&i| covered(i)).count();
            count as f32 >= self.least_covered * group.len() as f32
        });
    }

    /// True if a group extends in both directions across the opening; a single wall of a box does not.
    fn is_box(&self, body: &Body<'_>, group: &[usize], opening: Vec3) -> bool {
        let points: Vec<Vec3> = group.iter().map(|&i| body.cloud.points[i]).collect();
        let flat: Vec<Vec3> = points.iter().map(|p| *p - opening * p.dot(opening)).collect();
        let mean = flat.iter().sum::<Vec3>() / flat.len().max(1) as f32;
        let (u, v) = opening.any_orthonormal_pair();
        let (mut uu, mut uv, mut vv) = (0.0f32, 0.0f32, 0.0f32);
        for p in &flat {
            let (a, b) = ((*p - mean).dot(u), (*p - mean).dot(v));
            uu += a * a;
            uv += a * b;
            vv += b * b;
        }
        let turn = 0.5 * (2.0 * uv).atan2(uu - vv);
        let axes = [u * turn.cos() + v * turn.sin(), v * turn.cos() - u * turn.sin()];
        let least = self.least_extent * body.scene.lengths.spacing;
        axes.iter().all(|axis| extent(&body.cloud, group, *axis) > least)
    }
}

/// Extent of a group of points along a unit axis without the outermost ones.
fn extent(cloud: &Cloud, group: &[usize], axis: Vec3) -> f32 {
    let along: Vec<f32> = group.iter().map(|&i| cloud.points[i].dot(axis)).collect();
    quantile(along.clone(), 0.98).zip(quantile(along, 0.02)).map_or(0.0, |(hi, lo)| hi - lo)
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

    /// True for points that face the opening, as those of a front do.
    fn faces(&self, point: usize, opening: Vec3) -> bool {
        self.cloud.normals[point].dot(opening) > FACING
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

    /// The box whose points are nearest to those of `piece` on average; `boxes` are not empty.
    fn nearest_box(&self, boxes: &[Vec<usize>], piece: &[usize]) -> usize {
        let total = |points: &Vec<usize>| {
            let cloud = self.cloud.select(points);
            let tree = IndexedCloud::new(&cloud);
            let distance = |i: &usize| tree.nearest_within(self.cloud.points[*i], f32::INFINITY).map_or(0.0, |n| n.1);
            piece.iter().map(distance).sum::<f32>()
        };
        let totals = boxes.iter().map(total).enumerate();
        totals.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |nearest| nearest.0)
    }

    /// Body of every point: the one it is nearest to.
    fn nearest(&self, bodies: &[Vec<usize>]) -> Vec<usize> {
        let clouds: Vec<Cloud> = bodies.iter().map(|b| self.cloud.select(b)).collect();
        let trees: Vec<IndexedCloud<'_>> = clouds.iter().map(IndexedCloud::new).collect();
        let distance =
            |tree: &IndexedCloud<'_>, p: Vec3| tree.nearest_within(p, f32::INFINITY).map_or(f32::INFINITY, |n| n.1);
        let of_point = |p: &Vec3| {
            let distances = trees.iter().map(|tree| distance(tree, *p)).enumerate();
            distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |best| best.0)
        };
        self.cloud.points.iter().map(of_point).collect()
    }
}

/// Depth, along `opening`, of the plate that most of the points that face the opening lie on; handles stand out of it.
fn front_plate(cloud: &Cloud, opening: Vec3, spacing: f32) -> Option<f32> {
    let facing = cloud.points.iter().zip(&cloud.normals).filter(|(_, n)| n.dot(opening) > FACING);
    let mut steps: Vec<i64> = facing.map(|(p, _)| (p.dot(opening) / spacing).round() as i64).collect();
    steps.sort_unstable();
    let fullest = steps.chunk_by(|a, b| a == b).max_by_key(|run| run.len())?;
    Some(fullest[0] as f32 * spacing)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn push(cloud: &mut Cloud, point: Vec3, normal: Vec3) {
        cloud.points.push(point);
        cloud.normals.push(normal);
        cloud.colors.push(Vec3::ONE);
        cloud.roughness.push(0.0);
    }

    #[test]
    fn the_sides_of_one_drawer_are_not_two_drawers() {
        let settings = InstanceSettings::default();
        let mut cloud = Cloud::default();
        let mut add = |from: f32, to: f32, y: f32| {
            let first = cloud.points.len();
            for (i, j) in (0..40).flat_map(|i| (0..10).map(move |j| (i as f32 / 39.0, j as f32 / 9.0))) {
                push(&mut cloud, Vec3::new(from + (to - from) * i, y, 0.2 * j), Vec3::NEG_Y);
            }
            (first..cloud.points.len()).collect::<Vec<usize>>()
        };
        let fronts = [add(0.0, 0.3, 0.0), add(0.3, 0.6, 0.0)];
        let sides = [add(0.01, 0.06, 0.1), add(0.54, 0.59, 0.1)];
        let boxes = [add(0.01, 0.29, 0.1), add(0.31, 0.59, 0.1)];
        let as_wide = |boxes, opening| settings.as_wide(&cloud, boxes, &fronts, opening);
        assert!(!as_wide(&sides, None));
        assert!(as_wide(&boxes, None) && as_wide(&boxes, Some(Vec3::NEG_Y)));
        // A bottom is as wide as the front, but not as high.
        let low = |all: &Vec<usize>| all.iter().copied().filter(|&i| cloud.points[i].z < 0.05).collect::<Vec<usize>>();
        let bottoms = boxes.each_ref().map(low);
        assert!(as_wide(&bottoms, None) && !as_wide(&bottoms, Some(Vec3::NEG_Y)));
    }

    #[test]
    fn a_body_that_one_state_hides_is_one_only_where_depth_is_noisy() {
        let settings = InstanceSettings::default();
        let total = PerState::new(1000, 200);
        let enough = |start, end, spreading| settings.is_enough(&PerState::new(start, end), &total, spreading);
        assert!(enough(200, 60, false) && enough(200, 60, true));
        assert!(!enough(400, 0, false) && enough(400, 0, true));
        assert!(!enough(200, 0, true), "a small one");
    }

    #[test]
    fn a_small_piece_of_a_box_joins_it() {
        let scene = crate::discover::test_scene::cabinet_scene(6, 48);
        let mut cloud = Cloud::default();
        let mut add = |from: f32, to: f32, columns: usize| {
            let first = cloud.points.len();
            for (i, j) in (0..columns).flat_map(|i| (0..20).map(move |j| (i as f32, j as f32 / 19.0))) {
                push(&mut cloud, Vec3::new(from + (to - from) * i / columns as f32, 0.0, 0.3 * j), Vec3::NEG_Y);
            }
            (first..cloud.points.len()).collect::<Vec<usize>>()
        };
        let (left, right, side) = (add(0.0, 0.4, 20), add(0.5, 0.9, 20), add(0.94, 0.96, 3));
        let origin = (0..cloud.len()).map(|i| (State::ALL[i % 2], i)).collect();
        let body = Body { scene: &scene, motion: &Rigid::IDENTITY, origin, cloud };
        let settings = InstanceSettings::default();
        let mut boxes = vec![left.clone(), side.clone(), right.clone()];
        let of_point = settings.joined(&body, &body, &mut boxes).unwrap();
        assert_eq!(boxes, [left.clone(), [right, side.clone()].concat()]);
        assert!(left.iter().all(|i| of_point[*i] == 0) && side.iter().all(|i| of_point[*i] == 1));
        assert!(settings.joined(&body, &body, &mut vec![left.clone()]).is_none());
        // The spacing is about 0.02: there is a gap of 0.1 between the boxes, and one of 0.04 beside the small piece.
        assert!(settings.are_beside(&body, Vec3::NEG_Y, &[left, boxes[1][..400].to_vec()]));
        assert!(!settings.are_beside(&body, Vec3::NEG_Y, &[boxes[1][..400].to_vec(), side]));
    }

    #[test]
    fn pieces_behind_one_front_are_boxes_only_if_they_are_as_wide_or_space_between_them_is_seen() {
        let scene = crate::discover::test_scene::cabinet_scene(6, 48);
        // Where no view looks, so that nothing is seen between the pieces.
        let (away, unit) = (Vec3::new(0.0, 0.0, 60.0), scene.lengths.spacing / 0.02);
        let split = |pieces: [[f32; 2]; 2]| {
            let mut cloud = Cloud::default();
            let mut add = |point: Vec3, normal: Vec3| push(&mut cloud, unit * point + away, normal);
            for (i, j) in (0..61).flat_map(|i| (0..21).map(move |j| (i as f32, j as f32))) {
                add(Vec3::new(0.01 * i, 0.0, 0.01 * j), Vec3::NEG_Y);
            }
            for [from, to] in pieces {
                for (i, j) in (0..20).flat_map(|i| (0..21).map(move |j| (i as f32, j as f32))) {
                    for y in [0.2, 0.22] {
                        add(Vec3::new(from + (to - from) * i / 19.0, y, 0.01 * j), Vec3::Z);
                    }
                }
            }
            let origin = (0..cloud.len()).map(|i| (State::ALL[i % 2], i)).collect();
            let motion = Rigid::shift(glam::DVec3::NEG_Y);
            let body = Body { scene: &scene, motion: &motion, origin, cloud };
            let front = Front { direction: Vec3::NEG_Y, height: 0.0 };
            InstanceSettings::default().boxes(&body, Some(front)).map(|(_, count)| count)
        };
        assert_eq!(split([[0.01, 0.25], [0.35, 0.59]]), Some(2));
        assert_eq!(split([[0.01, 0.12], [0.48, 0.59]]), None, "sides of one drawer");
        assert_eq!(split([[0.01, 0.27], [0.33, 0.59]]), None, "a narrow gap that no view shows");
    }
}
