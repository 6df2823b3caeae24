//! Errors of recordings.

use crate::{CaptureError, FileError};
use std::path::{Path, PathBuf};

/// Why a recording cannot be read or written; messages name the file, the frame or field, and a remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// There is no such file or folder.
    #[error("{}: no such file or directory; give the folder or file of the recording", path.display())]
    Missing {
        /// The given path.
        path: PathBuf,
    },
    /// No known format.
    #[error("{}: not a recording of a known format{found}; known are {known}; state the format if it is one of them", path.display())]
    Unknown {
        /// The given path.
        path: PathBuf,
        /// What it is, with a remedy, after a colon; empty if nothing is known.
        found: String,
        /// Every format with the files that it is recognised by.
        known: String,
    },
    /// One file of a recording.
    #[error("{}: is a file of a recording; give its folder {}", path.display(), folder.display())]
    OneFile {
        /// The given path.
        path: PathBuf,
        /// The folder, which has a known format.
        folder: PathBuf,
    },
    /// A folder of one state of a capture.
    #[error("{}: is a folder of the capture {whole}; give the capture alone: artgs reconstruct {whole} -o OUT", path.display(), whole = whole.display())]
    OneState {
        /// The given path.
        path: PathBuf,
        /// The capture.
        whole: PathBuf,
    },
    /// Images alone.
    #[error("{}: {}", path.display(), crate::capture::NO_POSES)]
    NoPoses {
        /// The given path.
        path: PathBuf,
    },
    /// A format without a needed file or value.
    #[error("{}: {reason}", path.display())]
    Incomplete {
        /// The file or folder.
        path: PathBuf,
        /// What is absent or unusable, and the remedy.
        reason: String,
    },
    /// A key of a JSON file.
    #[error(transparent)]
    Key(#[from] CaptureError),
    /// A single file.
    #[error(transparent)]
    File(#[from] FileError),
    /// Camera intrinsics are neither in the files nor in the options.
    #[error(
        "{}: contains no camera intrinsics; state them (fx,fy,cx,cy) or write `fx fy cx cy` to a file `intrinsics.txt` \
         there{hint}",
        path.display()
    )]
    Intrinsics {
        /// The folder or file.
        path: PathBuf,
        /// Known values.
        hint: &'static str,
    },
}

impl RecordingError {
    /// An [`RecordingError::Incomplete`].
    pub(super) fn incomplete(path: &Path, reason: impl Into<String>) -> Self {
        Self::Incomplete { path: path.into(), reason: reason.into() }
    }

    /// A file that does not conform to its format.
    pub(super) fn malformed(path: &Path, reason: impl Into<String>) -> Self {
        Self::File(FileError::malformed(path, reason))
    }
}
