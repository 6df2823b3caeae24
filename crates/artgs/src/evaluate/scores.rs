//! Everything measured about one replica.

use super::closing::Closing;
use super::geometry::{GeometryConfig, MeshScore, chamfer, sample_surface, score_mesh};
use super::joints::{JointErrors, Motion, joint_errors, read_as};
use super::matching::{match_parts, pair_cost};
use super::pictures::PictureScores;
use crate::surface::PartMeshes;
use artgs_core::{Joint, JointKind, Mesh, PerState, Replica, State};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// The true object. `joints[i]`, `parents[i]` and `movable[i]` belong together; meshes in world coordinates of both
/// states.
#[derive(Clone, Debug, Default)]
pub struct Truth {
    /// Joints of the movable parts against their parents, where they are at the start state.
    pub joints: Vec<Joint>,
    /// Position in `joints` of the part that carries each; none, or no entry at all: the static part.
    pub parents: Vec<Option<usize>>,
    /// The whole object.
    pub whole: PerState<Mesh>,
    /// The static part.
    pub fixed: PerState<Mesh>,
    /// The movable parts.
    pub movable: Vec<PerState<Mesh>>,
}

/// Settings of an evaluation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EvaluateConfig {
    /// How surfaces are compared.
    pub geometry: GeometryConfig,
    /// Samples per mesh for matching parts.
    pub matching_samples: usize,
}

impl Default for EvaluateConfig {
    fn default() -> Self {
        Self { geometry: GeometryConfig::default(), matching_samples: 2000 }
    }
}

/// One true movable part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartScore {
    /// Position among the true movable parts.
    pub truth: usize,
    /// Matched part of the replica; none if it is missing.
    pub part: Option<usize>,
    /// True kind of joint.
    pub true_kind: JointKind,
    /// Predicted kind of joint.
    pub kind: Option<JointKind>,
    /// Errors of the joint; none if the part or its joint is missing.
    pub joint: Option<JointErrors>,
    /// CD-m and its company.
    pub mesh: MeshScore,
    /// How far it closes; none without an export, or if the truth or the export does not say where it is closed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub closing: Option<Closing>,
}

/// Means over the true movable parts that were found. Which ones those are is in [`Counts`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointMeans {
    /// Axis angle, degrees.
    pub axis_angle_deg: Option<f64>,
    /// Axis position x 10, over parts that truly turn.
    pub axis_position_x10: Option<f64>,
    /// Motion of parts that truly turn, degrees.
    pub motion_deg: Option<f64>,
    /// Motion of parts that truly slide, scene units.
    pub motion_length: Option<f64>,
    /// Axis position x 10 as ArtGS averages it: sliding parts count 0.
    pub paper_axis_position_x10: Option<f64>,
    /// Motion as ArtGS averages it: degrees and lengths mixed.
    pub paper_motion: Option<f64>,
}

/// How many of what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// True movable parts.
    pub truths: usize,
    /// Movable parts of the replica.
    pub predicted: usize,
    /// True movable parts with a matched part that has a joint.
    pub found: usize,
    /// True movable parts without one.
    pub missing: usize,
    /// Movable parts of the replica without a true part.
    pub extra: usize,
    /// Found parts with the wrong kind of joint.
    pub wrong_type: usize,
    /// Found parts that hang on another part than the truth's.
    #[serde(default)]
    pub wrong_parent: usize,
    /// Meshes, of either state, that are missing or empty though the truth has them.
    pub missing_meshes: usize,
}

/// All scores of a replica. Its `Display` is a table in the layout of the paper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// Per true movable part.
    pub parts: Vec<PartScore>,
    /// CD-w and its company.
    pub whole: MeshScore,
    /// CD-s and its company.
    pub fixed: MeshScore,
    /// Mean over the true movable parts, missing ones included at 1000.
    pub movable: MeshScore,
    /// Means of the joints.
    pub joints: JointMeans,
    /// Counts.
    pub counts: Counts,
    /// Held-out pictures of start and end, where they were scored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pictures: Option<[Option<PictureScores>; 2]>,
}

/// A joint of the replica as the truth would state it: where both hang the part on the same parent the joint itself,
/// else the motion against the part that takes the true parent's place, in the start state's frame, read as a joint of
/// the true kind.
fn stated(replica: &Replica, part: usize, truth: &Truth, index: usize, matched: &[Option<usize>]) -> Option<Stated> {
    let joint = replica.joint(part)?;
    let wanted = match truth.parents.get(index).copied().flatten() {
        Some(parent) => matched.get(parent).copied().flatten(),
        None => Some(0),
    };
    let same_parent = replica.parts[part].parent == wanted;
    let Some(parent) = wanted.filter(|w| !same_parent && *w != part) else {
        return Some(Stated { joint, kind: joint.kind, same_parent });
    };
    let against = replica.world_motion(parent).inverse() * replica.world_motion(part);
    let target = &truth.joints[index];
    Some(Stated { joint: read_as(target.kind, &against, target.origin), kind: joint.kind, same_parent })
}

/// See [`stated`].
struct Stated {
    joint: Joint,
    /// Kind as the replica states it.
    kind: JointKind,
    /// The replica hangs the part where the truth does.
    same_parent: bool,
}

impl Stated {
    fn errors(&self, truth: &Joint) -> JointErrors {
        JointErrors { type_ok: self.kind == truth.kind, ..joint_errors(&self.joint, truth) }
    }
}

/// Scores a replica, whose meshes are `meshes`, against the truth. Parts are matched by `pair_cost`; part 0 is the
/// static one. Missing meshes score 1000, missing joints no error but a count. Deterministic.
pub fn evaluate(replica: &Replica, meshes: &PartMeshes, truth: &Truth, config: &EvaluateConfig) -> Scores {
    let none = PerState::<Mesh>::default();
    let moving: Vec<usize> = (1..replica.parts.len().max(meshes.parts.len())).collect();
    let matched = match_movable(replica, meshes, &moving, truth, config);
    let diagonals = truth.whole.as_ref().map(diagonal);
    let score = |guess: Option<&PerState<Mesh>>, true_mesh: &PerState<Mesh>| {
        MeshScore::new(
            State::ALL.map(|s| score_mesh(guess.map(|m| &m[s]), &true_mesh[s], diagonals[s], &config.geometry)),
        )
    };
    let mut absent = 0;
    let mut count_absent = |guess: Option<&PerState<Mesh>>, true_mesh: &PerState<Mesh>| {
        let is_absent = |s: &State| !true_mesh[*s].is_empty() && guess.is_none_or(|m| m[*s].is_empty());
        absent += State::ALL.iter().filter(|s| is_absent(s)).count();
    };
    let (mut parts, mut wrong_parent) = (Vec::new(), 0);
    for (index, true_joint) in truth.joints.iter().enumerate() {
        let part = matched[index];
        let (guess, true_mesh) = (part.and_then(|p| meshes.parts.get(p)), truth.movable.get(index).unwrap_or(&none));
        let joint = part.and_then(|p| stated(replica, p, truth, index, &matched));
        wrong_parent += usize::from(joint.as_ref().is_some_and(|j| !j.same_parent));
        count_absent(guess, true_mesh);
        parts.push(PartScore {
            truth: index,
            part,
            true_kind: true_joint.kind,
            kind: joint.as_ref().map(|j| j.kind),
            joint: joint.map(|j| j.errors(true_joint)),
            mesh: score(guess, true_mesh),
            closing: None,
        });
    }
    count_absent(meshes.parts.first(), &truth.fixed);
    count_absent(Some(&meshes.whole), &truth.whole);
    let found = parts.iter().filter(|p| p.joint.is_some()).count();
    let counts = Counts {
        truths: parts.len(),
        predicted: moving.len(),
        found,
        missing: parts.len() - found,
        extra: moving.len() - matched.iter().flatten().count(),
        wrong_type: parts.iter().filter(|p| p.joint.is_some_and(|j| !j.type_ok)).count(),
        wrong_parent,
        missing_meshes: absent,
    };
    Scores {
        whole: score(Some(&meshes.whole), &truth.whole),
        fixed: score(meshes.parts.first(), &truth.fixed),
        movable: MeshScore::mean_of(&parts.iter().map(|p| p.mesh).collect::<Vec<_>>()),
        joints: joint_means(&parts),
        parts,
        counts,
        pictures: None,
    }
}

/// Part of the replica for every true movable part. Parts that others carry are matched again once it is known which
/// parts carry them.
fn match_movable(
    replica: &Replica,
    meshes: &PartMeshes,
    moving: &[usize],
    truth: &Truth,
    config: &EvaluateConfig,
) -> Vec<Option<usize>> {
    let sample = |mesh: Option<&PerState<Mesh>>| {
        PerState::from_fn(|s| {
            let mut rng = Pcg64Mcg::seed_from_u64(s.index() as u64);
            mesh.map(|m| sample_surface(&m[s], config.matching_samples, &mut rng)).unwrap_or_default()
        })
    };
    let true_points: Vec<_> = (0..truth.joints.len()).map(|i| sample(truth.movable.get(i))).collect();
    let size = 0.5 * (diagonal(&truth.whole[State::START]) + diagonal(&truth.whole[State::END]));
    let distances = |part: &usize| {
        let points = sample(meshes.parts.get(*part));
        let pair = |t: &PerState<Vec<[f64; 3]>>| {
            let at = |state| chamfer(&points[state], &t[state]);
            at(State::START).zip(at(State::END)).map(|(a, b)| 0.5 * (a + b))
        };
        true_points.iter().map(pair).collect::<Vec<_>>()
    };
    let distances: Vec<Vec<Option<f64>>> = moving.iter().map(distances).collect();
    let assign = |matched: &[Option<usize>]| -> Vec<Option<usize>> {
        let cost = |row: usize, index: usize| {
            let joint = stated(replica, moving[row], truth, index, matched);
            let errors = joint.map(|j| j.errors(&truth.joints[index]));
            pair_cost(errors.as_ref(), distances[row][index], size)
        };
        let costs: Vec<Vec<f64>> =
            (0..moving.len()).map(|row| (0..truth.joints.len()).map(|i| cost(row, i)).collect()).collect();
        match_parts(&costs, truth.joints.len()).into_iter().map(|row| row.map(|r| moving[r])).collect()
    };
    let matched = assign(&[]);
    if truth.parents.iter().any(Option::is_some) { assign(&matched) } else { matched }
}

fn joint_means(parts: &[PartScore]) -> JointMeans {
    let errors: Vec<JointErrors> = parts.iter().filter_map(|p| p.joint).collect();
    let mean = |pick: &dyn Fn(&JointErrors) -> Option<f64>| {
        let values: Vec<f64> = errors.iter().filter_map(pick).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    JointMeans {
        axis_angle_deg: mean(&|e| Some(e.axis_angle_deg)),
        axis_position_x10: mean(&|e| e.axis_position_x10),
        motion_deg: mean(&|e| matches!(e.motion, Motion::Degrees(_)).then(|| e.motion.value())),
        motion_length: mean(&|e| matches!(e.motion, Motion::Length(_)).then(|| e.motion.value())),
        paper_axis_position_x10: mean(&|e| Some(e.axis_position_x10.unwrap_or(0.0))),
        paper_motion: mean(&|e| Some(e.motion.value())),
    }
}

/// Diagonal of the bounding box of the vertices, 0 without any.
fn diagonal(mesh: &Mesh) -> f64 {
    let bound = |pick: fn(f32, f32) -> f32, start: f32| {
        mesh.vertices.iter().fold([start; 3], |b, v| [pick(b[0], v[0]), pick(b[1], v[1]), pick(b[2], v[2])])
    };
    let (lo, hi) = (bound(f32::min, f32::INFINITY), bound(f32::max, f32::NEG_INFINITY));
    let size = (0..3).map(|a| f64::from(hi[a]) - f64::from(lo[a])).map(|d| d * d).sum::<f64>().sqrt();
    if mesh.vertices.is_empty() || !size.is_finite() { 0.0 } else { size }
}

#[cfg(test)]
mod tests {
    use super::super::geometry::{MISSING, tests::plate};
    use super::*;
    use glam::DVec3;

    fn quick() -> EvaluateConfig {
        let geometry =
            GeometryConfig { samples: 2000, dense_samples: 4000, seeds: vec![0], ..GeometryConfig::default() };
        EvaluateConfig { geometry, matching_samples: 300 }
    }

    fn joint(kind: JointKind, axis: DVec3, value: f64) -> Joint {
        let values = [0.0, value];
        Joint {
            kind,
            axis,
            origin: DVec3::new(0.5, 0.0, 0.0),
            pitch: 0.0,
            state_values: PerState::new(0.0, value),
            limits: values,
        }
    }

    /// A static plate, two drawers that move alike, and a door.
    fn object() -> Truth {
        let drawer = joint(JointKind::Prismatic, DVec3::Y, 0.3);
        let door = joint(JointKind::Revolute, DVec3::X, 1.0);
        let joints = vec![drawer, drawer, door];
        let fixed = plate([0.0, 0.0], [1.0, 1.0], 0.0);
        let movable: Vec<PerState<Mesh>> = joints
            .iter()
            .enumerate()
            .map(|(i, j)| {
                let start = plate([0.0, 0.0], [0.4, 0.4], 0.3 * (i + 1) as f32);
                let end = start.moved(&j.start_to_end());
                PerState::new(start, end)
            })
            .collect();
        let whole = PerState::from_fn(|s| {
            let mut all = fixed.clone();
            movable.iter().for_each(|m| all.append(&m[s]));
            all
        });
        Truth { joints, parents: vec![], whole, fixed: PerState::new(fixed.clone(), fixed), movable }
    }

    /// The truth as a replica whose movable parts are the true ones in the given order.
    fn replica_of(truth: &Truth, order: &[usize]) -> (Replica, PartMeshes) {
        let joints: Vec<Joint> = order.iter().map(|i| truth.joints[*i]).collect();
        let mut parts = vec![truth.fixed.clone()];
        parts.extend(order.iter().map(|i| truth.movable[*i].clone()));
        (Replica::new(&joints), PartMeshes { parts, whole: truth.whole.clone() })
    }

    #[test]
    fn the_truth_in_any_order_is_perfect() {
        let truth = object();
        for order in [[0, 1, 2], [2, 0, 1], [1, 2, 0]] {
            let (replica, meshes) = replica_of(&truth, &order);
            let s = evaluate(&replica, &meshes, &truth, &quick());
            for (index, part) in s.parts.iter().enumerate() {
                // Only the meshes differ between the two drawers.
                assert_eq!(part.part.map(|p| order[p - 1]), Some(index));
            }
            assert!(s.joints.axis_angle_deg.unwrap() < 1e-9 && s.joints.motion_deg.unwrap() < 1e-6);
            assert!(s.joints.motion_length.unwrap() < 1e-9 && s.joints.axis_position_x10.unwrap() < 1e-9);
            for m in [&s.whole, &s.fixed, &s.movable] {
                assert!((m.mean.chamfer / m.mean.floor - 1.0).abs() < 0.1 && m.mean.f_score > 0.9, "{m:?}");
            }
            let c = Counts { truths: 3, predicted: 3, found: 3, ..Counts::default() };
            assert_eq!(s.counts, c);
            let right = "verdict: parts, joint types and parents are right; axes within 0.00 degrees and 0.0000 scene units; turns within 0.00 degrees; slides within 0.0000 scene units";
            assert_eq!(s.verdict(), right);
        }
    }

    #[test]
    fn a_missing_part_costs_a_thousand_and_is_counted() {
        let truth = object();
        let (replica, meshes) = replica_of(&truth, &[0, 2]);
        let s = evaluate(&replica, &meshes, &truth, &quick());
        assert_eq!((s.parts[1].part, s.parts[1].joint), (None, None));
        assert!(s.parts[1].mesh.start.chamfer == MISSING && (s.movable.mean.chamfer - MISSING / 3.0).abs() < 1.0);
        assert_eq!((s.counts.found, s.counts.missing, s.counts.extra, s.counts.missing_meshes), (2, 1, 0, 2));
        let text = s.to_string();
        assert!(text.contains("missing") && text.contains("1000.00"), "{text}");
        assert_eq!(s.verdict(), "verdict: wrong: 1 missing, 2 without a mesh");
    }

    #[test]
    fn extra_parts_are_counted_and_do_not_disturb() {
        let truth = object();
        let (replica, meshes) = replica_of(&truth, &[0, 1, 1, 2]);
        let s = evaluate(&replica, &meshes, &truth, &quick());
        assert_eq!((s.counts.found, s.counts.extra, s.counts.missing), (3, 1, 0));
        assert!(s.movable.mean.chamfer < 2.0 * s.movable.mean.floor);
    }

    #[test]
    fn a_wrong_type_is_reported_with_its_errors() {
        let truth = object();
        let (_, meshes) = replica_of(&truth, &[0, 1, 2]);
        let mut joints = truth.joints.clone();
        joints[2] = joint(JointKind::Prismatic, DVec3::X, 0.1);
        let s = evaluate(&Replica::new(&joints), &meshes, &truth, &quick());
        let part = &s.parts[2];
        assert_eq!((part.part, part.kind, s.counts.wrong_type), (Some(3), Some(JointKind::Prismatic), 1));
        let errors = part.joint.unwrap();
        assert!(!errors.type_ok && errors.axis_angle_deg < 1e-9);
        assert!((errors.motion.value() - 1f64.to_degrees()).abs() < 1e-9);
        assert!(s.to_string().contains("prismatic, not revolute"), "{s}");
    }

    /// A plate that turns as a door, carrying one that slides on it, and the world motion of the latter.
    fn chain() -> (Truth, artgs_core::Rigid) {
        let (door, drawer) = (joint(JointKind::Revolute, DVec3::X, 1.2), joint(JointKind::Prismatic, DVec3::Y, 0.3));
        let carried = door.start_to_end() * drawer.start_to_end();
        let fixed = plate([0.0, 0.0], [1.0, 1.0], 0.0);
        let movable: Vec<PerState<Mesh>> = [(0.3, door.start_to_end()), (0.5, carried)]
            .iter()
            .map(|(z, motion)| {
                let start = plate([0.0, 0.2], [0.4, 0.4], *z);
                PerState::new(start.clone(), start.moved(motion))
            })
            .collect();
        let whole = PerState::from_fn(|s| {
            let mut all = fixed.clone();
            movable.iter().for_each(|m| all.append(&m[s]));
            all
        });
        let (joints, parents) = (vec![door, drawer], vec![None, Some(0)]);
        (Truth { joints, parents, whole, fixed: PerState::new(fixed.clone(), fixed), movable }, carried)
    }

    #[test]
    fn a_carried_part_is_compared_against_what_carries_it() {
        let (truth, carried) = chain();
        for order in [[0, 1], [1, 0]] {
            let (_, meshes) = replica_of(&truth, &order);
            // Most methods hang every part on the static one, so that the drawer's own motion is that of a screw.
            let flat = |i: usize| match i {
                0 => truth.joints[0],
                _ => Joint::from_motion(JointKind::Screw, &carried),
            };
            let s = evaluate(&Replica::new(&order.map(flat)), &meshes, &truth, &quick());
            let drawer = s.parts[1].joint.unwrap();
            assert_eq!(s.parts[1].part.map(|p| order[p - 1]), Some(1));
            assert!(drawer.axis_angle_deg < 1e-6 && drawer.motion.value() < 1e-9, "{drawer:?}");
            assert_eq!((drawer.type_ok, s.counts.wrong_type, s.counts.wrong_parent), (false, 1, 1));
        }
        let (mut replica, meshes) = replica_of(&truth, &[0, 1]);
        replica.parts[2].parent = Some(1);
        let s = evaluate(&replica, &meshes, &truth, &quick());
        assert!(s.parts[1].joint.unwrap().motion.value() < 1e-9);
        assert_eq!((s.counts.wrong_type, s.counts.wrong_parent, s.counts.found), (0, 0, 2));
        // Stated as if nothing carried it, the right joint is the wrong motion.
        let s = evaluate(&Replica::new(&truth.joints), &meshes, &truth, &quick());
        assert!(s.parts[1].joint.unwrap().motion.value() > 0.1 && s.counts.wrong_parent == 1);
        // Without the door there is nothing to compare against but what is stated.
        let (replica, meshes) = replica_of(&truth, &[1]);
        let s = evaluate(&replica, &meshes, &truth, &quick());
        assert_eq!((s.counts.found, s.counts.missing), (1, 1));
        assert!(s.parts[1].joint.unwrap().motion.value() < 1e-9);
    }

    #[test]
    fn a_screw_shows_its_slide() {
        let mut truth = object();
        truth.joints[2] = Joint { kind: JointKind::Screw, pitch: 0.05, ..truth.joints[2] };
        let (_, meshes) = replica_of(&truth, &[0, 1, 2]);
        let s = evaluate(&Replica::new(&object().joints), &meshes, &truth, &quick());
        assert!((s.parts[2].joint.unwrap().slide.unwrap() - 0.05).abs() < 1e-12 && s.counts.wrong_type == 1);
        let text = s.to_string();
        assert!(text.contains("revolute, not screw, part 3, slide off by 0.0500"), "{text}");
    }

    #[test]
    fn scores_of_earlier_versions_load() {
        let truth = object();
        let (replica, meshes) = replica_of(&truth, &[0, 1, 2]);
        let s = evaluate(&replica, &meshes, &truth, &quick());
        let mut old = serde_json::to_value(&s).unwrap();
        old["counts"].as_object_mut().unwrap().remove("wrong_parent");
        assert!(old.get("pictures").is_none());
        assert_eq!(serde_json::from_value::<Scores>(old).unwrap().counts, s.counts);
        let start = PictureScores { psnr: 30.0, ssim: 0.9, flip: 0.1, lpips: None, views: 3 };
        let seen = Scores { pictures: Some([Some(start), None]), ..s };
        let back: Scores = serde_json::from_value(serde_json::to_value(&seen).unwrap()).unwrap();
        assert_eq!(back.pictures, seen.pictures);
        let text = seen.to_string();
        assert!(text.contains("FLIP") && text.contains("30.00"), "{text}");
    }

    #[test]
    fn scores_survive_json() {
        let truth = object();
        let (replica, meshes) = replica_of(&truth, &[0, 1, 2]);
        let s = evaluate(&replica, &meshes, &truth, &quick());
        let back: Scores = serde_json::from_str(&serde_json::to_string(&s).unwrap()).unwrap();
        assert_eq!(back.counts, s.counts);
        assert!((back.whole.mean.chamfer - s.whole.mean.chamfer).abs() < 1e-12);
    }

    #[test]
    fn an_empty_replica_is_scored_not_refused() {
        let s = evaluate(&Replica::new(&[]), &PartMeshes::default(), &object(), &quick());
        assert_eq!((s.counts.missing, s.counts.missing_meshes), (3, 10));
        assert!(s.whole.mean.chamfer == MISSING && s.joints == JointMeans::default());
    }
}
