//! The scale of a COLMAP model from measured depth: the model's unit of length is arbitrary.

use super::RecordingError;
use super::colmap_model::{Model, Shot, points};
use super::index::Index;
use std::path::Path;

/// Images that are compared with the model's points.
const IMAGES: usize = 24;
/// Least number of points with depth.
const LEAST: usize = 50;
/// Largest spread of the middle half of all ratios, relative to their median: above it, depth and model disagree.
const SPREAD: f64 = 0.2;
/// Scales nearer to 1 are the noise of the estimate: the model is in metres.
const SAME: f64 = 0.01;

/// Scales the poses to metres if the points of the model have measured depth, and says so in a warning. Without points the model
/// counts as metric, because its depth is.
pub(super) fn apply(index: &mut Index, shots: &[Shot], model: &Model, folder: &Path) -> Result<(), RecordingError> {
    index.metric = true;
    let points = points(folder)?;
    let mut ratios = Vec::new();
    let step = shots.len().div_ceil(IMAGES).max(1);
    for (entry, shot) in index.entries.iter().zip(shots).step_by(step) {
        let (Some(load), Some(lens)) = (&entry.depth, model.cameras.get(&shot.camera)) else { continue };
        if shot.observations.is_empty() || points.is_empty() {
            continue;
        }
        let depth = load()?;
        let Some((width, height)) = lens.size else { continue };
        let (sx, sy) = (f64::from(depth.width) / f64::from(width), f64::from(depth.height) / f64::from(height));
        for (pixel, id) in &shot.observations {
            let Some(point) = points.get(id) else { continue };
            let z = shot.world_to_camera.apply(*point).z;
            let (x, y) = ((pixel.x * sx) as usize, (pixel.y * sy) as usize);
            if z <= 0.0 || pixel.min_element() < 0.0 || x >= depth.width as usize || y >= depth.height as usize {
                continue;
            }
            let measured = f64::from(depth.map.at(y * depth.width as usize + x));
            if measured > 0.0 {
                ratios.push(measured / z);
            }
        }
    }
    let shown = folder.display();
    if ratios.len() < LEAST {
        index.warnings.push(format!(
            "{shown}: the scale of the model cannot be compared with the depth images; poses must be in metres"
        ));
        return Ok(());
    }
    ratios.sort_by(f64::total_cmp);
    let at = |share: f64| ratios[((ratios.len() - 1) as f64 * share) as usize];
    let (scale, spread) = (at(0.5), (at(0.75) - at(0.25)) / at(0.5));
    if spread > SPREAD {
        let reason = format!(
            "the depth images do not belong to this model: depth over distance varies by {:.0}% about {scale:.3}; register \
             depth to the images, or remove the depth folder",
            100.0 * spread
        );
        return Err(RecordingError::incomplete(folder, reason));
    }
    if (scale - 1.0).abs() > SAME {
        for entry in &mut index.entries {
            entry.world_to_camera.translation *= scale;
        }
        index.warnings.push(format!("{shown}: the model was scaled by {scale:.4} to fit the depth images"));
    }
    Ok(())
}
