//! A command line from its words to its exit code.

use crate::args::Cli;
use crate::{commands, crash, gpu, output};
use clap::Parser;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::OnceLock;

/// How the program was started.
struct Started {
    program: PathBuf,
    words: Vec<OsString>,
}

static STARTED: OnceLock<Started> = OnceLock::new();

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
        let started = STARTED.get_or_init(|| Started { program: program.into(), words });
        let cli = match Cli::try_parse_from(&started.words) {
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

/// The program that is running.
pub(crate) fn program() -> Option<&'static Path> {
    STARTED.get().map(|started| started.program.as_path())
}

/// The command as a shell reads it back.
#[cfg(feature = "bench")]
pub(crate) fn line() -> String {
    let words = STARTED.get().into_iter().flat_map(|started| started.words.iter().skip(1));
    let words = words.map(|word| quoted(&word.to_string_lossy()));
    std::iter::once("artgs".to_string()).chain(words).collect::<Vec<_>>().join(" ")
}

/// A word as a shell reads it back.
#[cfg(feature = "bench")]
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.into() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

#[cfg(all(test, feature = "bench"))]
mod tests {
    use super::*;

    #[test]
    fn words_come_back_from_a_shell() {
        assert_eq!(["a/b-c.d=e", "a b", "", "it's"].map(quoted), ["a/b-c.d=e", "'a b'", "''", "'it'\\''s'"]);
    }
}
