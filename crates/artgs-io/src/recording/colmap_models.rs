//! Which of the COLMAP models below a folder is read: programs write several.

use super::RecordingError;
use super::colmap_model::Model;
use super::files::names;
use std::path::{Path, PathBuf};

/// Names of folders that models are looked for in, beside numbers, those that are preferred among equals first.
const FOLDERS: [&str; 9] =
    ["sparse", "reconstruction", "model", "models", "colmap", "dense", "distorted", "undistorted", "sfm"];

/// Deepest folder: `colmap/dense/0/sparse`.
const DEEPEST: usize = 4;

/// Folders at and below `path` in which models may be, in the order of preference.
fn places(path: &Path) -> Vec<PathBuf> {
    let (mut places, mut next) = (vec![path.to_path_buf()], 0);
    let mut level_end = 1;
    for _ in 0..DEEPEST {
        while next < level_end {
            let dir = places[next].clone();
            let mut inside = names(&dir);
            let rank = |name: &String| {
                let number = name.parse::<usize>().ok().filter(|n| *n < 1000).map(|n| FOLDERS.len() + n);
                FOLDERS.iter().position(|f| f == name).or(number)
            };
            inside.retain(|name| rank(name).is_some() && dir.join(name).is_dir());
            inside.sort_by_key(|name| rank(name));
            places.extend(inside.into_iter().map(|name| dir.join(name)));
            next += 1;
        }
        level_end = places.len();
    }
    places
}

fn has(dir: &Path, what: &str) -> bool {
    ["txt", "bin"].iter().any(|suffix| dir.join(format!("{what}.{suffix}")).is_file())
}

fn is_complete(dir: &Path) -> bool {
    ["txt", "bin"].iter().any(|suffix| Model::files(dir, suffix).iter().all(|file| file.is_file()))
}

/// True if there is a model.
pub(super) fn any(path: &Path) -> bool {
    places(path).iter().any(|dir| is_complete(dir))
}

/// What a model lacks, if there is one of which files are missing and no other.
pub(super) fn incomplete(path: &Path) -> Option<String> {
    let places = places(path);
    if places.iter().any(|dir| is_complete(dir)) {
        return None;
    }
    places.iter().find_map(|dir| {
        let missing = match (has(dir, "cameras"), has(dir, "images"), has(dir, "points3D")) {
            (true, false, true) | (true, false, false) if !dir.join("images").is_dir() || has(dir, "points3D") => {
                "images"
            }
            (false, true, _) => "cameras",
            _ => return None,
        };
        let shown = dir.strip_prefix(path).ok().filter(|p| !p.as_os_str().is_empty());
        let place = shown.map_or("here".into(), |p| format!("in {}", p.display()));
        Some(format!(
            "the COLMAP model {place} lacks {missing}.txt or {missing}.bin; copy it there, or export the model again"
        ))
    })
}

/// The model with most images that exist, with its folder; a warning names the others. `usable` counts images that exist.
pub(super) fn best(
    path: &Path,
    usable: impl Fn(&Path, &Model) -> usize,
    warnings: &mut Vec<String>,
) -> Result<(PathBuf, Model), RecordingError> {
    let folders: Vec<PathBuf> = places(path).into_iter().filter(|dir| is_complete(dir)).collect();
    let (mut best, mut failed, mut others) = (None::<(usize, PathBuf, Model)>, None, Vec::new());
    for folder in folders {
        let model = match Model::read(&folder) {
            Ok(model) => model,
            Err(error) => {
                others.push(format!("{} (cannot be read)", folder.display()));
                failed.get_or_insert(error);
                continue;
            }
        };
        let count = usable(&folder, &model);
        let described = |count: usize, folder: &Path| format!("{} ({count} images)", folder.display());
        match &best {
            Some((most, _, _)) if *most >= count => others.push(described(count, &folder)),
            _ => {
                if let Some((count, folder, _)) = best.replace((count, folder, model)) {
                    others.push(described(count, &folder));
                }
            }
        }
    }
    let Some((count, folder, model)) = best else {
        return Err(failed.unwrap_or_else(|| {
            let reason = "contains no COLMAP model; give the folder that contains the images and `sparse`";
            RecordingError::incomplete(path, incomplete(path).unwrap_or(reason.into()))
        }));
    };
    if !others.is_empty() {
        let (used, others) = (folder.display(), others.join(", "));
        warnings.push(format!("{}: the model {used} with {count} images is used, not {others}", path.display()));
    }
    Ok((folder, model))
}
