//! A whole run: stages in order, each saved in the output folder so that a later run can go on from there.

pub mod assemble;
mod folder;
mod following;
mod learnt;
mod lettering;
pub mod points;
pub mod preview;
pub mod rendered;
mod stages;

use crate::articulation::Trained;
use crate::config::{Config, ConfigError, Method};
use crate::discover::{DiscoverError, Discovery};
use crate::evaluate::{EvaluateConfig, Scores, Truth};
use crate::fit::{Devices, FitError};
use crate::observer::Observer;
use crate::registration::RegistrationError;
use crate::surface::{PartMeshes, SurfaceError};
use artgs_core::{Capture, JointEstimate, STATE_NAMES};
use artgs_io::{Corrections, FileError};
use serde::Serialize;
use stages::Run;
pub use stages::made_from;
use std::fmt;
use std::path::Path;

/// Why a run stopped.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The number of parts was not given.
    #[error(
        "the number of parts is not known: give --parts K (or `parts` in the configuration), counting the static part; \
         a cabinet with two drawers has K = 3"
    )]
    PartsMissing,
    /// The output folder was made with other settings.
    #[error(
        "{0} was made with other settings; give the same ones to resume, or start afresh with --force or in another folder"
    )]
    OtherSettings(String),
    /// The output folder was made from other pictures.
    #[error("{0} was made from another capture; resume with that one, start afresh in another folder, or add --force")]
    OtherCapture(String),
    /// There is nothing to look at before training.
    #[error("with these settings parts are learnt in training: there are none to stop at before it")]
    PartsLearnt,
    /// Settings that cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Parts could not be found.
    #[error(transparent)]
    Discover(#[from] DiscoverError),
    /// `corrections.json` cannot be read.
    #[error("{0}; mend the file or remove it")]
    Corrections(FileError),
    /// `corrections.json` cannot be honoured.
    #[error(transparent)]
    Correct(#[from] crate::discover::CorrectError),
    /// The baseline could not find parts.
    #[error(transparent)]
    Registration(#[from] RegistrationError),
    /// Training failed.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// Meshing failed.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// A file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A replica could not be read or written.
    #[error(transparent)]
    Replica(#[from] artgs_io::replica::ReplicaFileError),
}

impl Error {
    /// True if the user has to change the capture, the settings or the command.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::PartsMissing
            | Self::PartsLearnt
            | Self::OtherSettings(_)
            | Self::OtherCapture(_)
            | Self::Config(_)
            | Self::Discover(_)
            | Self::Corrections(_)
            | Self::Correct(_)
            | Self::Registration(_)
            | Self::Replica(_) => true,
            Self::Fit(_) | Self::Surface(_) | Self::File(_) => false,
        }
    }
}

/// What a run achieved; also `metrics.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Parts found, the static one included.
    pub parts: usize,
    /// Gaussians.
    pub gaussians: usize,
    /// Held-out pictures of start and end, over black; none without test views.
    pub test: [Option<ViewMeans>; 2],
    /// Training pictures of start and end.
    pub train: [Option<ViewMeans>; 2],
    /// Wall-clock seconds of each stage, in order; stages taken from an earlier run are left out.
    pub seconds: Vec<(String, f64)>,
    /// Wall-clock seconds of this run.
    pub total_seconds: f64,
    /// What trained, at last; none if nothing had to be trained.
    pub device: Option<String>,
    /// Largest resident memory of the process, MiB, where the system tells.
    pub peak_memory_mib: Option<f64>,
    /// What was odd, one sentence each.
    pub warnings: Vec<String>,
}

/// Means over the views of a state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ViewMeans {
    /// Peak signal-to-noise ratio, dB.
    pub psnr: f64,
    /// Structural similarity.
    pub ssim: f64,
    /// Number of views.
    pub views: usize,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} parts, {} Gaussians, {:.1} s", self.parts, self.gaussians, self.total_seconds)?;
        for (kind, means) in [("test", &self.test), ("train", &self.train)] {
            for (state, mean) in STATE_NAMES.iter().zip(means) {
                if let Some(m) = mean {
                    writeln!(f, "{kind:5} {state:5} PSNR {:.2} dB  SSIM {:.4}  ({} views)", m.psnr, m.ssim, m.views)?;
                }
            }
        }
        for warning in &self.warnings {
            writeln!(f, "warning: {warning}")?;
        }
        Ok(())
    }
}

/// Object with what the surfaces are made from.
pub(crate) struct Built {
    /// Canonical Gaussians, labels and motions; none from the baseline.
    pub(crate) trained: Option<Trained>,
    /// Movable parts: kinds and motions from start to end.
    pub(crate) parts: Vec<JointEstimate>,
}

/// Makes a replica of a capture in the folder `out`. With `resume` stages that an earlier run saved there are taken
/// over, whatever device they were trained on. The same seed on the same machine gives the same files, as far as its
/// devices do.
pub fn reconstruct(
    capture: &Capture,
    out: &Path,
    config: &Config,
    resume: bool,
    devices: &dyn Devices,
    observer: &mut dyn Observer,
) -> Result<Summary, Error> {
    config.check()?;
    let parts = config.parts.ok_or(Error::PartsMissing)?;
    let mut run = Run::open(capture, out, config, resume, devices, observer)?;
    let (built, meshes) = match config.method {
        Method::Discover => {
            let depths = run.depths()?;
            let found = run.discover(&depths, parts)?;
            let found = run.corrected(&depths, found)?;
            let (built, found) = run.articulate(found, parts)?;
            let meshes = run.surface(&depths, &found, &built)?;
            (built, meshes)
        }
        Method::Registration => {
            let depths = run.captured_depths()?;
            let found = run.register(&depths, parts)?;
            let found = run.corrected(&depths, found)?;
            let built = Built { trained: None, parts: found.parts.clone() };
            let meshes = run.surface(&depths, &found, &built)?;
            (built, meshes)
        }
        Method::Paper => {
            run.leave_corrections();
            let single = run.single()?;
            let built = run.published(&single, parts)?;
            let meshes = run.rendered_surface(&built)?;
            (built, meshes)
        }
    };
    run.assemble(&built, &meshes)
}

/// The first stages alone: parts, joints and labelled surface points, saved in the folder `out` for [`found`] and for a
/// [`reconstruct`] that resumes. Corrections are honoured there, not here.
pub fn find_parts(
    capture: &Capture,
    out: &Path,
    config: &Config,
    resume: bool,
    devices: &dyn Devices,
    observer: &mut dyn Observer,
) -> Result<Discovery, Error> {
    config.check()?;
    let parts = config.parts.ok_or(Error::PartsMissing)?;
    if !finds_parts(config) {
        return Err(Error::PartsLearnt);
    }
    let mut run = Run::open(capture, out, config, resume, devices, observer)?;
    if config.method == Method::Registration {
        let depths = run.captured_depths()?;
        return run.register(&depths, parts);
    }
    let depths = run.depths()?;
    run.discover(&depths, parts)
}

/// True if parts are found before any training, so that they can be corrected.
pub fn finds_parts(config: &Config) -> bool {
    config.method != Method::Paper && config.start.parts == points::PartSource::Labels
}

/// What [`find_parts`], or a whole run, found in the folder `out`; none if it does not hold that.
pub fn found(out: &Path) -> Option<Discovery> {
    folder::Folder::new(out).load_discovery()
}

/// The corrections that the replica in the folder `out` was made with, and how many movable parts were found before
/// them; none if there were no corrections.
pub fn corrections_of(out: &Path) -> Option<(Corrections, usize)> {
    let text = std::fs::read(out.join(stages::ASSEMBLED)).ok()?;
    Some((Corrections::parse(&text).ok()?, found(out)?.parts.len()))
}

fn truth_of(read: artgs_io::GroundTruth) -> Truth {
    let artgs_io::GroundTruth { joints, parents, whole, fixed, movable } = read;
    let movable = movable.into_iter().map(Into::into).collect();
    Truth { joints, parents, whole: whole.into(), fixed: fixed.into(), movable }
}

/// Scores the replica in the folder `out` against the ground truth in the folder `gt`.
pub fn evaluate(out: &Path, gt: &Path) -> Result<Scores, Error> {
    let replica = artgs_io::read_replica(out)?;
    let mesh = |path: &str| artgs_io::read_mesh_ply(&out.join(path));
    let mut parts = Vec::new();
    for part in &replica.parts {
        parts.push([mesh(part.meshes.get(0))?, mesh(part.meshes.get(1))?]);
    }
    let whole = [mesh(replica.whole.get(0))?, mesh(replica.whole.get(1))?];
    let truth = truth_of(artgs_io::load_ground_truth(gt)?);
    let meshes = PartMeshes { parts, whole };
    Ok(crate::evaluate::evaluate(&replica, &meshes, &truth, &EvaluateConfig::default()))
}
