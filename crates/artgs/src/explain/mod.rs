//! How well an explanation accounts for what both states show: one energy in nats. An explanation is a motion for every part and a part
//! for every surface point (surfel). Lower is better, and explanations with different numbers of parts compare.
//!
//! The energy is the sum of minus the log likelihood of every surfel under the views of the other state, the borders between parts, and
//! the numbers that describe the motions. `search` adds and removes parts as long as the energy falls; `proposals` are the motions that it
//! tries. [`judge`] compares what was found with the truth and with what an adversary finds.

mod common;
mod cost;
mod division;
mod energy;
mod evidence;
mod fit;
mod found;
mod interval;
pub mod judge;
mod labels;
mod motion;
mod noise;
mod proposals;
mod search;
mod settings;
#[cfg(test)]
mod tests;

pub use energy::{Explanation, Problem, Surfels, Terms};
pub use search::SearchSettings;
pub use settings::ExplainSettings;
