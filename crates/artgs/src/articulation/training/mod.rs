//! The joint optimisation: canonical Gaussians, the parts they belong to and the motions of the parts, from the images of
//! both states.
//!
//! Data flow: a [`Start`] from found parts or from [`crate::published`] goes through [`run`] to a [`Trained`] object. Settings
//! and learning rates are in [`config`].

pub(crate) mod config;
pub(crate) mod run;
pub(crate) mod trained;

pub use config::ArticulateConfig;
pub use run::{SkinStart, Start, articulate};
pub use trained::{Posed, Trained, render_state, render_state_fixed, score_state};
