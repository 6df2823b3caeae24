//! Fitting Gaussians to photographs: losses, optimiser, densification, initialisation and the training loop.
//!
//! Data flow: `images` and `region` prepare the views, `init` places Gaussians, a `backend` that `devices` made steps them
//! (`deform`, `loss`, `ssim`, `adam`), `densify` changes their number, `single` is the loop around, `score` the test.

pub(crate) mod adam;
pub(crate) mod backend;
mod choice;
pub(crate) mod cpu;
pub(crate) mod deform;
pub(crate) mod densify;
pub(crate) mod devices;
pub(crate) mod fallback;
pub(crate) mod follow;
pub(crate) mod images;
pub(crate) mod init;
pub(crate) mod loss;
pub(crate) mod region;
pub(crate) mod schedule;
pub(crate) mod score;
pub(crate) mod single;
pub(crate) mod ssim;
pub(crate) mod train;
pub(crate) mod views;

pub use crate::published::ChamferTargets;
pub use adam::{AdamConfig, Moments, SplatAdam, SplatRates};
pub use backend::{Backend, Deformation, PlateauConfig, RateConfig, StepStats, TrainConfig, TrainState};
pub use choice::{Chosen, DeviceChoice};
pub use cpu::CpuBackend;
pub use deform::{Articulated, DeformConfig, JointState, Membership};
pub use densify::{DensifyConfig, DensifyReport, DensifyStats};
pub use devices::{Cpu, Devices};
pub use fallback::WithFallback;
pub use follow::Follow;
pub use images::{DepthPick, Rect, TrainImage};
pub use init::{DepthInit, RandomInit};
pub use loss::{DepthMode, ImageLoss, LossConfig, LossTerms};
pub use region::Region;
pub use schedule::LogLinear;
pub use score::{ViewScore, depth_error, mean_score, psnr, psnr_of_mse, render_view, score_splats, score_views};
pub use single::{InitKind, SingleConfig, fit_single};
pub use train::{RunPlan, train};
pub use views::{ViewPlan, ViewSampler};

/// A reason why Gaussians cannot be fitted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// Nothing to learn from.
    #[error("there are no training views")]
    NoViews,
    /// A start from depth was asked for, but no pixel inside the masks has a depth.
    #[error("no training view has a depth inside its mask")]
    NoDepth,
    /// No Gaussian to begin with, or none left.
    #[error("there are no Gaussians to fit")]
    Empty,
    /// The nearest-neighbour search refused the points.
    #[error("nearest neighbours of the initial points: {0}")]
    Neighbours(String),
    /// Parts, labels and joints to begin with do not fit together.
    #[error("articulated start: {0}")]
    Start(String),
    /// There is no canonical start.
    #[error("canonical start: {0}")]
    Canonical(#[from] crate::published::canonical::CanonicalError),
    /// The device that trains failed.
    #[error("training device: {0}")]
    Device(String),
}
