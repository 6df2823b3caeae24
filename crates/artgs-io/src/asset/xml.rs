//! Numbers as text for XML formats.

use artgs_core::{JointKind, PerState};
use glam::{DQuat, DVec3, EulerRot};

/// Numbers separated by blanks, each in the shortest form that reads back exactly; -0 becomes 0.
pub(super) fn row(values: &[f64]) -> String {
    values.iter().map(|v| (v + 0.0).to_string()).collect::<Vec<_>>().join(" ")
}

/// Coordinates separated by blanks.
pub(super) fn triple(v: DVec3) -> String {
    row(&v.to_array())
}

/// Roll, pitch and yaw about the fixed axes X, Y and Z, in that order.
pub(super) fn roll_pitch_yaw(rotation: DQuat) -> [f64; 3] {
    let (yaw, pitch, roll) = rotation.to_euler(EulerRot::ZYX);
    [roll, pitch, yaw]
}

/// A comment with the pitch of a screw, for formats that have only hinges; none for other joints.
pub(super) fn screw_note(kind: JointKind, pitch: f64) -> Option<String> {
    (kind == JointKind::Screw).then(|| format!("<!-- screw: slides {pitch} m per radian along its axis -->"))
}

/// A comment with the values in the observed states, for formats without a field for them.
pub(super) fn observed_note(observed: PerState<f64>) -> String {
    let values = observed.map(|v| v.to_string());
    format!("<!-- observed: {} -->", values.as_slice().join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_make_the_rotation_again() {
        let rotation = DQuat::from_rotation_z(0.3) * DQuat::from_rotation_y(-1.1) * DQuat::from_rotation_x(2.0);
        let [roll, pitch, yaw] = roll_pitch_yaw(rotation);
        assert!((roll - 2.0).abs() < 1e-9 && (pitch + 1.1).abs() < 1e-9 && (yaw - 0.3).abs() < 1e-9);
    }

    #[test]
    fn numbers_are_plain_and_exact() {
        assert_eq!(row(&[-0.0, 0.1, 1e-7, -2.5]), "0 0.1 0.0000001 -2.5");
        assert_eq!(triple(DVec3::new(1.0, 1.0 / 3.0, 0.0)), "1 0.3333333333333333 0");
    }
}
