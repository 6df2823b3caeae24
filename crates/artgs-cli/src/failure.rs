//! What a command failed with, and the exit code that says whose turn it is.

use std::fmt::{self, Display};

/// Why a command did not finish.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The caller must change the command, the configuration or the capture.
    BadInput(anyhow::Error),
    /// Everything else.
    Failed(anyhow::Error),
}

impl Failure {
    /// Something that the caller must change.
    pub(crate) fn bad(reason: impl Display) -> Self {
        Self::BadInput(anyhow::anyhow!("{reason}"))
    }

    /// 2 for bad input, else 1.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::BadInput(_) => 2,
            Self::Failed(_) => 1,
        }
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Self::Failed(error)
    }
}

impl Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (Self::BadInput(error) | Self::Failed(error)) = self;
        write!(f, "{error:#}")
    }
}
