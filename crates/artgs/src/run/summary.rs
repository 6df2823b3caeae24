//! Scores, times and warnings of a run: `metrics.json`.

use artgs_core::State;
use serde::{Deserialize, Serialize};
use std::fmt;

/// What a run achieved; also `metrics.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Parts found, the static one included.
    pub parts: usize,
    /// Gaussians.
    pub gaussians: usize,
    /// Held-out images of start and end, over black; none without test views.
    pub test: [Option<ViewMeans>; 2],
    /// Training images of start and end.
    pub train: [Option<ViewMeans>; 2],
    /// Wall-clock seconds of each stage, in order. For a stage whose result was loaded they are those of the run that
    /// computed it.
    pub seconds: Vec<(String, f64)>,
    /// Wall-clock seconds of this run alone, with its preparation.
    pub total_seconds: f64,
    /// What trained, at last; none if nothing had to be trained.
    pub device: Option<String>,
    /// Largest resident memory of the process, MiB, where the system reports it.
    pub peak_memory_mib: Option<f64>,
    /// What was unexpected, one sentence each.
    pub warnings: Vec<String>,
}

/// Means over the views of a state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViewMeans {
    /// Peak signal-to-noise ratio, dB.
    pub psnr: f64,
    /// Structural similarity.
    pub ssim: f64,
    /// Number of views.
    pub views: usize,
}

/// Without the warnings, which the observer of the run received.
impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = if self.parts == 1 { "part" } else { "parts" };
        writeln!(f, "{} {parts}, {} Gaussians, {:.1} s", self.parts, self.gaussians, self.total_seconds)?;
        for (kind, means) in [("test", &self.test), ("train", &self.train)] {
            for (state, mean) in State::ALL.into_iter().zip(means) {
                if let Some(m) = mean {
                    let state = state.name();
                    writeln!(f, "{kind:5} {state:5} PSNR {:.2} dB  SSIM {:.4}  ({} views)", m.psnr, m.ssim, m.views)?;
                }
            }
        }
        Ok(())
    }
}
