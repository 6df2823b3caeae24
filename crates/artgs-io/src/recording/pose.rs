//! Poses of recordings: camera-to-world with OpenGL or OpenCV axes, and back.

use crate::capture::pose::{FARTHEST, rotation};
use artgs_core::{Camera, Rigid};
use glam::{DMat3, DQuat, DVec3};

/// Axes of a camera frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axes {
    /// x right, y up, looks along -z.
    OpenGl,
    /// x right, y down, looks along z.
    OpenCv,
}

impl Axes {
    /// Turn from OpenCV axes to these axes; its own inverse.
    fn flip(self) -> DMat3 {
        match self {
            Self::OpenGl => DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)),
            Self::OpenCv => DMat3::IDENTITY,
        }
    }

    /// World-to-camera motion of a camera-to-world rotation and position. The error says what is wrong with the rotation.
    pub(super) fn world_to_camera(self, camera_to_world: DMat3, position: DVec3) -> Result<Rigid, String> {
        if !camera_to_world.is_finite() || !position.is_finite() {
            return Err("the pose is not finite; remove or repair the frame".into());
        }
        if position.abs().max_element() > FARTHEST {
            return Err(format!(
                "the camera is at {:?}, too far away; remove or repair the frame",
                position.to_array()
            ));
        }
        Ok(Rigid::from_matrix(rotation(camera_to_world)? * self.flip(), position).inverse())
    }

    /// World-to-camera motion of the first 12 values of a camera-to-world matrix, row by row.
    pub(super) fn world_to_camera_of_rows(self, m: &[f64]) -> Result<Rigid, String> {
        let column = |c: usize| DVec3::new(m[c], m[4 + c], m[8 + c]);
        self.world_to_camera(DMat3::from_cols(column(0), column(1), column(2)), column(3))
    }

    /// World-to-camera motion of a camera-to-world quaternion (x, y, z, w), of unit length within 1%, and position.
    pub(super) fn world_to_camera_of_quaternion(self, q: [f64; 4], position: DVec3) -> Result<Rigid, String> {
        self.world_to_camera(DMat3::from_quat(unit(q)?), position)
    }

    /// Camera-to-world rotation and position of a camera whose world is turned by `turn`.
    pub(super) fn camera_to_world(self, camera: &Camera, turn: DQuat) -> (DMat3, DVec3) {
        let pose = camera.world_to_camera.inverse();
        (DMat3::from_quat(turn) * pose.matrix() * self.flip(), turn * pose.translation)
    }

    /// The same as 4 rows of 4 values.
    pub(super) fn rows(self, camera: &Camera, turn: DQuat) -> [[f64; 4]; 4] {
        let (r, t) = self.camera_to_world(camera, turn);
        let row = |i: usize| [r.x_axis[i], r.y_axis[i], r.z_axis[i], t[i]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }
}

/// True for the pose of a frame in which the device did not know it: numbers that are not finite, or a rotation of zeros.
pub(super) fn is_lost(position: &[f64], rotation: &[f64]) -> bool {
    let unknown = |v: &f64| !v.is_finite();
    position.iter().any(unknown) || rotation.iter().any(unknown) || rotation.iter().all(|v| *v == 0.0)
}

/// A quaternion (x, y, z, w) that is of unit length within 1%, normalised.
pub(super) fn unit(q: [f64; 4]) -> Result<DQuat, String> {
    let q = DQuat::from_array(q);
    if !q.is_finite() || (q.length() - 1.0).abs() > 0.01 {
        return Err(format!("the quaternion has length {:.4}, must be 1; remove or repair the frame", q.length()));
    }
    Ok(q.normalize())
}

/// The turn that makes `up` the y axis, as ARKit's worlds have it; none if gravity is unknown.
pub(super) fn upright(up: Option<DVec3>) -> DQuat {
    up.map_or(DQuat::IDENTITY, |up| DQuat::from_rotation_arc(up, DVec3::Y))
}
