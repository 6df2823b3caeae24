//! Why nothing was exported, and what happens during an export.

use super::{ExportStep, FrontAxis};
use artgs_io::asset::Format;
use artgs_io::folder_lock::LockError;
use artgs_io::replica::ReplicaFileError;
use artgs_io::run_folder::NoReplica;
use artgs_io::{CaptureError, FileError};
use std::path::PathBuf;

/// Why nothing, or not everything, was exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A setting out of range.
    #[error("`{name}` is {value:?}; give a number from {:?} to {:?}", range[0], range[1])]
    Setting {
        /// Field of [`ExportOptions`](super::ExportOptions).
        name: &'static str,
        /// Its value.
        value: f64,
        /// Least and largest values.
        range: [f64; 2],
    },
    /// A name that no file can have.
    #[error("`name` is `{0}`; give 1 to 100 characters, one of them a letter or digit")]
    Name(String),
    /// A front that is the upward or downward axis.
    #[error("the front {} is the upward axis of the capture or opposite to it; give a horizontal direction", .0.name())]
    Front(FrontAxis),
    /// Nothing says which way is up.
    #[error(
        "which way is up is not known: the recording does not state it, and no floor or walls say it; give an axis of the \
         capture (x, -x, y, -y, z or -z) or a direction such as 0.1,0,0.99"
    )]
    UnknownUp,
    /// There is no replica.
    #[error(transparent)]
    NoReplica(#[from] NoReplica),
    /// Another process uses the folder, or it cannot be locked.
    #[error(transparent)]
    Lock(#[from] LockError),
    /// The photos that were named cannot be read.
    #[error(transparent)]
    Photos(#[from] CaptureError),
    /// A format whose writer is not built in.
    #[error("format {0} is not built into this program")]
    NotBuiltIn(Format),
    /// The replica cannot be read.
    #[error(transparent)]
    Replica(#[from] ReplicaFileError),
    /// A mesh or Gaussians of the replica cannot be read.
    #[error(transparent)]
    Input(FileError),
    /// No asset can be built from it.
    #[error("{0}")]
    Build(String),
    /// The built asset is not valid.
    #[error("{}: {reason}", path.display())]
    Asset {
        /// The `replica.json`.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A file could not be written.
    #[error(transparent)]
    Output(FileError),
}

impl ExportError {
    /// True if the user has to change the replica, the options or the build.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, Self::Output(_) | Self::Lock(LockError::File(_)))
    }
}

/// What happens during an export.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportEvent<'a> {
    /// A surface that is not as it should be, in one sentence.
    Warning(&'a str),
    /// The next step begins.
    Begins(ExportStep),
    /// So many formats of all are written.
    Written(usize, usize),
}
