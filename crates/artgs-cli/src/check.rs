//! `artgs check`: whether the exports of a replica open and move.

#[cfg(feature = "check")]
pub(crate) use built_in::{check, run};

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
    use crate::failure::Failure;
    use crate::folder::require_replica;
    use crate::output::Report;
    use crate::style::Style;
    use artgs_check::{CheckOptions, CheckReport};
    use artgs_io::RunFolder;
    use artgs_io::run_folder::save_json;
    use serde_json::json;
    use std::path::{Path, PathBuf};

    /// Forms of a report of rules.
    #[derive(Clone, Copy, PartialEq)]
    enum Form {
        Json,
        Page,
    }

    pub(crate) fn run(args: &Check, style: Style) -> Result<(), Failure> {
        let checked = checked(args)?;
        checked.report.show(style.json)?;
        checked.result(&RunFolder::new(&args.out))
    }

    /// The check that is asked for.
    fn checked(args: &Check) -> Result<Checked, Failure> {
        let run = RunFolder::new(&args.out);
        // Refused before the check, which takes a while.
        let files = args.report.as_deref().map(forms).transpose()?.unwrap_or_default();
        require_replica(&run)?;
        let report = found(&run)?;
        for (file, form) in files {
            write(&file, form, &run, &report)?;
        }
        Ok(Checked { passed: report.passed(), report: Report::new(&report)? })
    }

    /// Opens the exports of a replica and drives its joints.
    pub(crate) fn check(run: &RunFolder) -> Result<Checked, Failure> {
        let report = found(run)?;
        Ok(Checked { passed: report.passed(), report: Report::new(&report)? })
    }

    fn found(run: &RunFolder) -> Result<CheckReport, Failure> {
        artgs_check::check(run.root(), &CheckOptions::default()).map_err(Failure::bad_input)
    }

    /// The files of a report: the named one, or one of each form in a folder.
    fn forms(path: &Path) -> Result<Vec<(PathBuf, Form)>, Failure> {
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("json") => Ok(vec![(path.into(), Form::Json)]),
            Some("html") => Ok(vec![(path.into(), Form::Page)]),
            None => Ok(vec![(path.join("check.json"), Form::Json), (path.join("check.html"), Form::Page)]),
            Some(_) => {
                let shown = path.display();
                Err(Failure::bad(format!("--report {shown}: give a file that ends in .json or .html, or a folder")))
            }
        }
    }

    fn write(file: &Path, form: Form, run: &RunFolder, report: &CheckReport) -> Result<(), Failure> {
        let shown = run.root().display();
        let written = match form {
            Form::Json => {
                let version = env!("CARGO_PKG_VERSION");
                let limits = &report.options;
                let rules = report.rules();
                let passed = report.passed();
                let value = json!({ "artgs": version, "passed": passed, "options": limits, "rules": rules });
                save_json(file, &value)
            }
            Form::Page => artgs_io::write_atomic(file, report.page(&format!("Check of {shown}")).as_bytes()),
        };
        written.map_err(Failure::failed)
    }
}
