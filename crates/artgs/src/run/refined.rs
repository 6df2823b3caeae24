//! Joints that training improves. Points of noisy depth determine motions along surfaces badly; photos of both states determine
//! them to a small part of a pixel.

use super::points::motion_parameters;
use crate::articulation::Trained;
use crate::discover::Discovery;
use artgs_core::{JointEstimate, JointKind, PerState, State, View};
use glam::DVec3;

/// Root mean square distance of registered points above which training improves a joint where depth is noisy, pixels on the part. In
/// captures of 200 and 400 pixels, exact depth and jittering poses leave 0.02 to 0.11, and axes from points are as good as those
/// from training or better; noise of 1 cm at 3 m leaves 0.12 to 0.4 with most parts, and those from training are better.
const NOISY: f64 = 0.12;
/// Training that changes a motion by more has failed: shift of the part's middle as a share of the object's diagonal,
const LARGEST_SHIFT: f64 = 0.02;
/// and turn, radians.
const LARGEST_TURN: f64 = 0.1;

/// Which joints were registered with points of noisy depth, `[K - 1]`; a part that another one carries follows its carrier.
pub(super) fn noisy_joints(found: &Discovery, views: PerState<&[View]>) -> Vec<bool> {
    let mut noisy: Vec<bool> = Vec::new();
    for (k, part) in found.parts.iter().enumerate() {
        let own =
            || found.noisy && part.rms.is_some_and(|rms| rms > NOISY * pixel(found.middle(k + 1, State::START), views));
        noisy.push(if part.parent > 0 { noisy[part.parent - 1] } else { own() });
    }
    noisy
}

/// Median size of a pixel of the views at a point, scene units.
fn pixel(at: DVec3, views: PerState<&[View]>) -> f64 {
    let sizes = views.into_iter().flatten().map(|view| {
        let camera = &view.camera;
        camera.world_to_camera.apply(at).length() / camera.intrinsics.fx
    });
    crate::trimmed::median(&mut sizes.collect::<Vec<f64>>()).unwrap_or(0.0)
}

/// Gives back the found motion to trained joints that were not to be `improved`, and to those that training has moved too far.
pub(super) fn keep_others(found: &Discovery, trained: &mut Trained, improved: &[bool]) {
    for (k, start) in motion_parameters(&found.parts).into_iter().enumerate() {
        if !improved[k] || strayed(found, k, trained) {
            trained.joints[k] = start;
        }
    }
}

/// True if training has changed the motion of a part by more than noise does.
fn strayed(found: &Discovery, k: usize, trained: &Trained) -> bool {
    let change = found.parts[k].motion.inverse() * trained.joints[k].full_motion();
    let middle = found.middle(k + 1, State::START);
    change.angle() > LARGEST_TURN || change.apply(middle).distance(middle) > LARGEST_SHIFT * found.diagonal
}

/// Found parts with trained motions. A carried part was free in training: its motion is put on its joint again.
pub(super) fn refined(found: &Discovery, trained: &Trained) -> Vec<JointEstimate> {
    let pairs = found.parts.iter().zip(&trained.joints);
    let mut parts: Vec<JointEstimate> = pairs.map(|(p, j)| JointEstimate { motion: j.full_motion(), ..*p }).collect();
    align_slides(&found.parts, &mut parts);
    // Parents precede their children.
    for k in 0..parts.len() {
        if let Some(carrier) = parts[k].carrier(&parts).copied() {
            let joint = parts[k].joint_near(&parts, found.middle(k + 1, State::START));
            parts[k].motion = carrier.motion * joint.start_to_end();
        }
    }
    parts
}

/// Gives slides of the base that were found with a common direction the mean of their trained directions: long slides count more.
fn align_slides(found: &[JointEstimate], trained: &mut [JointEstimate]) {
    /// Sine of the angle between directions that are the same.
    const SAME: f64 = 1e-6;
    let slides: Vec<usize> =
        (0..found.len()).filter(|k| found[*k].kind == JointKind::Prismatic && found[*k].parent == 0).collect();
    let direction = |k: usize| found[k].motion.translation.normalize_or_zero();
    let alike = |a: usize, b: usize| direction(a).cross(direction(b)).length() < SAME;
    for k in &slides {
        let group: Vec<usize> = slides.iter().copied().filter(|other| alike(*k, *other)).collect();
        if group.first() != Some(k) || group.len() < 2 {
            continue;
        }
        let along = direction(*k);
        let sum: DVec3 =
            group.iter().map(|j| trained[*j].motion.translation).map(|way| way * way.dot(along).signum()).sum();
        let Some(mean) = sum.try_normalize() else { continue };
        for j in group {
            let way = &mut trained[j].motion.translation;
            *way = mean * way.dot(mean);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::{MotionModel, MotionParameters};
    use crate::discover::Cloud;
    use artgs_core::{Camera, Intrinsics, Rigid, Splats};
    use glam::Vec3;

    /// A door with points about (0.5, 0, 0), registered with this root mean square distance.
    fn door(rms: f64, noisy: bool) -> Discovery {
        let turned = Rigid::about(DVec3::Z, DVec3::ZERO, 0.6);
        let part = JointEstimate { rms: Some(rms), ..JointEstimate::new(JointKind::Revolute, turned) };
        let cloud = Cloud { points: vec![Vec3::new(0.4, 0.0, 0.0), Vec3::new(0.6, 0.0, 0.0)], ..Cloud::default() };
        Discovery {
            clouds: PerState::new(cloud.clone(), cloud),
            labels: PerState::new(vec![1; 2], vec![1; 2]),
            parts: vec![part, JointEstimate { parent: 1, ..JointEstimate::new(JointKind::Prismatic, turned) }],
            diagonal: 1.0,
            noisy,
            ..Discovery::default()
        }
    }

    #[test]
    fn joints_of_noisy_points_are_improved_and_those_of_exact_ones_are_not() {
        // A pixel is 10 mm wide on the part.
        let k = Intrinsics { fx: 300.0, fy: 300.0, cx: 100.0, cy: 100.0, width: 200, height: 200 };
        let camera = Camera::look_at(k, DVec3::new(0.5, -3.0, 0.0), DVec3::new(0.5, 0.0, 0.0), DVec3::Z);
        let view = View { name: "view".into(), camera, rgba: Vec::new(), depth: None, derived: None };
        let views = PerState::new(std::slice::from_ref(&view), std::slice::from_ref(&view));
        assert_eq!(noisy_joints(&door(4e-4, true), views), [false; 2]);
        assert_eq!(noisy_joints(&door(2e-3, false), views), [false; 2]);
        assert_eq!(noisy_joints(&door(2e-3, true), views), [true; 2], "what it carries follows it");
    }

    #[test]
    fn joints_that_training_moves_too_far_or_that_were_exact_keep_their_motion() {
        let found = door(2e-3, true);
        let trained = |turn: f64| {
            let mut start = motion_parameters(&found.parts);
            start[0] =
                MotionParameters::from_motion(MotionModel::Hinge, &Rigid::about(DVec3::Z, DVec3::ZERO, 0.6 + turn));
            Trained { splats: Splats::empty(0), labels: Vec::new(), joints: start }
        };
        let angle = |turn: f64, improved: bool| {
            let mut trained = trained(turn);
            keep_others(&found, &mut trained, &[improved, false]);
            trained.joints[0].full_motion().angle()
        };
        assert!((angle(0.01, true) - 0.61).abs() < 1e-9);
        assert!((angle(0.01, false) - 0.6).abs() < 1e-9, "exact points");
        assert!((angle(0.2, true) - 0.6).abs() < 1e-9, "it turned too far");
    }

    #[test]
    fn a_carried_part_is_on_its_joint_after_training() {
        let door = Rigid::about(DVec3::Z, DVec3::new(0.4, 0.1, 0.0), 0.9);
        let slide = Rigid::shift(DVec3::new(0.0, -0.2, 0.0));
        // Training turned the drawer by a little and moved it off its axis.
        let trained = door * slide * Rigid::about(DVec3::X, DVec3::new(0.7, 0.0, 0.3), 0.004);
        let carried = JointEstimate { parent: 1, ..JointEstimate::new(JointKind::Prismatic, door * slide) };
        let cloud = Cloud { points: vec![Vec3::new(0.6, 0.0, 0.3), Vec3::new(0.8, 0.0, 0.3)], ..Cloud::default() };
        let found = Discovery {
            clouds: PerState::new(cloud.clone(), cloud),
            labels: PerState::new(vec![2; 2], vec![2; 2]),
            parts: vec![JointEstimate::new(JointKind::Revolute, door), carried],
            ..Discovery::default()
        };
        let models = motion_parameters(&found.parts);
        assert_eq!(models.iter().map(|m| m.model()).collect::<Vec<_>>(), [MotionModel::Hinge, MotionModel::Free]);
        let joints = vec![models[0].clone(), MotionParameters::from_motion(MotionModel::Free, &trained)];
        let parts = refined(&found, &Trained { splats: Splats::empty(0), labels: Vec::new(), joints });
        let own = parts[0].motion.inverse() * parts[1].motion;
        assert!(own.angle() < 1e-9 && own.translation.distance(slide.translation) < 1e-9, "{own:?}");
        assert_eq!((parts[1].kind, parts[1].parent), (JointKind::Prismatic, 1));
    }
    #[test]
    fn slides_with_a_common_direction_keep_one_after_training() {
        let slide = |way: DVec3| JointEstimate::new(JointKind::Prismatic, Rigid::shift(way));
        let found = [DVec3::new(0.0, -0.3, 0.0), DVec3::new(0.0, 0.1, 0.0), DVec3::new(0.0, -0.2, 0.01)].map(slide);
        let ways = [DVec3::new(0.003, -0.3, 0.0), DVec3::new(0.001, 0.1, 0.002), DVec3::new(0.0, -0.2, 0.011)];
        let mut trained = ways.map(slide);
        align_slides(&found, &mut trained);
        let mean = DVec3::new(0.002, -0.4, -0.002).normalize();
        for (k, length) in [(0, 0.3), (1, -0.1)] {
            let way = trained[k].motion.translation;
            assert!((way - mean * length).length() < 1e-4, "{way}");
            assert!(way.cross(mean).length() < 1e-12);
        }
        assert_eq!(trained[2].motion.translation, ways[2], "its direction is its own");
    }
}
