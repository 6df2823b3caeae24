//! A replica on disk against what is known of its object: the ground truth, held-out photos, or both.

use super::{Error, evaluate};
use crate::evaluate::{Lpips, PictureReport, Scores, score_replica};
use crate::prepare::{InputError, load_capture};
use artgs_core::Capture;
use artgs_io::{CaptureOptions, RunFolder};
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// What a replica is compared with.
#[derive(Clone, Copy, Debug, Default)]
pub struct Comparison<'a> {
    /// Folder of the ground truth.
    pub ground_truth: Option<&'a Path>,
    /// Folder of a capture with held-out views.
    pub capture: Option<&'a Path>,
    /// Weights for the perceptual distance; none: it is not computed.
    pub lpips: Option<&'a Lpips>,
}

/// Scores of a replica; as text and as JSON.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum Compared {
    /// Against the ground truth, and against photos if they were named.
    Truth(Box<Scores>),
    /// Against photos alone.
    Photos(PictureReport),
}

impl fmt::Display for Compared {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Truth(scores) => scores.fmt(f),
            Self::Photos(report) => report.fmt(f),
        }
    }
}

/// Scores the replica in a folder; `remark` gets what is unexpected. Every error is one of files that the caller named.
pub fn compare(folder: &RunFolder, with: &Comparison<'_>, remark: &mut dyn FnMut(&str)) -> Result<Compared, Error> {
    for named in std::iter::once(folder.root()).chain(with.ground_truth) {
        require_folder(named)?;
    }
    if let Some(truth) = with.ground_truth.filter(|gt| is_file_in(gt, "gt/trans.json") && !is_file_in(gt, "trans.json"))
    {
        return Err(InputError::CaptureForTruth(truth.into()).into());
    }
    folder.require_replica()?;
    let pictures = match with.capture {
        None => None,
        Some(photos) => {
            let capture = load_capture(photos, &CaptureOptions::default())?;
            if let Some(reason) = no_pictures(folder, &capture) {
                remark(&format!("images are not scored: {reason}"));
            }
            Some(score_replica(folder, &capture, with.lpips)?)
        }
    };
    Ok(match with.ground_truth {
        None => Compared::Photos(PictureReport { pictures: pictures.unwrap_or_default() }),
        Some(truth) => Compared::Truth(Box::new(Scores { pictures, ..evaluate(folder, truth)? })),
    })
}

fn is_file_in(folder: &Path, name: &str) -> bool {
    folder.join(name).exists()
}

fn require_folder(path: &Path) -> Result<(), InputError> {
    match (path.is_dir(), path.exists()) {
        (true, _) => Ok(()),
        (_, true) => Err(InputError::IsFile(path.into())),
        _ => Err(InputError::NoFolder(path.into())),
    }
}

/// Why a replica cannot be compared with the held-out views of a capture.
fn no_pictures(folder: &RunFolder, capture: &Capture) -> Option<String> {
    if !folder.has_splats() {
        return Some(format!("{} has no Gaussians, splats/canonical.ply is missing", folder.root().display()));
    }
    capture.states.iter().all(|s| s.test.is_empty()).then(|| "the capture has no held-out views".into())
}
