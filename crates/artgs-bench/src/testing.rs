//! Records and folders for tests.

use crate::collect::{Collected, ObjectInfo, VariantInfo};
use crate::record::{Facts, Measured, Outcome, PictureScores, Record, RunMetrics, RunSettings};
use artgs::evaluate::{Counts, GeometryScore, JointMeans, MeshScore, Scores};
use artgs_core::PerState;
use serde_json::json;
use std::path::Path;

fn surface(chamfer: f64) -> MeshScore {
    let score = GeometryScore { chamfer, floor: 0.1, dense_chamfer: chamfer, dense_floor: 0.01, f_score: 0.9 };
    MeshScore { start: score, end: score, mean: score }
}

/// A run of a hinge whose errors are all `error`.
pub(crate) fn measured(error: f64) -> Measured {
    let picture = |psnr| Some(PictureScores { psnr, ssim: 0.98, flip: None, lpips: None });
    let joints = JointMeans {
        axis_angle_deg: Some(error),
        axis_position_x10: Some(error),
        motion_deg: Some(error),
        motion_length: None,
        paper_axis_position_x10: Some(error),
        paper_motion: Some(error),
    };
    Measured {
        metrics: RunMetrics {
            parts: 2,
            gaussians: 1000,
            test: PerState::new(picture(30.0), picture(32.0)),
            total_seconds: 90.0,
            device: Some("CPU (AVX2, 4 threads)".into()),
            peak_memory_mib: Some(512.0),
            ..RunMetrics::default()
        },
        scores: Scores {
            pictures: None,
            parts: Vec::new(),
            whole: surface(error),
            fixed: surface(error),
            movable: surface(error),
            joints,
            counts: Counts { truths: 1, predicted: 1, found: 1, ..Counts::default() },
        },
    }
}

pub(crate) fn record(variant: &str, object: &str, seed: u64, error: f64) -> Record {
    Record {
        variant: variant.into(),
        object: object.into(),
        seed,
        settings: RunSettings {
            version: "0".into(),
            preset: "default".into(),
            overlay: String::new(),
            arguments: Vec::new(),
            source: object.into(),
            parts: Some(2),
            seed,
            threads: None,
            device: None,
        },
        facts: Facts { views: 40, size: 200, noise: None },
        outcome: Outcome::Done(measured(error)),
        folder: Path::new("runs").join(variant).join(object).join(format!("seed_{seed}")),
    }
}

pub(crate) fn failed(variant: &str, object: &str, seed: u64, reason: &str) -> Record {
    Record { outcome: Outcome::Failed(reason.into()), ..record(variant, object, seed, 0.0) }
}

/// Records of objects with two, three, ... parts that are not in the paper.
pub(crate) fn collected(variants: &[&str], objects: &[&str], records: Vec<Record>) -> Collected {
    let variant = |name: &&str| VariantInfo { name: (*name).into(), description: format!("variant {name}") };
    let object = |(i, name): (usize, &&str)| ObjectInfo {
        name: (*name).into(),
        parts: Some(i + 2),
        stands_for: None,
        same_object: false,
    };
    Collected {
        variants: variants.iter().map(variant).collect(),
        objects: objects.iter().enumerate().map(object).collect(),
        records,
    }
}

/// A `gt/trans.json` with that many hinges.
pub(crate) fn write_truth(gt: &Path, joints: usize) {
    let joint = json!({ "axis": { "o": [0, 0, 0], "d": [0, 0, 1] }, "type": "rotate", "rotate": { "l": 0, "r": 30 } });
    let text = json!({ "trans_info": vec![joint; joints] }).to_string();
    artgs_io::write_atomic(&gt.join("trans.json"), text.as_bytes()).unwrap();
}
