//! Made-up objects for tests.

use artgs::discover::{Cloud, Discovery};
use artgs::evaluate::sample_surface;
use artgs_core::{Joint, JointEstimate, JointKind, Mesh, PerState, Rigid, State};
use artgs_io::GroundTruth;
use glam::{DVec3, Vec3};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

/// A parallelogram.
fn plate(corner: [f32; 3], along: [f32; 3], across: [f32; 3]) -> Mesh {
    let (c, u, v) = (Vec3::from(corner), Vec3::from(along), Vec3::from(across));
    let vertices = [c, c + u, c + u + v, c + v].map(|p| p.to_array()).to_vec();
    Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() }
}

/// An object of plates that move by joints.
pub(crate) fn object(joints: Vec<Joint>, parents: Vec<Option<usize>>, plates: Vec<Mesh>) -> GroundTruth {
    let fixed = plate([0.0, 1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let fixed = PerState::from_fn(|_| fixed.clone());
    let mut truth = GroundTruth { joints, parents, whole: fixed.clone(), fixed, movable: Vec::new() };
    for (part, start) in plates.into_iter().enumerate() {
        let motion = truth.start_to_end(part);
        let mut end = start.clone();
        for vertex in &mut end.vertices {
            *vertex = motion.apply(DVec3::from_array(vertex.map(f64::from))).as_vec3().to_array();
        }
        truth.movable.push(PerState::new(start, end));
    }
    truth
}

/// A door of 1 x 1 that turns by 60 degrees about the z axis, and a drawer of the same size beside it that slides by 0.4.
pub(crate) fn cupboard() -> GroundTruth {
    let door = Joint::from_motion(JointKind::Revolute, &Rigid::about(DVec3::Z, DVec3::ZERO, -60_f64.to_radians()));
    let drawer = Joint::from_motion(JointKind::Prismatic, &Rigid::shift(DVec3::new(0.0, -0.4, 0.0)));
    let (up, right) = ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
    let plates = vec![plate([0.0; 3], right, up), plate(right, right, up)];
    object(vec![door, drawer], vec![None, None], plates)
}

/// A frame that slides by 0.5 and a flap that turns by 40 degrees on it.
pub(crate) fn carriage() -> GroundTruth {
    let frame = Joint::from_motion(JointKind::Prismatic, &Rigid::shift(DVec3::new(0.5, 0.0, 0.0)));
    let flap = Joint::from_motion(JointKind::Revolute, &Rigid::about(DVec3::X, DVec3::Z, 0.7));
    let plates = vec![
        plate([0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        plate([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.6]),
    ];
    object(vec![frame, flap], vec![None, Some(0)], plates)
}

/// A result that is exactly the truth, with true part `i` as part `labels[i]`, from 1. Parts of label 0 are not found.
pub(crate) fn found_as(truth: &GroundTruth, labels: &[u16]) -> Discovery {
    let mut found = Discovery { spacing: 0.03, diagonal: 2.0, ..Discovery::default() };
    let count = labels.iter().copied().max().unwrap_or(0);
    for label in 1..=count {
        let part = labels.iter().position(|l| *l == label).expect("every label has a part");
        let parent = truth.parents[part].map_or(0, |parent| usize::from(labels[parent]));
        let estimate = JointEstimate::new(truth.joints[part].kind, truth.start_to_end(part));
        found.parts.push(JointEstimate { parent, confidence: Some(0.95), ..estimate });
    }
    for state in State::ALL {
        let mut cloud = Cloud::default();
        let meshes = truth.movable.iter().zip(labels.iter().copied());
        for (mesh, label) in std::iter::once((&truth.fixed, 0)).chain(meshes) {
            for point in sample_surface(&mesh[state], 1000, &mut Pcg64Mcg::seed_from_u64(7)) {
                cloud.points.push(DVec3::from_array(point).as_vec3());
                cloud.normals.push(Vec3::Y);
                cloud.colors.push(Vec3::splat(0.5));
                found.labels[state].push(label);
            }
        }
        found.clouds[state] = cloud;
    }
    found
}
