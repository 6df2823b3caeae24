//! What a user states about poses: the axes of their camera frame, and their direction.

use super::RecordingFormat;
use super::index::Index;
use super::pose::Axes;
use artgs_core::Rigid;
use glam::{DMat3, DVec3};

/// Directions of the x, y and z axis of the camera frame that poses belong to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisOrder(DMat3);

impl AxisOrder {
    /// `opencv`, `opengl`, `robot`, or three of the letters R, L, U, D, F, B: where x, y and z point, as the camera sees it; `RDF`
    /// is `opencv`, `RUB` `opengl`, `FLU` `robot`. The error says what is wrong.
    pub fn parse(text: &str) -> Result<Self, String> {
        let expected = "expected opencv, opengl, robot, or where x, y and z point, such as RDF: right, down, forward";
        let letters = match text.to_ascii_lowercase().as_str() {
            "opencv" => "RDF".to_string(),
            "opengl" => "RUB".to_string(),
            "robot" => "FLU".to_string(),
            _ => text.to_ascii_uppercase(),
        };
        let directions: Option<Vec<DVec3>> = letters.chars().map(direction).collect();
        let Some(&[x, y, z]) = directions.as_deref() else { return Err(format!("`{text}`: {expected}")) };
        // Rows: the axes of the poses in the camera's OpenCV frame.
        let matrix = DMat3::from_cols(x, y, z).transpose();
        if matrix.determinant() < 0.5 {
            return Err(format!("`{text}` is not right-handed or names a direction twice; {expected}"));
        }
        Ok(Self(matrix))
    }
}

/// A direction in the OpenCV frame of a camera.
fn direction(letter: char) -> Option<DVec3> {
    Some(match letter {
        'R' => DVec3::X,
        'L' => DVec3::NEG_X,
        'D' => DVec3::Y,
        'U' => DVec3::NEG_Y,
        'F' => DVec3::Z,
        'B' => DVec3::NEG_Z,
        _ => return None,
    })
}

/// Reads the poses of an index, which were read as the format has them, with other axes or in the other direction.
pub(super) fn restate(index: &mut Index, format: RecordingFormat, axes: Option<AxisOrder>, inverted: bool) {
    if axes.is_none() && !inverted {
        return;
    }
    let turned = |m: DMat3| Rigid::from_matrix(m, DVec3::ZERO);
    let of_format = turned(match format.axes() {
        Axes::OpenGl => DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)),
        Axes::OpenCv => DMat3::IDENTITY,
    });
    let stated_axes = axes.map_or(of_format, |axes| turned(axes.0));
    // COLMAP's poses lead from the world to the camera already.
    let inverts = inverted != (format == RecordingFormat::Colmap);
    for entry in &mut index.entries {
        let world_from_camera = entry.world_to_camera.inverse();
        let stated = match format {
            RecordingFormat::Colmap => entry.world_to_camera,
            _ => world_from_camera * of_format,
        };
        let world_from_stated = if inverts { stated.inverse() } else { stated };
        entry.world_to_camera = (world_from_stated * stated_axes).inverse();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::index::Entry;
    use crate::recording::lens::{Distortion, Lens};
    use crate::recording::pixels::Color;
    use glam::DQuat;

    fn pose() -> Rigid {
        Rigid {
            rotation: DQuat::from_rotation_y(0.4) * DQuat::from_rotation_x(0.2),
            translation: DVec3::new(1.0, 2.0, 3.0),
        }
    }

    /// The camera-to-world pose that is read from `stated`.
    fn read(stated: Rigid, format: RecordingFormat, axes: Option<&str>, inverted: bool) -> Rigid {
        let as_read = match (format, format.axes()) {
            (RecordingFormat::Colmap, _) => stated,
            (_, Axes::OpenGl) => Axes::OpenGl.world_to_camera(stated.matrix(), stated.translation).unwrap(),
            (_, Axes::OpenCv) => stated.inverse(),
        };
        let lens = Lens { focal: glam::DVec2::ONE, center: None, size: None, distortion: Distortion::None };
        let entry = Entry {
            name: String::new(),
            time: None,
            world_to_camera: as_read,
            lens,
            color: Box::new(|| Ok(Color::new(1, 1, vec![[0; 4]]))),
            depth: None,
            mask: None,
        };
        let mut index = Index { entries: vec![entry], ..Index::default() };
        restate(&mut index, format, axes.map(|a| AxisOrder::parse(a).unwrap()), inverted);
        index.entries[0].world_to_camera.inverse()
    }

    #[test]
    fn poses_of_every_notation_are_read_back() {
        use RecordingFormat::{Colmap, Nerfstudio, Tum};
        let truth = pose();
        let same = |found: Rigid| {
            let off = truth.inverse() * found;
            assert!(off.angle() < 1e-9 && off.translation.length() < 1e-9, "{off:?}");
        };
        let turn = |x: DVec3, y: DVec3, z: DVec3| Rigid::from_matrix(DMat3::from_cols(x, y, z), DVec3::ZERO);
        // Forward, left, up in OpenCV axes.
        let robot = truth * turn(DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y);
        let opengl = truth * turn(DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z);
        same(read(truth, Tum, None, false));
        same(read(robot, Tum, Some("robot"), false));
        same(read(robot, Nerfstudio, Some("FLU"), false));
        same(read(opengl, Tum, Some("opengl"), false));
        same(read(truth, Nerfstudio, Some("opencv"), false));
        same(read(truth.inverse(), Tum, None, true));
        same(read(opengl.inverse(), Nerfstudio, None, true));
        same(read(truth, Colmap, None, true));
        same(read(opengl.inverse(), Colmap, Some("opengl"), false));
    }

    #[test]
    fn wrong_axes_are_refused() {
        for text in ["RDB", "RRF", "up", "", "LDF"] {
            assert!(AxisOrder::parse(text).is_err(), "{text}");
        }
    }
}
