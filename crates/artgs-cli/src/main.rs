//! `artgs`: photos of an articulated object in two states to an interactable replica.

use std::process::ExitCode;

fn main() -> ExitCode {
    artgs_cli::process()
}
