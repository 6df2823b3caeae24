//! Poses as matrices in text files.

use super::files::{Odd, loose_numbers, text};
use super::pose::{Axes, is_lost};
use artgs_core::Rigid;
use std::path::Path;

/// World-to-camera motion of a file with a camera-to-world matrix of 3 or 4 rows.
pub(super) fn matrix_file(path: &Path, axes: Axes) -> Result<Rigid, Odd> {
    let content = text(path).map_err(|e| Odd::Wrong(e.to_string()))?;
    let lines: Vec<&str> = content.lines().filter(|l| !l.trim_start().starts_with('#')).collect();
    let numbers = loose_numbers(&lines.join(" "));
    let numbers = numbers.ok_or_else(|| Odd::Wrong("a value is not a number; remove the frame".into()))?;
    matrix(&numbers, axes)
}

/// The same of 12 or 16 numbers, row by row.
pub(super) fn matrix(numbers: &[f64], axes: Axes) -> Result<Rigid, Odd> {
    if ![12, 16].contains(&numbers.len()) {
        let reason = format!("{} numbers, expected 4 rows of 4 numbers; remove the frame", numbers.len());
        return Err(Odd::Wrong(reason));
    }
    let m = &numbers[..12];
    let rotation = [0, 1, 2, 4, 5, 6, 8, 9, 10].map(|i| m[i]);
    if is_lost(&[m[3], m[7], m[11]], &rotation) {
        return Err(Odd::Lost);
    }
    axes.world_to_camera_of_rows(m).map_err(Odd::Wrong)
}
