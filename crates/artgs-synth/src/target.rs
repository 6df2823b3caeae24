//! Folders of captures: which objects are meant, and whether a folder may be written.

use crate::population::random_info;
use crate::recording::recording_info;
use crate::{SUITES, capture_info, objects, suite};
use std::fs::DirEntry;
use std::path::{Path, PathBuf};

/// What a folder is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A capture of an object of the catalogue.
    Capture,
    /// Recordings of one in a room.
    Recording,
    /// A random object.
    Random,
}

impl Kind {
    /// True if one of this kind wrote the folder, so that it may be replaced.
    fn wrote(self, folder: &Path) -> bool {
        match self {
            Self::Capture => capture_info(folder).is_some(),
            Self::Recording => recording_info(folder).is_some(),
            Self::Random => random_info(folder).is_some(),
        }
    }
}

/// Why nothing is written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TargetError {
    /// There is no such object or suite.
    #[error("there is no object or suite `{name}`; suites: {}; objects: {}", SUITES.join(", "), objects.join(", "))]
    Unknown {
        /// The name.
        name: String,
        /// Names of all objects.
        objects: Vec<&'static str>,
    },
    /// A file is in its place.
    #[error("{} is a file; give a folder", .0.display())]
    IsFile(PathBuf),
    /// It holds a capture of another kind.
    #[error("{} holds `{held}` of another capture; give another folder", folder.display())]
    Other {
        /// The folder.
        folder: PathBuf,
        /// What is in it.
        held: &'static str,
    },
    /// It holds other files.
    #[error("{} holds files that artgs synth did not write; give an empty folder", .0.display())]
    Foreign(PathBuf),
}

/// Objects to make, and the folder of each: an object is written into `out`, those of a suite into folders in it.
pub fn targets(what: &str, out: &Path) -> Result<Vec<(&'static str, PathBuf)>, TargetError> {
    if let Some(info) = objects().iter().find(|info| info.name == what) {
        return Ok(vec![(info.name, out.to_path_buf())]);
    }
    let Some(names) = suite(what) else {
        let objects = objects().iter().map(|info| info.name).collect();
        return Err(TargetError::Unknown { name: what.into(), objects });
    };
    Ok(names.into_iter().map(|name| (name, out.join(name))).collect())
}

/// Refuses a folder with files that were not written as this kind; `among` allows files that are of no capture.
pub fn require_free(kind: Kind, folder: &Path, among: bool) -> Result<(), TargetError> {
    if folder.exists() && !folder.is_dir() {
        return Err(TargetError::IsFile(folder.into()));
    }
    // A run that was killed at its first writes leaves nothing else.
    let unfinished = |entry: std::io::Result<DirEntry>| {
        entry.is_ok_and(|entry| entry.file_name().to_string_lossy().starts_with(".artgs"))
    };
    let empty = std::fs::read_dir(folder).map_or(true, |mut entries| entries.all(unfinished));
    if empty || kind.wrote(folder) {
        return Ok(());
    }
    // A capture among files of another one would be a mixture.
    if let Some(held) = ["start", "end", "gt"].into_iter().find(|name| folder.join(name).exists()) {
        return Err(TargetError::Other { folder: folder.into(), held });
    }
    if among { Ok(()) } else { Err(TargetError::Foreign(folder.into())) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CaptureOptions, write_object};

    #[test]
    fn foreign_folders_are_refused_and_own_ones_are_not() {
        let dir = tempfile::tempdir().unwrap();
        let check = |folder: &Path, among| require_free(Kind::Capture, folder, among);
        check(dir.path(), false).unwrap();
        check(&dir.path().join("missing"), false).unwrap();
        let file = dir.path().join("thesis.tex");
        std::fs::write(&file, "x").unwrap();
        assert_eq!(check(dir.path(), false), Err(TargetError::Foreign(dir.path().into())));
        assert_eq!(check(&file, true), Err(TargetError::IsFile(file.clone())));
        check(dir.path(), true).unwrap();
        let own = dir.path().join("own");
        let options = CaptureOptions { views: 2, test_views: 0, size: 16, ..CaptureOptions::default() };
        write_object("blade", &options, &own).unwrap();
        check(&own, false).unwrap();
        assert!(require_free(Kind::Recording, &own, true).is_err(), "a capture of another kind is not replaced");
    }

    #[test]
    fn a_suite_makes_a_folder_per_object() {
        let paris = targets("paris", Path::new("x")).unwrap();
        assert_eq!((paris.len(), &paris[9].1), (10, &PathBuf::from("x/storage")));
        assert_eq!(targets("storage", Path::new("x")).unwrap(), [("storage", PathBuf::from("x"))]);
        assert!(targets("sofa", Path::new("x")).unwrap_err().to_string().contains("suites: "));
    }
}
