//! The joint optimisation: canonical Gaussians, the parts they belong to and the motions of these, from the
//! photographs of both states.
//!
//! Data flow: a [`Start`] from registration or from [`crate::canonical`] goes through [`run`] to a [`Trained`] object;
//! [`types`] finds the kinds of joints beforehand and [`pipeline`] strings the published stages together.

pub mod config;
pub mod pipeline;
pub mod run;
pub mod trained;
pub mod types;

pub use config::ArticulateConfig;
pub use pipeline::{PaperConfig, PaperResult, paper_pipeline};
pub use run::{SkinStart, Start, articulate};
pub use trained::{Posed, Trained, render_state, render_state_fixed, score_state};
pub use types::{TypeConfig, predict_types};
