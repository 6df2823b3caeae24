//! The published method: what only `--preset paper`, its ablations and the baseline of registration need.
//!
//! Data flow: Gaussians of each state go through [`canonical`] to canonical Gaussians and part centres; [`types`] trains free motions
//! to find the kinds of joints; the joint optimisation of [`crate::articulation`] trains Gaussians, motions and an [`assignment`] to
//! parts, also by a [`chamfer`] term. [`pipeline`] runs these stages, [`trace`] keeps what they decided, [`decisions`] says it in sentences.

pub(crate) mod assignment;
pub(crate) mod canonical;
mod chamfer;
mod decisions;
mod pipeline;
mod trace;
pub(crate) mod types;

pub use assignment::{
    AssignConfig, AssignKind, AssignState, Assignment, GridTable, HashGrid, HashGridConfig, MlpAssignment,
    PartAssignment, SlotAssignment, SlotConfig,
};
pub use chamfer::ChamferTargets;
pub use pipeline::{PaperConfig, PaperResult, paper_pipeline};
pub use trace::{PublishedTrace, TraceSample};
pub use types::TypeConfig;
