//! A run as commands start it, with its progress shown.

use crate::crash::StageNote;
use crate::failure::Failure;
use crate::output::Report;
use crate::style::Style;
use crate::{doubts, parts_table, progress};
use artgs::fit::Chosen;
use artgs::observer::{Event, Observer, Tee};
use artgs::run::FoundReport;
use artgs::{Prepared, Reconstruction};
use artgs_core::JointEstimate;
use artgs_io::RunFolder;
use serde_json::json;
use std::path::PathBuf;

/// What a command computes, and where.
pub(crate) struct Job {
    prepared: Prepared,
    pub(crate) run: RunFolder,
    resume: bool,
    device: Chosen,
    pub(crate) style: Style,
}

impl Job {
    /// Events of the run begin with those of its preparation and with its device.
    pub(crate) fn new(mut prepared: Prepared, run: &RunFolder, resume: bool, device: Chosen, style: Style) -> Self {
        prepared.before.extend(device.description.as_ref().map(Event::note));
        Self { prepared, run: run.clone(), resume, device, style }
    }

    /// Reconstructs while showing events; `also` gets them, too.
    pub(crate) fn reconstruct(&self, also: &mut dyn Observer) -> Result<Report, Failure> {
        let made = self.observed(also, |reconstruction, observer| reconstruction.run_in(&self.run, observer))?;
        let mut report = Report::new(&made.summary)?;
        report.text.push_str(&parts_table::of_result(&made));
        report.text.push_str(&doubts::of_replica(&made.replica));
        Ok(report)
    }

    /// The stages before training likewise.
    pub(crate) fn find_parts(&self, also: &mut dyn Observer) -> Result<Report, Failure> {
        let found =
            self.observed(also, |reconstruction, observer| reconstruction.find_parts_in(&self.run, observer))?;
        let json = json!(FoundReport::new(&found));
        let line = |(k, p)| part_line(k + 1, p);
        let mut text: String = found.parts.iter().enumerate().map(line).collect();
        text.push_str(&doubts::of_found(&found));
        Ok(Report { text, json })
    }

    fn observed<T>(
        &self,
        also: &mut dyn Observer,
        act: impl FnOnce(&Reconstruction<'_>, &mut dyn Observer) -> Result<T, artgs::Error>,
    ) -> Result<T, Failure> {
        let mut shown = progress::renderer(self.style);
        let mut noted = StageNote;
        let mut also_noted = Tee(&mut noted, also);
        let mut observer = Tee(shown.as_mut(), &mut also_noted);
        self.device.announce(&mut observer);
        let reconstruction =
            Reconstruction { prepared: &self.prepared, devices: self.device.devices.as_ref(), resume: self.resume };
        act(&reconstruction, &mut observer).map_err(Failure::of)
    }

    /// The folder with the images.
    pub(crate) fn photos(&self) -> Option<PathBuf> {
        self.prepared.photos(&self.run)
    }
}

fn part_line(number: usize, part: &JointEstimate) -> String {
    let share = part.confidence.map(|c| format!(", confidence {c:.2}"));
    let carrier = if part.parent > 0 { format!(" on part {}", part.parent) } else { String::new() };
    format!("part {number}: {}{carrier}{}\n", part.kind.name(), share.unwrap_or_default())
}
