//! The joint optimisation: canonical Gaussians, the parts they belong to and the motions of the parts, from the images of
//! both states.
//!
//! Data flow: a [`Start`] from registration or from [`crate::canonical`] goes through [`run`] to a [`Trained`] object;
//! [`types`] finds the kinds of joints beforehand and [`pipeline`] runs the published stages one after the other.
//! Settings and learning rates are in [`config`].

pub(crate) mod config;
mod decisions;
pub(crate) mod pipeline;
pub(crate) mod run;
pub(crate) mod trace;
pub(crate) mod trained;
pub(crate) mod types;

pub use config::ArticulateConfig;
pub use pipeline::{PaperConfig, PaperResult, paper_pipeline};
pub use run::{SkinStart, Start, articulate};
pub use trace::{PublishedTrace, TraceSample};
pub use trained::{Posed, Trained, render_state, render_state_fixed, score_state};
pub use types::TypeConfig;
