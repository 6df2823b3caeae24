//! Which code each command runs.

use crate::args::{Cli, Command};
use crate::failure::Failure;
use crate::style::Style;
use crate::{demo, device, evaluate, export, inspect, reconstruct, settings, synth, view};

pub(crate) fn run(cli: &Cli) -> Result<(), Failure> {
    let style = Style { json: cli.wants_json(), quiet: cli.quiet, silent: false };
    execute(&cli.command, style)
}

/// Executes one command.
fn execute(command: &Command, style: Style) -> Result<(), Failure> {
    match command {
        Command::Inspect(args) => inspect::run(args, style),
        Command::Reconstruct(args) => reconstruct::run(args, style),
        Command::Evaluate(args) => evaluate::run(args, style),
        Command::Demo(args) => demo::run(args, style),
        Command::Batch(args) => crate::batch::run(args, style),
        #[cfg(feature = "bench")]
        Command::Bench(args) => crate::bench::run(args, style),
        #[cfg(feature = "bench")]
        Command::Report(args) => crate::report::run(args, style),
        Command::Synth(args) => synth::run(args, style),
        Command::Export(args) => export::run(args, style),
        #[cfg(feature = "check")]
        Command::Check(args) => crate::check::run(args, style),
        Command::View(args) => view::run(args, style),
        Command::Devices(_) => device::list(style),
        Command::Settings(args) => settings::list(args.preset, style),
    }
}
