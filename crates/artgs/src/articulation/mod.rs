//! The articulated Gaussians: how parts move, which part each Gaussian belongs to, and the training of both.
//!
//! - [`model`]: motions of parts and their parameters, and the warp of Gaussians by the motions, with gradients.
//! - [`assignment`]: learnt part weights of Gaussians, in three variants, with gradients.
//! - [`training`]: the stages of the joint optimisation: settings, start, joint types, result. The learning rate of the
//!   joints is [`ArticulateConfig::joint_rate`].
//!
//! The training loop and the optimiser of Gaussians are in [`crate::fit`]; [`crate::fit::deform`] connects them to
//! [`model`] and [`assignment`].

pub(crate) mod adam;
pub(crate) mod assignment;
pub(crate) mod model;
pub(crate) mod training;

pub use assignment::{
    AssignConfig, AssignKind, AssignState, Assignment, GridTable, HashGrid, HashGridConfig, MlpAssignment,
    PartAssignment, SlotAssignment, SlotConfig,
};
pub use model::{DualQuaternion, MotionModel, MotionParameters, Skin, Warp, WarpGradients, WarpInput};
pub use training::{
    ArticulateConfig, PaperConfig, PaperResult, Posed, PublishedTrace, SkinStart, Start, TraceSample, Trained,
    TypeConfig, articulate, paper_pipeline, render_state, render_state_fixed, score_state,
};
