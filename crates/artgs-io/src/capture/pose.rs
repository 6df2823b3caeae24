//! Converts camera-to-world matrices with OpenGL axes to world-to-camera motions with OpenCV axes.

use super::CaptureError;
use super::json::{block_and_column, key_error, matrix};
use artgs_core::{Camera, Rigid};
use glam::{DMat3, DVec3};
use serde_json::Value;

/// Largest allowed entry of `R^T R - I` of a rotation block.
const ORTHONORMAL: f64 = 1e-3;

/// Largest coordinate of a camera, scene units.
pub(crate) const FARTHEST: f64 = 1e9;

/// World-to-camera motion (OpenCV axes) of a 4x4 camera-to-world matrix (OpenGL axes: y up, looks down -z).
/// The rotation block must be orthonormal within 1e-3 and is replaced by the nearest rotation.
pub(crate) fn world_to_camera(value: &Value, place: &str, key: &str) -> Result<Rigid, CaptureError> {
    let m = matrix::<4>(value, place, key)?;
    if m[3].iter().zip([0.0, 0.0, 0.0, 1.0]).any(|(a, b)| (a - b).abs() > 1e-6) {
        return Err(key_error(place, key, "the last row must be 0 0 0 1; write camera-to-world, row by row"));
    }
    let (block, translation) = block_and_column(&m);
    if translation.abs().max_element() > FARTHEST {
        return Err(key_error(
            place,
            key,
            format!("the camera is at {:?}, too far away; remove or repair the frame", translation.to_array()),
        ));
    }
    let block = rotation(block).map_err(|reason| key_error(place, key, reason))?;
    let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    Ok(Rigid::from_matrix(block * flip, translation).inverse())
}

/// The pose that a frame states beside its matrix, to the last bit, as runs write it; none if it is not that of the matrix, which somebody may
/// have changed.
pub(super) fn exact(stated: Option<&Value>, of_matrix: &Rigid) -> Option<Rigid> {
    /// Rounding of a matrix, relative to the distance of the camera from the origin.
    const ROUNDING: f64 = 1e-9;
    let exact: Rigid = serde_json::from_value(stated?.clone()).ok()?;
    let apart = exact.translation.distance(of_matrix.translation) / (1.0 + of_matrix.translation.length());
    let turned = 1.0 - exact.rotation.dot(of_matrix.rotation).abs();
    (apart.max(turned) < ROUNDING && exact.rotation.is_normalized()).then_some(exact)
}

/// Camera-to-world matrix with OpenGL axes (y up, looks down -z), rows first, as in capture files.
pub fn opengl_pose(camera: &Camera) -> [[f64; 4]; 4] {
    let pose = camera.world_to_camera.inverse();
    let (r, t) = (pose.matrix(), pose.translation);
    let row = |i: usize| [r.x_axis[i], -r.y_axis[i], -r.z_axis[i], t[i]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

/// The rotation nearest to an almost orthonormal matrix.
pub(crate) fn rotation(block: DMat3) -> Result<DMat3, String> {
    let gram = block.transpose() * block;
    let off = |m: DMat3| m.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
    let error = off(gram - DMat3::IDENTITY);
    if error > ORTHONORMAL {
        let scale = ((gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0).sqrt();
        let squared = scale * scale;
        if squared > 0.0 && off(gram * (1.0 / squared) - DMat3::IDENTITY) <= ORTHONORMAL {
            return Err(format!(
                "the rotation block has a uniform scale of {scale:.6}; divide its 3x3 block by that number"
            ));
        }
        return Err(format!(
            "the rotation block is not orthonormal (R^T R is off by {error:.2e}, allowed {ORTHONORMAL:.0e}); \
             remove scale and shear"
        ));
    }
    if block.determinant() < 0.0 {
        return Err("the rotation block mirrors (determinant -1); axes must be right-handed, x right, y up".into());
    }
    // Newton's iteration for the polar factor; quadratic, so three steps go from 1e-3 to rounding.
    Ok((0..4).fold(block, |r, _| (r + r.inverse().transpose()) * 0.5))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn opengl_identity_looks_down_minus_z_with_y_up() {
        let eye = json!([[1.0, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 2.0], [0.0, 0.0, 0.0, 1.0]]);
        let pose = world_to_camera(&eye, "f", "k").unwrap();
        let seen = pose.apply(DVec3::new(0.6, 0.1, 0.0));
        assert!((seen - DVec3::new(0.1, -0.1, 2.0)).length() < 1e-12, "{seen}");
    }

    #[test]
    fn almost_rotations_are_repaired_and_others_refused() {
        let turn = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(-0.3);
        let repaired = rotation(turn + DMat3::from_cols_array(&[2e-4; 9])).unwrap();
        let gram = repaired.transpose() * repaired;
        assert!((gram - DMat3::IDENTITY).to_cols_array().iter().all(|v| v.abs() < 1e-12));
        assert!(rotation(turn * 1.5).unwrap_err().contains("uniform scale of 1.500000"));
        assert!(rotation(turn * DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1.2))).unwrap_err().contains("orthonormal"));
        assert!(rotation(turn * DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0))).unwrap_err().contains("mirrors"));
        assert!(rotation(DMat3::ZERO).is_err());
    }
}
