//! Settings and results of a run: `run.json`.

use artgs::evaluate::Scores;
use artgs_core::{Capture, PerState};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// All settings that affect the result of a run. A run with equal settings is reused.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunSettings {
    /// Version of the program.
    pub version: String,
    /// Preset to start from.
    pub preset: String,
    /// Settings in TOML that replace those of the preset.
    pub overlay: String,
    /// Further arguments of `artgs reconstruct`.
    pub arguments: Vec<String>,
    /// Where the capture comes from: a folder, or the render settings of a procedural object.
    pub source: String,
    /// Number of parts given, the static part included; none if it is to be found.
    pub parts: Option<usize>,
    /// Seed.
    pub seed: u64,
    /// Threads of the run; none for all cores.
    pub threads: Option<usize>,
    /// Requested device; none for the best available one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
}

impl RunSettings {
    /// Names of the fields that differ.
    pub fn differences(&self, other: &Self) -> Vec<&'static str> {
        let fields = [
            ("version", self.version != other.version),
            ("preset", self.preset != other.preset),
            ("settings of the variant", self.overlay != other.overlay),
            ("arguments", self.arguments != other.arguments),
            ("capture", self.source != other.source),
            ("parts", self.parts != other.parts),
            ("seed", self.seed != other.seed),
            ("threads", self.threads != other.threads),
            ("device", self.device != other.device),
        ];
        fields.into_iter().filter(|f| f.1).map(|f| f.0).collect()
    }
}

/// Properties of a capture, for plots.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Facts {
    /// Training views per state, the smaller number.
    pub views: usize,
    /// Largest width of an image, pixels.
    pub size: usize,
    /// What degrades the capture, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<String>,
}

impl Facts {
    /// Counts and measures.
    pub fn of(capture: &Capture, noise: Option<String>) -> Self {
        let views = capture.states.iter().map(|s| s.train.len()).min().unwrap_or_default();
        let size = capture.states.iter().flat_map(|s| &s.train).map(|v| v.size().0).max().unwrap_or_default();
        Self { views, size, noise }
    }
}

/// Held-out pictures of a state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PictureScores {
    /// Peak signal-to-noise ratio, dB.
    pub psnr: f64,
    /// Structural similarity.
    pub ssim: f64,
    /// FLIP.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flip: Option<f64>,
    /// LPIPS.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lpips: Option<f64>,
}

/// The part of a run's `metrics.json` that is tabulated.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RunMetrics {
    /// Parts found, the static one included.
    pub parts: usize,
    /// Gaussians.
    pub gaussians: usize,
    /// Held-out pictures of start and end.
    #[serde(with = "artgs_core::state::array")]
    pub test: PerState<Option<PictureScores>>,
    /// Wall-clock seconds of each stage.
    pub seconds: Vec<(String, f64)>,
    /// Wall-clock seconds of the reconstruction.
    pub total_seconds: f64,
    /// Device that finished the training.
    #[serde(default)]
    pub device: Option<String>,
    /// Largest resident memory, MiB.
    pub peak_memory_mib: Option<f64>,
    /// Warnings of the run.
    pub warnings: Vec<String>,
}

/// All numbers of a finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Metrics that the run wrote.
    pub metrics: RunMetrics,
    /// Scores against the ground truth.
    pub scores: Scores,
}

impl Measured {
    /// Mean over the states that have the number.
    pub(crate) fn picture_mean(&self, pick: impl Fn(&PictureScores) -> Option<f64>) -> Option<f64> {
        let values: Vec<f64> = self.metrics.test.iter().flatten().filter_map(pick).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    }
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(clippy::large_enum_variant, reason = "few of them, and the large one is the usual one")]
pub enum Outcome {
    /// The replica was scored.
    Done(Measured),
    /// There is no scored replica; the reason.
    Failed(String),
}

/// One run: `run.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Name of the variant.
    pub variant: String,
    /// Name of the object.
    pub object: String,
    /// Seed.
    pub seed: u64,
    /// Settings of the run.
    pub settings: RunSettings,
    /// Properties of its capture.
    pub facts: Facts,
    /// Result.
    pub outcome: Outcome,
    /// Folder of the run, relative to the folder of the bench.
    pub folder: PathBuf,
}

impl Record {
    /// The numbers, if it has any.
    pub fn measured(&self) -> Option<&Measured> {
        match &self.outcome {
            Outcome::Done(measured) => Some(measured),
            Outcome::Failed(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::State;

    #[test]
    fn metrics_are_read_with_and_without_optional_scores() {
        let text = r#"{"parts": 3, "gaussians": 9, "test": [{"psnr": 30.0, "ssim": 0.9, "views": 4}, null],
            "train": [null, null], "seconds": [["discover", 1.5]], "total_seconds": 2.0, "peak_memory_mib": null}"#;
        let metrics: RunMetrics = serde_json::from_str(text).unwrap();
        assert_eq!(metrics.test[State::START].unwrap().flip, None);
        assert_eq!((metrics.parts, metrics.seconds[0].1, metrics.test[State::END]), (3, 1.5, None));
        let more = text.replace("\"views\": 4", "\"flip\": 0.05, \"lpips\": 0.1");
        let metrics: RunMetrics = serde_json::from_str(&more).unwrap();
        assert_eq!(metrics.test[State::START].unwrap().lpips, Some(0.1));
    }
}
