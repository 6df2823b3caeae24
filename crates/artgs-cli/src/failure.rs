//! What a command failed with, and its exit code.

use crate::printable::printable;
use artgs::Error;
use artgs::fit::FitError;
use artgs::prepare::{InputError, MemoryError, PrepareError};
use artgs::run::OutputError;
use std::fmt::{self, Display};

/// Why a command did not finish.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The caller must change the command, the configuration or the capture.
    BadInput(anyhow::Error),
    /// Everything else.
    Failed(anyhow::Error),
    /// A check found something wrong, which was shown already.
    ChecksFailed(String),
    /// Nothing is wrong with the input: the same command may succeed later.
    Retry(anyhow::Error),
    /// The user stopped it.
    Interrupted(anyhow::Error),
}

impl Failure {
    /// Something that the caller must change.
    pub(crate) fn bad(reason: impl Display) -> Self {
        Self::BadInput(anyhow::anyhow!("{reason}"))
    }

    /// An error that the caller must correct.
    pub(crate) fn bad_input(error: impl Into<anyhow::Error>) -> Self {
        Self::BadInput(error.into())
    }

    /// Any other error.
    pub(crate) fn failed(error: impl Into<anyhow::Error>) -> Self {
        Self::Failed(error.into())
    }

    /// An error of the library with the options that are its remedy.
    pub(crate) fn of(error: impl Into<Error>) -> Self {
        let error = error.into();
        Self::bad(match &error {
            Error::Prepare(reason) => match &**reason {
                PrepareError::Contradiction(what) => format!("{what}\n--force-input uses the capture as it is"),
                PrepareError::Memory(MemoryError::Allowed { .. }) => format!("--memory: {error}"),
                PrepareError::Input(InputError::OneState { .. }) => {
                    format!("{error}: artgs reconstruct CLOSED OPEN -o OUT")
                }
                PrepareError::Input(InputError::Twice(_)) => {
                    format!(
                        "{error}, or test with different frames of this one, in which nothing moved: --every 2 --offset 0,1"
                    )
                }
                PrepareError::Input(InputError::CaptureForTruth(folder)) => {
                    let shown = folder.display();
                    format!("{shown}: a capture; give the folder of its ground truth: --gt {shown}/gt")
                }
                _ => return Self::bad_input(error),
            },
            Error::Output(OutputError::IsFile(_) | OutputError::Foreign(_)) => format!("{error} to -o"),
            Error::Output(OutputError::Earlier(folder)) => {
                let shown = folder.display();
                format!("{shown} holds an earlier run; add --resume to continue it, or --force to discard it")
            }
            Error::Output(OutputError::Photos { photos, stages }) => {
                let (photos, stages) = (photos.display(), stages.display());
                format!("{photos} is inside {stages}, which --force removes; give another folder to -o")
            }
            Error::Fit(FitError::Device(_)) => {
                return Self::Failed(anyhow::anyhow!("{error}; with --device auto training would continue on the CPU"));
            }
            _ if error.is_bad_input() => return Self::bad_input(error),
            _ => return Self::failed(error),
        })
    }

    /// The same as something that the caller must change.
    pub(crate) fn into_bad_input(self) -> Self {
        match self {
            Self::Failed(error) => Self::BadInput(error),
            other => other,
        }
    }

    /// 2 for bad input, 3 for a failed check, 75 where a retry makes sense, 130 for an interruption, else 1.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::BadInput(_) => 2,
            Self::Failed(_) => 1,
            Self::ChecksFailed(_) => 3,
            Self::Retry(_) => 75,
            Self::Interrupted(_) => 130,
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
        let error = match self {
            Self::ChecksFailed(what) => return f.write_str(&printable(what)),
            Self::BadInput(error) | Self::Failed(error) | Self::Retry(error) | Self::Interrupted(error) => error,
        };
        // Most errors name their cause themselves; only causes that they do not name follow.
        let mut said = String::new();
        for cause in error.chain().map(ToString::to_string).filter(|cause| !cause.is_empty()) {
            if !said.contains(&cause) {
                said += if said.is_empty() { "" } else { ": " };
                said += &cause;
            }
        }
        f.write_str(&printable(&said))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;

    #[test]
    fn names_do_not_command_the_terminal() {
        let failure = Failure::bad("a\u{1b}[2J\u{7}\u{9b}b\u{202e}c: no such file\nsecond line");
        assert_eq!(failure.to_string(), "a\\u001b[2J\\u0007\\u009bb\\u202ec: no such file\nsecond line");
    }

    #[test]
    fn causes_are_named_once() {
        let inner = std::io::Error::other("no room");
        let failure = Failure::from(anyhow::Error::new(inner).context("a.json: cannot be written: no room"));
        assert_eq!(failure.to_string(), "a.json: cannot be written: no room");
        let plain: Result<(), std::io::Error> = Err(std::io::Error::other("no room"));
        let failure = Failure::from(plain.context("cannot make b").unwrap_err());
        assert_eq!(failure.to_string(), "cannot make b: no room");
    }
}
