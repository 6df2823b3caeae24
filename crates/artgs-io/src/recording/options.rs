//! What a caller states about a recording.

use super::{AxisOrder, RecordingError, RecordingFormat};
use artgs_core::Intrinsics;
use std::path::{Path, PathBuf};

/// How a recording is read.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingOptions {
    /// Format; none: recognised by content.
    pub format: Option<RecordingFormat>,
    /// Largest number of frames that are kept, at least 2.
    pub frames: usize,
    /// Largest image width or height, pixels: larger images are reduced.
    pub longest_side: u32,
    /// Intrinsics for formats without, of the recorded images; width and height 0: those of the images.
    /// Takes precedence over intrinsics in a file beside such a recording.
    pub intrinsics: Option<Intrinsics>,
    /// Poses for formats without (bags): `timestamp tx ty tz qx qy qz qw` per line, camera-to-world, OpenCV axes.
    pub poses: Option<PathBuf>,
    /// Metres (scene units) per stored number of depth; none: as the files state it, or as the format has it.
    pub depth_unit: Option<f64>,
    /// Axes of the camera frame that poses belong to; none: those of the format.
    pub axes: Option<AxisOrder>,
    /// Poses lead in the other direction than those of the format: from the world to the camera.
    pub inverted_poses: bool,
    /// Use every n-th recorded frame only, at least 1.
    pub every: usize,
    /// Of every `every` frames the one with this number, from 0.
    pub offset: usize,
}

impl Default for RecordingOptions {
    fn default() -> Self {
        Self {
            format: None,
            frames: 90,
            longest_side: 720,
            intrinsics: None,
            poses: None,
            depth_unit: None,
            axes: None,
            inverted_poses: false,
            every: 1,
            offset: 0,
        }
    }
}

impl RecordingOptions {
    pub(super) fn check(&self, path: &Path) -> Result<(), RecordingError> {
        let wrong = |reason: String| Err(RecordingError::incomplete(path, reason));
        if self.frames < 2 {
            return wrong(format!("{} frames are too few; keep 2 or more", self.frames));
        }
        if self.longest_side < 16 {
            return wrong(format!("images of {} pixels are too small; use 16 or more", self.longest_side));
        }
        if self.every == 0 || self.offset >= self.every {
            return wrong(format!(
                "every {}th frame with offset {} selects nothing; the offset must be below the step",
                self.every, self.offset
            ));
        }
        Ok(())
    }
}

/// Metres per stored number of depth from text: a number with `m`, `cm`, `mm` or `um`, or one of these alone. The error says what is
/// wrong.
pub fn parse_depth_unit(text: &str) -> Result<f64, String> {
    let text = text.trim().to_ascii_lowercase();
    let units = [("mm", 1e-3), ("cm", 1e-2), ("um", 1e-6), ("m", 1.0)];
    let split = units.iter().find_map(|(name, metres)| Some((text.strip_suffix(name)?.trim(), metres)));
    let (number, metres) = split.unwrap_or((&text, &1.0));
    let count = if number.is_empty() && split.is_some() { Some(1.0) } else { number.parse::<f64>().ok() };
    let unit = count.map(|count| count * metres).filter(|unit| (1e-9..=1e6).contains(unit));
    unit.ok_or_else(|| {
        format!("`{text}` is no length; write for example mm, 0.2mm, cm, m: the length of one stored number")
    })
}

/// Intrinsics from text `fx fy cx cy [width height]`, separated by spaces or commas, as calibration tools publish them: the
/// centre of the top left pixel is (0, 0) there. Width and height are 0 if absent. The error says what is wrong.
pub fn parse_intrinsics(text: &str) -> Result<Intrinsics, String> {
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty());
    let numbers: Result<Vec<f64>, _> = words.map(str::parse::<f64>).collect();
    let numbers = numbers.map_err(|e| format!("`{}`: {e}; write `fx fy cx cy` in pixels", text.trim()))?;
    let (k, size) = match *numbers.as_slice() {
        [fx, fy, cx, cy] => ([fx, fy, cx, cy], [0.0, 0.0]),
        [fx, fy, cx, cy, w, h] => ([fx, fy, cx, cy], [w, h]),
        _ => return Err(format!("{} numbers, expected `fx fy cx cy` or `fx fy cx cy width height`", numbers.len())),
    };
    let usable = k.iter().all(|v| v.is_finite()) && k[0] > 0.0 && k[1] > 0.0;
    if !usable || size.iter().any(|v| !(0.0..=1e6).contains(v) || v.fract() != 0.0) {
        return Err("focal lengths must be above 0, width and height whole numbers".into());
    }
    Ok(Intrinsics { fx: k[0], fy: k[1], cx: k[2] + 0.5, cy: k[3] + 0.5, width: size[0] as u32, height: size[1] as u32 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_depth() {
        for (text, metres) in [
            ("mm", 1e-3),
            ("0.2mm", 2e-4),
            ("0.1 mm", 1e-4),
            ("cm", 0.01),
            ("M", 1.0),
            ("0.001", 1e-3),
            ("250um", 2.5e-4),
        ] {
            assert!((parse_depth_unit(text).unwrap() / metres - 1.0).abs() < 1e-9, "{text}");
        }
        for text in ["", "inch", "0mm", "-1mm", "nan", "1e99m"] {
            assert!(parse_depth_unit(text).is_err(), "{text}");
        }
    }
}
