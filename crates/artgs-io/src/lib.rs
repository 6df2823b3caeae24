//! Files: reads captures, and reads and writes recordings, images, meshes, splats, replicas, run folders and exports. One
//! source file per format.
//!
//! Axis flips and unit conversions of foreign formats happen here and nowhere else; see `CONVENTIONS.md`.

pub mod asset;
mod atomic;
pub mod capture;
mod corrections;
pub mod digest;
mod error;
pub mod export_report;
pub mod folder_lock;
pub mod ground_truth;
pub mod image_io;
mod mesh_ply;
mod object_box;
mod ply;
pub mod recording;
mod reduce;
pub mod replica;
mod run_contents;
pub mod run_folder;
mod shared_files;
mod splat_ply;
pub mod summary;
mod tensors;
mod text;
mod truth_of_run;

pub use atomic::write_atomic;
pub use capture::{CaptureError, CaptureOptions, load_capture, load_capture_with};
pub use corrections::{
    CentreEdit, ClassMark, Corrections, CutPlane, JointMark, MarkedJoint, read_corrections, write_corrections,
};
pub use digest::FileDigest;
pub use error::FileError;
pub use folder_lock::FolderLock;
pub use ground_truth::{GroundTruth, load_ground_truth, read_true_zeros};
pub use mesh_ply::{read_mesh_ply, write_mesh_ply};
pub use object_box::BoxBounds;
pub use recording::{RecordingError, RecordingFormat, RecordingOptions, load_recording, write_recording};
pub use replica::{read_replica, write_replica};
pub use run_contents::Contents;
pub use run_folder::RunFolder;
pub use splat_ply::{read_splat_ply, write_splat_ply};
pub use summary::{CaptureSummary, summarize};
pub use tensors::{Tensor, read_safetensors};
pub use text::without_mark;
pub use truth_of_run::load_ground_truth_of_run;
