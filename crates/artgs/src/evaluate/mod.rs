//! Scores of a replica against the truth: joints, part assignment, surfaces and pictures, in the units of the ArtGS
//! tables.

mod closing;
mod convolution;
mod flip;
mod geometry;
mod joints;
mod lpips;
pub(crate) mod matching;
mod pictures;
mod scores;
mod table;

pub use crate::hungarian::hungarian;
pub use closing::Closing;
pub use flip::{PIXELS_PER_DEGREE, flip, flip_map};
pub use geometry::{GeometryConfig, GeometryScore, MISSING, MeshScore, chamfer, sample_surface, score_mesh};
pub use joints::{JointErrors, Motion, axis_angle_deg, axis_position, joint_errors, part_motion};
pub use lpips::{Lpips, LpipsError, LpipsNet};
pub use pictures::{PictureError, PictureReport, PictureScores, score_replica};
pub use scores::{Counts, EvaluateConfig, JointMeans, PartScore, Scores, Truth, evaluate};
