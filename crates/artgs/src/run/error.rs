//! Why a run stopped.

use super::output::OutputError;
use crate::discover::{CorrectError, DiscoverError};
use crate::evaluate::PictureError;
use crate::fit::FitError;
use crate::prepare::{InputError, PrepareError};
use crate::registration::RegistrationError;
use crate::settings::ConfigError;
use crate::surface::SurfaceError;
use artgs_io::FileError;
use artgs_io::replica::ReplicaFileError;
use artgs_io::run_folder::NoReplica;

/// Why a run stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The input cannot be used.
    #[error(transparent)]
    Prepare(Box<PrepareError>),
    /// Held-out photos cannot be compared.
    #[error(transparent)]
    Pictures(#[from] PictureError),
    /// There is no replica in a folder.
    #[error(transparent)]
    NoReplica(#[from] NoReplica),
    /// The folder of the run cannot be used.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A replica and a ground truth of different units or places.
    #[error(
        "the replica fills {replica}, the ground truth {truth} at the start: they do not meet or differ more than 20 times in \
         size, so their units or frames differ"
    )]
    Elsewhere {
        /// Box of the replica.
        replica: String,
        /// Box of the ground truth.
        truth: String,
    },
    /// No parts are found before training.
    #[error("with these settings parts are learnt in training: none are found before it")]
    PartsLearnt,
    /// Settings that cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Parts could not be found.
    #[error(transparent)]
    Discover(#[from] DiscoverError),
    /// `corrections.json` cannot be read.
    #[error("{0}; correct the file or remove it")]
    Corrections(FileError),
    /// `corrections.json` cannot be applied.
    #[error(transparent)]
    Correct(#[from] CorrectError),
    /// The baseline could not find parts.
    #[error(transparent)]
    Registration(#[from] RegistrationError),
    /// Training failed.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// Meshing failed.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// A file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A replica could not be read or written.
    #[error(transparent)]
    Replica(#[from] ReplicaFileError),
}

impl From<PrepareError> for Error {
    fn from(error: PrepareError) -> Self {
        Self::Prepare(error.into())
    }
}

impl From<InputError> for Error {
    fn from(error: InputError) -> Self {
        PrepareError::from(error).into()
    }
}

impl Error {
    /// True if the user has to change the capture, the settings or the command.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::PartsLearnt
            | Self::Prepare(_)
            | Self::NoReplica(_)
            | Self::Pictures(_)
            | Self::Elsewhere { .. }
            | Self::Config(_)
            | Self::Discover(_)
            | Self::Corrections(_)
            | Self::Correct(_)
            | Self::Registration(_) => true,
            Self::Output(error) => error.is_bad_input(),
            // A full disk is no fault of the replica.
            Self::Replica(error) => !matches!(error, ReplicaFileError::File(FileError::Write { .. })),
            Self::Fit(_) | Self::Surface(_) | Self::File(_) => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    #[test]
    fn a_replica_that_cannot_be_written_is_no_bad_input() {
        let path = std::path::PathBuf::from("meshes/start/part_0.ply");
        let full = FileError::Write { path: path.clone(), source: io::ErrorKind::StorageFull.into() };
        assert!(!Error::from(ReplicaFileError::from(full)).is_bad_input());
        let missing = FileError::Read { path, source: io::ErrorKind::NotFound.into() };
        assert!(Error::from(ReplicaFileError::from(missing)).is_bad_input());
    }
}
