//! The articulated Gaussians: how parts move, which part each Gaussian belongs to, and the training of both.
//!
//! - [`model`]: motions of parts and their parameters, and the warp of Gaussians by the motions, with gradients.
//! - [`training`]: the joint optimisation: settings, start, result. The learning rate of the joints is
//!   [`ArticulateConfig::joint_rate`].
//!
//! The training loop and the optimiser of Gaussians are in [`crate::fit`]; [`crate::fit::deform`] connects them to
//! [`model`] and to a learnt assignment to parts ([`crate::published::assignment`]).

pub(crate) mod adam;
pub(crate) mod model;
pub(crate) mod training;

pub use model::{DualQuaternion, MotionModel, MotionParameters, Skin, Warp, WarpGradients, WarpInput};
pub use training::{
    ArticulateConfig, Posed, SkinStart, Start, Trained, articulate, render_state, render_state_fixed, score_state,
};
