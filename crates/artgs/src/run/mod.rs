//! A whole run: [`Reconstruction`] computes, [`Reconstructed`] is the result, and a folder keeps both.
//!
//! Each stage is a function of results of earlier stages (`stages`). With a folder, a stage saves its result when it is
//! finished (`checkpoint`), so that an interrupted run can resume; without one everything stays in memory.

mod assemble;
mod checkpoint;
mod compare;
mod corrected;
mod error;
mod fingerprint;
mod following;
mod found;
mod fusion;
mod learnt;
mod lettering;
mod output;
pub(crate) mod points;
pub(crate) mod preview;
mod reconstruction;
mod refined;
pub(crate) mod rendered;
mod result;
mod saved;
mod score;
mod stages;
mod summary;

pub use crate::published::{PublishedTrace, TraceSample};
pub use crate::start::{PartSource, StartConfig, StartSource};
pub use assemble::DOUBTFUL;
pub use compare::{Compared, Comparison, compare};
pub use corrected::{corrections_of, found_parts};
pub use error::Error;
pub use found::FoundReport;
pub use output::{Earlier, Output, OutputError, lock};
pub use preview::Preview;
pub use reconstruction::{Begun, Reconstruction, RunOptions, finds_parts};
pub use result::{FittedParts, Reconstructed};
pub use saved::{SavedReplica, load};
pub use score::{evaluate, evaluate_found};
pub use summary::{Summary, ViewMeans};
