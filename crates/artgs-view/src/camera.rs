//! Cameras of a capture in the object's frame.

use crate::scene::SceneCamera;
use artgs_core::{Camera, Rigid, State};
use glam::{DQuat, DVec3};
use serde::Serialize;
use std::path::PathBuf;

/// From the capture's frame to the object's: `object = rotation * (scale * capture) + translation`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Placement {
    /// Metres per unit of the capture.
    pub scale: f64,
    /// Unit quaternion, x y z w.
    pub rotation: DQuat,
    /// Metres.
    pub translation: DVec3,
}

impl Placement {
    /// A point of the capture in the object's frame.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * (self.scale * point) + self.translation
    }
}

impl Default for Placement {
    /// Metres, +Z up.
    fn default() -> Self {
        Self { scale: 1.0, rotation: DQuat::IDENTITY, translation: DVec3::ZERO }
    }
}

/// A camera of a capture with its pictures.
#[derive(Clone, Debug)]
pub struct CameraView {
    /// Name, for example that of the photo.
    pub name: String,
    /// State in which the photo was taken.
    pub state: State,
    /// Capture's frame and unit.
    pub camera: Camera,
    /// Photo, PNG or JPEG, to show.
    pub photo: Option<PathBuf>,
    /// Rendering of the replica at this camera; without one the page draws the replica itself.
    pub rendering: Option<PathBuf>,
    /// Mask of the photo to show, white on the object.
    pub mask: Option<PathBuf>,
}

impl CameraView {
    /// The camera in the form of `scene.json`, without files.
    pub(crate) fn placed(&self, placement: &Placement) -> SceneCamera {
        let Rigid { rotation, translation } = self.camera.world_to_camera.inverse();
        let turn = glam::DMat3::from_quat(placement.rotation * rotation);
        let at = placement.apply(translation);
        let pose = [0, 1, 2].map(|r| [turn.x_axis[r], turn.y_axis[r], turn.z_axis[r], at[r]]);
        let k = &self.camera.intrinsics;
        SceneCamera {
            name: self.name.clone(),
            state: self.state.index(),
            pose,
            intrinsics: [k.fx, k.fy, k.cx, k.cy],
            size: [k.width, k.height],
            photo: None,
            rendering: None,
            mask: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::Intrinsics;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_camera_in_a_capture_with_y_up_and_in_centimetres() {
        let intrinsics = Intrinsics { fx: 50.0, fy: 60.0, cx: 20.0, cy: 15.0, width: 40, height: 30 };
        let camera = Camera::look_at(intrinsics, DVec3::new(0.0, 100.0, 200.0), DVec3::new(0.0, 100.0, 0.0), DVec3::Y);
        let view = CameraView { name: "a".into(), state: State::END, camera, photo: None, rendering: None, mask: None };
        let placed =
            view.placed(&Placement { scale: 0.01, rotation: DQuat::from_rotation_x(FRAC_PI_2), translation: DVec3::Z });
        let expected = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, -2.0], [0.0, -1.0, 0.0, 2.0]];
        for (row, expected) in placed.pose.iter().zip(&expected) {
            assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{:?}", placed.pose);
        }
        assert_eq!((placed.intrinsics, placed.size, placed.state), ([50.0, 60.0, 20.0, 15.0], [40, 30], 1));
    }
}
