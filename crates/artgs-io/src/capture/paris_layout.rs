//! PARIS' own layout: `{state}/camera_{split}.json` with `K` and one camera-to-world matrix per image id.

use super::CaptureError;
use super::json::{Object, key_error, matrix};
use super::pose::world_to_camera;
use super::views::{Entry, Focal, Lens};
use artgs_core::State;
use serde_json::Value;
use std::path::Path;

/// Depth of PARIS captures, if any, is in millimetres.
const DEPTH_SCALE: f64 = 1000.0;

/// The frames of a camera file, with paths of existing images.
pub(super) fn entries(
    dir: &Path,
    file: &Path,
    root: &Object,
    state: State,
    split: &str,
) -> Result<Vec<Entry>, CaptureError> {
    let shown = file.display().to_string();
    let k = root.get("K").ok_or_else(|| key_error(&shown, "K", "is missing; it must contain the 3x3 intrinsics"))?;
    let lens = lens(k, &shown)?;
    let folder = Path::new(state.name()).join(split);
    let entry = |(id, pose): (&String, &Value)| -> Result<Entry, CaptureError> {
        let place = format!("{shown}, frame {id}");
        let png = format!("{id}.png");
        let candidates = [folder.join("rgba").join(&png), folder.join(&png)];
        let image = candidates.iter().find(|p| dir.join(p).is_file()).cloned().ok_or_else(|| CaptureError::Image {
            place: place.clone(),
            reason: format!(
                "key `{id}`: no image {} or {} exists; add it or remove the key",
                candidates[0].display(),
                candidates[1].display()
            ),
        })?;
        let depth = Some(folder.join("depth").join(&png)).filter(|p| dir.join(p).is_file());
        let world_to_camera = world_to_camera(pose, &place, id)?;
        let sort_key = image.display().to_string();
        Ok(Entry { place, sort_key, image, depth, derived: None, depth_scale: DEPTH_SCALE, lens, world_to_camera })
    };
    root.iter().filter(|(id, _)| *id != "K").map(entry).collect()
}

fn lens(k: &Value, shown: &str) -> Result<Lens, CaptureError> {
    let k = matrix::<3>(k, shown, "K")?;
    if k[0][0] <= 0.0 || k[1][1] <= 0.0 {
        return Err(key_error(shown, "K", "focal lengths K[0][0] and K[1][1] must be above 0"));
    }
    if k[0][1].abs() > 1e-6 * k[0][0] || k[1][0] != 0.0 || k[2] != [0.0, 0.0, 1.0] {
        return Err(key_error(shown, "K", "expected [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] without skew, in pixels"));
    }
    Ok(Lens {
        x: Focal::Pixels(k[0][0]),
        y: Some(Focal::Pixels(k[1][1])),
        cx: Some(k[0][2]),
        cy: Some(k[1][2]),
        width: None,
        height: None,
    })
}
