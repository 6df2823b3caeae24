//! The program `artgs` as a library: [`process()`] is the program, [`command()`] is one command line in a process of something else.
//!
//! Exit codes: 0 done, 1 failed, 2 wrong usage or bad input, 3 a check failed, 70 an error in the program, 75 a later retry makes sense, 130 interrupted.

mod args;
mod batch;
#[cfg(feature = "bench")]
mod bench;
mod browser;
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
mod inspect;
#[cfg(feature = "bench")]
mod interrupt;
mod job;
mod live;
mod object_box;
mod output;
mod pace;
#[cfg(feature = "bench")]
mod page_file;
mod pages;
mod parts_table;
#[cfg(feature = "bench")]
mod population;
mod printable;
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
mod started;
mod style;
#[cfg(feature = "bench")]
mod suites;
mod synth;
mod threads;
mod view;
mod view_recording;

pub use crash::{caught, describe_panics};
pub use pages::replica_page;
pub use process::{command, process};
