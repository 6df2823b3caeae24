//! Benchmarks: runs the method on many captures, each run in its own process, scores the replicas, and writes tables with
//! means and standard deviations beside the numbers printed in the paper. [`batch`] reports on the rows of `artgs batch`,
//! [`population`] runs random objects one by one.

pub mod batch;
mod bench;
mod collect;
mod counted;
mod escape;
mod histogram;
mod html;
mod item;
mod launch;
mod markdown;
mod marker;
mod measure;
mod metric;
pub mod paper;
mod picture;
mod plot;
mod plots;
pub mod population;
mod record;
mod report;
pub mod stages;
mod stats;
mod table;
mod tables;
#[cfg(test)]
mod testing;
mod variant;

pub use bench::{BenchError, Event, Finished, Options, RunName, run};
pub use collect::Collected;
pub use counted::counted;
pub use item::{Item, ItemError, Renderer, Source, items_of_folder};
pub use launch::Tools;
pub use measure::{Measure, measure};
pub use record::{Facts, Measured, Outcome, PictureScores, Record, RunMetrics, RunSettings};
pub use report::{Circumstances, Files, overview, write_report};
pub use variant::{Variant, VariantError};
