//! A command line from its words to its exit code.

use crate::args::Cli;
use crate::{commands, crash, gpu, output, started};
use clap::Parser;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

/// The program `artgs`, with the words that the process was started with.
pub fn process() -> ExitCode {
    gpu::silence_drivers();
    let words: Vec<OsString> = std::env::args_os().collect();
    match std::env::current_exe() {
        Ok(program) => ExitCode::from(command(&program, words)),
        Err(_) => ExitCode::from(command(Path::new("artgs"), words)),
    }
}

/// Executes a command line, `words[0]` being the name of the program, with its output on the streams of the process, and returns
/// its exit code. `program` executes `artgs` when it is started: `bench` makes its runs in processes of their own. To be called once
/// in a process, which afterwards ends.
pub fn command(program: &Path, words: Vec<OsString>) -> u8 {
    crash::guarded(|| {
        let words = started::note(program, words);
        let cli = match Cli::try_parse_from(words) {
            Ok(cli) => cli,
            Err(error) => {
                // A reader that has gone away is no error.
                let _ = error.print();
                return u8::try_from(error.exit_code()).unwrap_or(2);
            }
        };
        let json = cli.wants_json();
        match commands::run(&cli) {
            Ok(()) => 0,
            Err(failure) => {
                output::error(&failure, json);
                failure.exit_code()
            }
        }
    })
}
