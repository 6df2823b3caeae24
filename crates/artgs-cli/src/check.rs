//! `artgs check`: whether the exports of a replica open and move.

#[cfg(feature = "check")]
pub(crate) use built_in::{check, checked, run};

use crate::failure::Failure;
use crate::output::Report;
use artgs_io::RunFolder;

/// The findings of a check.
pub(crate) struct Checked {
    pub(crate) report: Report,
    pub(crate) passed: bool,
}

impl Checked {
    /// An error if something is wrong with the exports.
    pub(crate) fn result(&self, run: &RunFolder) -> Result<(), Failure> {
        let failed = || Failure::ChecksFailed(format!("{} does not pass", run.root().display()));
        if self.passed { Ok(()) } else { Err(failed()) }
    }
}

#[cfg(feature = "check")]
mod built_in {
    use super::Checked;
    use crate::args::Check;
    use crate::commands::Style;
    use crate::failure::Failure;
    use crate::folder::require_replica;
    use crate::output::Report;
    use artgs_check::CheckOptions;
    use artgs_io::RunFolder;

    pub(crate) fn run(args: &Check, style: Style) -> Result<(), Failure> {
        let checked = checked(args)?;
        checked.report.show(style.json)?;
        checked.result(&RunFolder::new(&args.out))
    }

    /// The check that is asked for.
    pub(crate) fn checked(args: &Check) -> Result<Checked, Failure> {
        let run = RunFolder::new(&args.out);
        require_replica(&run)?;
        check(&run)
    }

    /// Opens the exports of a replica and drives its joints.
    pub(crate) fn check(run: &RunFolder) -> Result<Checked, Failure> {
        let report = artgs_check::check(run.root(), &CheckOptions::default()).map_err(Failure::bad_input)?;
        Ok(Checked { passed: report.passed(), report: Report::new(&report)? })
    }
}
