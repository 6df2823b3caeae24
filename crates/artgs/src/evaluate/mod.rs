//! Scores of a replica against the truth: joints, part assignment, and surfaces, in the units of the ArtGS tables.

pub mod geometry;
pub mod joints;
pub mod matching;
pub mod scores;
mod table;

pub use geometry::{GeometryConfig, GeometryScore, MISSING, MeshScore, chamfer, sample_surface, score_mesh};
pub use joints::{JointErrors, Motion, axis_angle_deg, axis_position, joint_errors, part_motion};
pub use matching::{hungarian, match_parts};
pub use scores::{Counts, EvaluateConfig, JointMeans, PartScore, Scores, Truth, evaluate};
