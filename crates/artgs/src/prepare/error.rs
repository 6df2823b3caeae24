//! Why an input cannot be used.

use super::{InputError, MemoryError};
use crate::align::AlignError;
use crate::settings::ConfigError;
use artgs_io::{CaptureError, RecordingError};

/// Why an input cannot be used. The user has to change the input, the settings or the limits.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PrepareError {
    /// What was named is no input.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A capture cannot be read.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The states of a capture do not overlap, for this reason.
    #[error("{0}")]
    Apart(String),
    /// Views or states contradict each other; `Request::force_input` uses them as they are.
    #[error("{0}")]
    Contradiction(String),
    /// A recording has too little depth to be aligned, for this reason.
    #[error("{0}")]
    FewDepths(String),
    /// Recordings cannot be aligned.
    #[error(transparent)]
    Align(#[from] AlignError),
    /// The images do not fit into the memory.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// Settings that cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
}
