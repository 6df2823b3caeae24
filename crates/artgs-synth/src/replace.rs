//! Replaces an earlier capture in a folder: removes what was written then, and nothing else.

use crate::SynthError;
use crate::write::{MARKER, write_json};
use artgs_io::FileError;
use artgs_io::run_folder::{load_json, remove_file, remove_folder};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

/// Names every file of a capture, relative to its folder.
const MANIFEST: &str = "synth_files.json";
/// Holds a capture while it is written.
const UNFINISHED: &str = ".artgs-synth.new";
/// Folders of a capture; files of others in them would become a part of it.
const FOLDERS: [&str; 3] = ["start", "end", "gt"];

/// Writes a capture with `write` and puts it in the place of an earlier one. Files of others stay; where they are in the
/// way, nothing changes. `marker` is the content of the marker, by whether the capture is complete.
pub(crate) fn replace(
    folder: &Path,
    marker: impl Fn(bool) -> Value,
    write: impl FnOnce(&Path) -> Result<(), SynthError>,
) -> Result<(), SynthError> {
    let earlier = earlier(folder)?;
    refuse_others(folder, &earlier)?;
    let new = folder.join(UNFINISHED);
    remove_folder(&new)?;
    write(&new).inspect_err(|_| {
        // The reason of the failure matters more than files that remain.
        let _ = fs::remove_dir_all(&new);
    })?;
    let mut files = BTreeSet::new();
    list(&new, &new, &mut files).map_err(|source| FileError::Read { path: new.clone(), source })?;
    if let Some(taken) = files.iter().find(|name| !earlier.contains(*name) && folder.join(name).exists()) {
        remove_folder(&new)?;
        return Err(SynthError::InTheWay(folder.join(taken)));
    }
    // A run that is killed from here on leaves files that the manifest names.
    write_json(&folder.join(MARKER), &marker(false))?;
    write_json(&folder.join(MANIFEST), &json!(earlier.union(&files).collect::<Vec<_>>()))?;
    earlier.iter().try_for_each(|name| remove(folder, name))?;
    for name in &files {
        let path = folder.join(name);
        let parent = path.parent().unwrap_or(folder);
        let moved = fs::create_dir_all(parent).and_then(|()| fs::rename(new.join(name), &path));
        moved.map_err(|source| FileError::Write { path, source })?;
    }
    remove_folder(&new)?;
    write_json(&folder.join(MANIFEST), &json!(files))?;
    Ok(write_json(&folder.join(MARKER), &marker(true))?)
}

/// Files of the capture that was written into the folder before, relative to it.
fn earlier(folder: &Path) -> Result<BTreeSet<String>, FileError> {
    let named: BTreeSet<String> = load_json(&folder.join(MANIFEST))?.unwrap_or_default();
    let inside = |name: &String| Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
    Ok(named.into_iter().filter(inside).collect())
}

/// Refuses a folder with files of others where a capture has its own.
fn refuse_others(folder: &Path, earlier: &BTreeSet<String>) -> Result<(), SynthError> {
    let mut present = BTreeSet::new();
    for path in FOLDERS.map(|name| folder.join(name)) {
        if path.is_dir() {
            list(folder, &path, &mut present).map_err(|source| FileError::Read { path, source })?;
        }
    }
    match present.difference(earlier).next() {
        Some(other) => Err(SynthError::InTheWay(folder.join(other))),
        None => Ok(()),
    }
}

/// Adds the files below a folder, relative to `root`, with `/`.
fn list(root: &Path, folder: &Path, into: &mut BTreeSet<String>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        // A link to a folder is a file of somebody.
        if path.is_dir() && !path.is_symlink() {
            list(root, &path, into)?;
        } else {
            let inside = path.strip_prefix(root).unwrap_or(&path);
            let words: Vec<_> = inside.iter().map(|word| word.to_string_lossy()).collect();
            into.insert(words.join("/"));
        }
    }
    Ok(())
}

/// Removes a file and the folders that it leaves empty.
fn remove(folder: &Path, name: &str) -> Result<(), FileError> {
    let path = folder.join(name);
    remove_file(&path)?;
    let parents = path.ancestors().skip(1).take_while(|parent| *parent != folder).map(Path::to_path_buf);
    for parent in parents.collect::<Vec<PathBuf>>() {
        if fs::remove_dir(parent).is_err() {
            break;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_io::write_atomic;

    fn written(folder: &Path, names: &[&str]) -> Result<(), SynthError> {
        replace(
            folder,
            |complete| json!({ "complete": complete }),
            |new| names.iter().try_for_each(|name| Ok(write_atomic(&new.join(name), b"ours")?)),
        )
    }

    fn files(folder: &Path) -> Vec<String> {
        let mut found = BTreeSet::new();
        list(folder, folder, &mut found).unwrap();
        found.into_iter().filter(|name| name != MARKER && name != MANIFEST).collect()
    }

    #[test]
    fn only_own_files_are_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path();
        fs::write(folder.join("notes.txt"), "mine").unwrap();
        written(folder, &["start/a.png", "start/train/b.png", "transforms.json"]).unwrap();
        written(folder, &["start/a.png", "end/c.png"]).unwrap();
        assert_eq!(files(folder), ["end/c.png", "notes.txt", "start/a.png"]);
        assert!(!folder.join("start/train").exists());
        for (mine, new) in [("start/mine.png", "start/a.png"), ("transforms.json", "transforms.json")] {
            fs::write(folder.join(mine), "mine").unwrap();
            let before = files(folder);
            let error = written(folder, &[new]).unwrap_err();
            assert!(matches!(&error, SynthError::InTheWay(path) if path.ends_with(mine)), "{error}");
            assert_eq!(files(folder), before);
            fs::remove_file(folder.join(mine)).unwrap();
        }
        // Paths of a manifest that lead outside are not followed.
        let outside = folder.join("inner");
        write_atomic(&outside.join(MANIFEST), br#"["../notes.txt", "/etc/none"]"#).unwrap();
        written(&outside, &["start/a.png"]).unwrap();
        assert!(folder.join("notes.txt").exists());
    }

    #[test]
    fn a_capture_that_was_killed_at_any_write_is_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path();
        write_atomic(&folder.join(UNFINISHED).join("start/x.png"), b"").unwrap();
        write_atomic(&folder.join("start/a.png"), b"").unwrap();
        write_atomic(&folder.join(MANIFEST), br#"["start/a.png", "start/b.png"]"#).unwrap();
        written(folder, &["start/c.png"]).unwrap();
        assert_eq!(files(folder), ["start/c.png"]);
    }
}
