//! Errors of pages and servers.

use artgs_io::FileError;
use std::path::PathBuf;

/// A page that cannot be built, served or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// A file cannot be read, written or parsed.
    #[error(transparent)]
    File(#[from] FileError),
    /// `replica.json` cannot be used.
    #[error(transparent)]
    Replica(#[from] artgs_io::replica::ReplicaFileError),
    /// The data of the page cannot be written as JSON.
    #[error("scene.json cannot be written: {0}")]
    Scene(serde_json::Error),
    /// The replica was not exported in the formats that the page needs.
    #[error("{}: {missing} is missing; run `artgs export {} --to urdf,splats` first", out.display(), out.display())]
    NotExported {
        /// The replica folder.
        out: PathBuf,
        /// The missing files, relative to the folder.
        missing: &'static str,
    },
    /// The port is in use, or loopback cannot be opened.
    #[error("cannot listen on 127.0.0.1:{port}: {reason}; choose another with --port")]
    Listen {
        /// The requested port.
        port: u16,
        /// Why.
        reason: String,
    },
}
