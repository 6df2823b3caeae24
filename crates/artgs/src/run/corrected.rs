//! Corrections by a person, applied when a run resumes.

use super::Error;
use super::checkpoint;
use super::stages::{Depths, Run};
use crate::discover::{self, Discovery};
use crate::observer::Event;
use crate::start::PartSource;
use artgs_io::run_folder::{RunFolder, load_text};
use artgs_io::{Corrections, read_corrections, write_atomic};
use std::time::Instant;

impl<'a> Run<'a> {
    /// What was found, as `corrections.json` corrects it when a run resumes. What depends on it is computed again unless
    /// it was computed with the same corrections.
    pub(super) fn corrected(&mut self, depths: &Depths<'a>, found: Discovery) -> Result<Discovery, Error> {
        let Some(folder) = self.folder else { return Ok(found) };
        let applied = load_text(&folder.applied_corrections())?.unwrap_or_default();
        let learnt = self.config.start.parts == PartSource::Learnt;
        if learnt {
            self.warn_of_ignored_corrections();
        }
        let wanted = self.what.resume && !learnt;
        let corrections = if wanted { read_corrections(folder.root()) } else { Ok(None) };
        let corrections = corrections.map_err(Error::Corrections)?;
        // Classes change exports only.
        let corrections = corrections.map(Corrections::without_classes).filter(|c| !c.is_empty());
        let text = corrections.as_ref().map(Corrections::text).transpose()?.unwrap_or_default();
        // Before any result is removed: corrections that are refused must not cost what was trained.
        let corrected = match &corrections {
            None => found,
            Some(corrections) => self.apply(depths, &found, corrections)?,
        };
        if text != applied {
            self.reuse = false;
            // Removed first: a run that is interrupted here and resumed must not load what the old corrections gave.
            checkpoint::forget_trained(folder)?;
            write_atomic(&folder.applied_corrections(), text.as_bytes())?;
        }
        Ok(corrected)
    }

    fn apply(&mut self, depths: &Depths<'a>, found: &Discovery, corrections: &Corrections) -> Result<Discovery, Error> {
        self.observer.event(Event::started("correct"));
        let begun = Instant::now();
        let corrected = discover::correct(&self.scene(depths)?, found, corrections, &self.config.discover)?;
        corrected.warnings.iter().for_each(|w| self.warn(w.clone()));
        self.computed("correct", begun)?;
        Ok(corrected)
    }

    /// Warns of corrections that do not apply because parts are learnt.
    pub(super) fn warn_of_ignored_corrections(&mut self) {
        let file = self.folder.filter(|_| self.what.resume).map(RunFolder::corrections);
        if let Some(file) = file.filter(|file| file.is_file()) {
            let file = file.display();
            self.warn(format!("{file} is ignored: it corrects parts found from depth, and here they are learnt"));
        }
    }
}

/// Parts that a run found in a folder before training; none if it does not hold them.
pub fn found_parts(folder: &RunFolder) -> Option<Discovery> {
    checkpoint::load_discovery(folder)
}

/// The corrections that the replica in a folder was made with, and how many movable parts were found before them; none
/// if there were no corrections.
pub fn corrections_of(folder: &RunFolder) -> Option<(Corrections, usize)> {
    let text = std::fs::read(folder.replica_corrections()).ok()?;
    Some((Corrections::parse(&text).ok()?, found_parts(folder)?.parts.len()))
}
