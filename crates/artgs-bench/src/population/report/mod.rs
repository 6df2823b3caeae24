//! The report of a population: what is right, what is wrong, where, and how far confidences can be trusted.

mod calibration;
mod changes;
mod detect;
mod drawings;
mod groups;
mod kinds;
mod overview;
mod page;
mod statistics;
mod summary;
mod tables;
#[cfg(test)]
mod testing;
mod words;
mod worst;

pub use calibration::{Bin, Calibration};
pub use changes::{Change, Changes, Pairs};
pub use detect::is_population;
pub use groups::Group;
pub use kinds::{Confusion, Kind, KindCount};
pub use overview::overview;
pub use page::{Origin, is_markdown, markdown, page};
pub use statistics::{Middle, Share, mcnemar, percentile};
pub use summary::{Numbers, Summary, Undecidable};
