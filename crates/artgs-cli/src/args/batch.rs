//! Arguments of batches.

use super::FormatArg;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct Batch {
    /// CSV with a header, or JSON with one object per line (.jsonl): `id`, `start` (a capture, or the first recording), `end`
    /// (the second recording), and options of reconstruct. Relative paths start at its folder
    pub(crate) manifest: PathBuf,
    /// Folder for replicas, logs, and a row per capture; if absent, the number of captures is printed
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Number of the capture, from 0; all of them one after another if absent, and then the table results.jsonl
    #[arg(long, value_name = "N", requires = "out")]
    pub(crate) index: Option<usize>,
    /// Export the replicas: formats, separated by commas
    #[arg(long, value_name = "LIST", value_enum, value_delimiter = ',')]
    pub(crate) to: Vec<FormatArg>,
    /// Run captures again that failed for a reason that remains
    #[arg(long)]
    pub(crate) retry_failed: bool,
    /// Write rows as JSON, one per line
    #[arg(long)]
    pub(super) json: bool,
}
