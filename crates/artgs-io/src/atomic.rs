//! Atomic writes: every writer of this crate uses [`write_atomic`].

use crate::FileError;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use tempfile::NamedTempFile;

/// Temporary names, in the folder of the file that is written.
const PREFIX: &str = ".artgs-";
const SUFFIX: &str = ".tmp";

/// True for the name of a file that [`write_atomic`] did not finish.
pub(crate) fn is_unfinished(name: &str) -> bool {
    name.starts_with(PREFIX) && name.ends_with(SUFFIX)
}

/// A new file in a folder under a temporary name.
pub(crate) fn unfinished(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    // A temporary file is private by default; the finished one gets the usual mode less the umask.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

/// Writes a file under a temporary name in the same folder and renames it, so that no reader and no interrupted run sees a
/// partial file. Creates missing parent folders and replaces an existing file.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_by(&System, path, bytes)
}

/// What a write asks of the operating system, step by step; tests make steps fail.
trait Steps {
    /// Makes a folder and those above it.
    fn make_folder(&self, folder: &Path) -> io::Result<()>;

    /// Makes a file under a temporary name. It is removed when it is dropped.
    fn create(&self, folder: &Path) -> io::Result<NamedTempFile>;

    /// Writes some of the bytes and returns how many.
    fn write(&self, file: &mut File, bytes: &[u8]) -> io::Result<usize>;

    /// Gives the file its name.
    fn rename(&self, file: NamedTempFile, path: &Path) -> io::Result<()>;
}

/// The operating system as it is.
struct System;

impl Steps for System {
    fn make_folder(&self, folder: &Path) -> io::Result<()> {
        std::fs::create_dir_all(folder)
    }

    fn create(&self, folder: &Path) -> io::Result<NamedTempFile> {
        unfinished(folder)
    }

    fn write(&self, file: &mut File, bytes: &[u8]) -> io::Result<usize> {
        file.write(bytes)
    }

    fn rename(&self, file: NamedTempFile, path: &Path) -> io::Result<()> {
        file.persist(path).map(drop).map_err(|e| e.error)
    }
}

/// A file that is written by steps.
struct Stepwise<'a>(&'a dyn Steps, &'a mut File);

impl Write for Stepwise<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(self.1, bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.1.flush()
    }
}

fn write_by(steps: &dyn Steps, path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let fail = |source| FileError::Write { path: path.into(), source };
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    steps.make_folder(folder).map_err(fail)?;
    let mut file = steps.create(folder).map_err(fail)?;
    // Continues after interruptions and short writes.
    Stepwise(steps, file.as_file_mut()).write_all(bytes).map_err(fail)?;
    steps.rename(file, path).map_err(fail)
}

#[cfg(test)]
#[path = "atomic_tests.rs"]
mod tests;
