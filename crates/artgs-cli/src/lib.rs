//! The program `artgs` as a library: [`process()`] is the program, [`command()`] is one command line in a process of something else.
//!
//! Exit codes: 0 done, 1 failed, 2 wrong usage or bad input, 3 a check failed, 70 an error in the program, 75 a later retry makes sense, 130 interrupted.

mod args;
mod batch;
#[cfg(feature = "bench")]
mod bench;
mod check;
mod commands;
mod crash;
mod demo;
mod device;
mod doubts;
mod evaluate;
mod export;
mod failure;
mod folder;
mod gpu;
mod live;
mod object_box;
mod output;
mod pace;
mod parts_table;
#[cfg(feature = "bench")]
mod population;
mod process;
mod progress;
mod reconstruct;
mod recordings;
#[cfg(feature = "bench")]
mod report;
#[cfg(feature = "bench")]
mod report_population;
mod rerun;
#[cfg(feature = "bench")]
mod seeds;
mod settings;
#[cfg(feature = "bench")]
mod suites;
mod synth;
mod view;
mod view_recording;

pub use crash::{caught, describe_panics};
pub use process::{command, process};
pub use view::replica_page;
