//! What can go wrong on the way to a page.

use artgs_io::FileError;
use std::path::PathBuf;

/// A page that cannot be put together, served or written.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// A file cannot be read, written or understood.
    #[error(transparent)]
    File(#[from] FileError),
    /// `replica.json` cannot be used.
    #[error(transparent)]
    Replica(#[from] artgs_io::replica::ReplicaFileError),
    /// The replica was not exported in the formats that the page shows.
    #[error("{}: there is no {missing}; run `artgs export {} --to urdf,splats` first", out.display(), out.display())]
    NotExported {
        /// The replica folder.
        out: PathBuf,
        /// What was looked for, relative to the folder.
        missing: &'static str,
    },
    /// The port is taken, or loopback refused.
    #[error("cannot listen on 127.0.0.1:{port}: {reason}; choose another with --port")]
    Listen {
        /// The port asked for.
        port: u16,
        /// Why.
        reason: String,
    },
}
