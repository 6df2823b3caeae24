//! Files of a folder or of a zip archive.

use super::RecordingError;
use crate::error::read_bytes;
use std::io::Read;
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// Where the files of a recording are.
#[derive(Clone, Debug)]
pub(super) enum Store {
    Folder(PathBuf),
    Zip(PathBuf),
}

/// Largest size of an unpacked file, bytes.
const LARGEST: u64 = 1 << 30;

impl Store {
    /// Path in messages.
    pub(super) fn shown(&self, name: &str) -> PathBuf {
        match self {
            Self::Folder(dir) | Self::Zip(dir) => dir.join(name),
        }
    }

    /// Names of all files, relative, with `/`; of a folder those in it and in its folders.
    pub(super) fn names(&self) -> Result<Vec<String>, RecordingError> {
        match self {
            Self::Folder(dir) => {
                let inside = |name: String| {
                    let nested = super::files::names(&dir.join(&name)).into_iter();
                    nested.map(move |n| format!("{name}/{n}")).collect::<Vec<_>>()
                };
                let top = super::files::names(dir);
                Ok(top.iter().cloned().chain(top.iter().cloned().flat_map(inside)).collect())
            }
            Self::Zip(path) => Ok(open(path)?.file_names().map(String::from).collect()),
        }
    }

    pub(super) fn read(&self, name: &str) -> Result<Vec<u8>, RecordingError> {
        let Self::Zip(path) = self else { return Ok(read_bytes(&self.shown(name))?) };
        let broken = |e: &dyn std::fmt::Display| {
            RecordingError::malformed(
                &self.shown(name),
                format!("cannot be unpacked ({e}); export the recording again"),
            )
        };
        let mut archive = open(path)?;
        let file = archive.by_name(name).map_err(|e| broken(&e))?;
        let mut bytes = Vec::new();
        file.take(LARGEST).read_to_end(&mut bytes).map_err(|e| broken(&e))?;
        Ok(bytes)
    }
}

fn open(path: &Path) -> Result<ZipArchive<std::io::BufReader<std::fs::File>>, RecordingError> {
    let file = std::fs::File::open(path).map_err(|source| crate::FileError::Read { path: path.into(), source })?;
    ZipArchive::new(std::io::BufReader::new(file)).map_err(|e| {
        RecordingError::malformed(path, format!("not a complete zip archive ({e}); copy or export the recording again"))
    })
}
