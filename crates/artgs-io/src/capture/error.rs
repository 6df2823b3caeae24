//! Errors of captures.

use std::path::PathBuf;

/// Why a capture cannot be used; messages name the file, the frame, the key and a remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// A file of the capture cannot be read.
    #[error(transparent)]
    File(#[from] crate::FileError),
    /// There is no such folder.
    #[error("{}: no such directory; give the folder of the capture", dir.display())]
    DirectoryMissing {
        /// The given path.
        dir: PathBuf,
    },
    /// It is a file.
    #[error("{}: is a file{found}", path.display())]
    NotADirectory {
        /// The given path.
        path: PathBuf,
        /// What it is after a comma, if that is known, and a remedy.
        found: String,
    },
    /// Images alone.
    #[error("{}: {}", dir.display(), super::NO_POSES)]
    NoPoses {
        /// The given path.
        dir: PathBuf,
    },
    /// The folder contains none of the known camera files.
    #[error("{}: not a capture and not a recording{}", dir.display(), what_is_read(found, recordings, looked_for))]
    NoLayout {
        /// The folder.
        dir: PathBuf,
        /// What it is, with a remedy, after a colon; empty if nothing is known.
        found: String,
        /// Every format of recordings with the files that it is recognised by.
        recordings: String,
        /// Camera files of every known layout.
        looked_for: String,
    },
    /// Cameras of one state only.
    #[error(
        "{}: contains one state only: {} exists, {} does not; two states are needed, capture the other one",
        dir.display(), found.display(), missing.display()
    )]
    OneState {
        /// The folder.
        dir: PathBuf,
        /// The existing camera file.
        found: PathBuf,
        /// The missing camera file.
        missing: PathBuf,
    },
    /// A camera file cannot be read.
    #[error("{}: cannot be read: {source}", file.display())]
    Unreadable {
        /// The camera file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A camera file is not JSON.
    #[error("{}: not valid JSON at line {line}, column {column}: {reason}; correct or re-export the file", file.display())]
    Json {
        /// The camera file.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// Message of the parser.
        reason: String,
    },
    /// A key is missing or its value is invalid.
    #[error("{place}: key `{key}`: {reason}")]
    Key {
        /// Camera file and frame.
        place: String,
        /// The key.
        key: String,
        /// What is wrong, and the remedy.
        reason: String,
    },
    /// An image is missing, unreadable or of the wrong size.
    #[error("{place}: {reason}")]
    Image {
        /// Camera file and frame.
        place: String,
        /// The image, what is wrong, and the remedy.
        reason: String,
    },
    /// No frame of a state shows the object.
    #[error(
        "{}: the mask (alpha) is empty in every frame: {frames}; alpha must be 255 on the object and 0 elsewhere",
        file.display()
    )]
    EmptyMasks {
        /// The camera file.
        file: PathBuf,
        /// Names of the frames.
        frames: String,
    },
    /// Every pixel counts as background.
    #[error(
        "{}: the mask (alpha) is at most {largest} in every frame; alpha must be 255 on the object and 0 elsewhere, \
         multiply masks of 0 and 1 by 255",
        file.display()
    )]
    FaintMasks {
        /// The camera file.
        file: PathBuf,
        /// Largest alpha of all frames.
        largest: u8,
    },
    /// Depth images without any depth.
    #[error(
        "{}: depth is zero on the object in every frame, first {frame}; check that the mask (alpha) is 255 on the \
         object and not inverted, and that depth images and colour images belong together, or remove the depth images",
        file.display()
    )]
    NoDepth {
        /// The camera file.
        file: PathBuf,
        /// The first frame with a depth image.
        frame: String,
    },
    /// Too few training views.
    #[error("{}: key `frames`: {usable} usable training views, at least 2 are needed; capture more", file.display())]
    TooFewViews {
        /// The camera file.
        file: PathBuf,
        /// Number of usable views.
        usable: usize,
    },
    /// The objects of the two states are in different places.
    #[error("no overlap between the states: {0}; both states must be posed in one world frame, align them first")]
    NoOverlap(String),
}

/// What a folder is, or all that would have been read.
fn what_is_read(found: &str, recordings: &str, looked_for: &str) -> String {
    match found {
        "" => format!(
            ". A capture of both states (ArtGS, PARIS) contains one of {looked_for}; recordings of one state are {recordings}"
        ),
        known => known.into(),
    }
}
