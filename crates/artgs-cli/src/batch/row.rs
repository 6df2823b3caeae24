//! The result of a capture: one row of the table of a batch.

use artgs::Summary;
use artgs_core::Replica;
use artgs_io::RunFolder;
use artgs_io::run_folder::{load_json, save_json};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What became of a capture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Row {
    /// Name in the manifest.
    pub(super) id: String,
    /// `done` or `failed`.
    pub(super) status: String,
    /// Why it failed; empty if it did not.
    pub(super) reason: String,
    /// True if the same command may succeed later.
    pub(super) retry: bool,
    /// Exit code of the run; none if a signal ended it.
    pub(super) exit_code: Option<i32>,
    /// Version of the program.
    pub(super) program: String,
    /// Hash of the capture and its options.
    pub(super) content: String,
    /// Runs of this content, this one included.
    pub(super) attempts: u32,
    /// Begin of the run, seconds since 1970.
    pub(super) started: u64,
    /// Wall-clock time of the run, exports included.
    pub(super) seconds: f64,
    /// Time of all processors together, exports included; none where the system does not report it.
    pub(super) cpu_seconds: Option<f64>,
    /// Folder of the replica, relative to the folder of the batch; none if there is no replica.
    pub(super) replica: Option<String>,
    /// Number of parts, the static one included.
    pub(super) parts: Option<usize>,
    /// Joint types in the order of the parts, separated by blanks.
    pub(super) joints: Option<String>,
    /// Least confidence of a joint; none if there is none.
    pub(super) confidence: Option<f64>,
    /// Mean PSNR of held-out images, dB; none without any.
    pub(super) psnr: Option<f64>,
    /// Largest resident memory, MiB.
    pub(super) peak_memory_mib: Option<f64>,
    /// Number of warnings of the run.
    pub(super) warnings: Option<usize>,
}

impl Row {
    /// Where the row of a capture is.
    pub(super) fn path(out: &Path, id: &str) -> PathBuf {
        out.join("rows").join(format!("{id}.json"))
    }

    /// The row of an earlier run; one that cannot be read counts as none.
    pub(super) fn load(out: &Path, id: &str) -> Option<Self> {
        load_json(&Self::path(out, id)).ok().flatten()
    }

    /// Replaces the row as a whole.
    pub(super) fn save(&self, out: &Path) -> Result<(), artgs_io::FileError> {
        save_json(&Self::path(out, &self.id), self)
    }

    pub(super) fn is_done(&self) -> bool {
        self.status == "done"
    }

    /// Adds what a finished run has written.
    pub(super) fn add_results(&mut self, run: &RunFolder) -> Result<(), String> {
        let replica: Replica = artgs_io::read_replica(run.root()).map_err(|e| e.to_string())?;
        let summary: Summary = load_json(&run.metrics()).map_err(|e| e.to_string())?.unwrap_or_default();
        let movable = || replica.parts.iter().skip(1);
        let kinds: Vec<&str> = (1..replica.parts.len()).filter_map(|k| Some(replica.joint(k)?.kind.name())).collect();
        self.parts = Some(replica.parts.len());
        self.joints = Some(kinds.join(" "));
        self.confidence = movable().filter_map(|part| part.confidence).min_by(f64::total_cmp);
        let psnr: Vec<f64> = summary.test.iter().flatten().map(|mean| mean.psnr).collect();
        self.psnr = (!psnr.is_empty()).then(|| psnr.iter().sum::<f64>() / psnr.len() as f64);
        self.peak_memory_mib = summary.peak_memory_mib;
        self.warnings = Some(summary.warnings.len());
        Ok(())
    }
}
