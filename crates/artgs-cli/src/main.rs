//! `artgs`: photos of an articulated object in two states to an interactable replica.
//!
//! Exit codes: 0 done, 1 failed, 2 wrong usage or bad input, 3 a check failed, 70 an error in the program, 130 interrupted.

mod agreement;
mod args;
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
mod memory;
mod object_box;
mod output;
mod pace;
mod parts_table;
mod progress;
mod reconstruct;
mod recordings;
mod rerun;
mod settings;
#[cfg(feature = "bench")]
mod suites;
mod synth;
mod view;
mod view_recording;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    crash::guarded(|| {
        gpu::silence_drivers();
        let cli = args::Cli::parse();
        let json = cli.wants_json();
        match commands::run(&cli) {
            Ok(()) => ExitCode::SUCCESS,
            Err(failure) => {
                output::error(&failure, json);
                ExitCode::from(failure.exit_code())
            }
        }
    })
}
