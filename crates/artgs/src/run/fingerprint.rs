//! Hashes of what stages read: the capture, the settings, the version of the program.

use crate::config::Config;
use artgs_core::Capture;
use artgs_io::capture::fingerprint;
use artgs_io::run_folder::{RunFolder, load_json, save_json};
use artgs_io::{FileError, write_atomic};
use std::collections::BTreeMap;
use std::hash::Hasher;
use twox_hash::XxHash3_64;

/// Sections of the settings that are read before anything is trained.
const BEFORE_TRAINING: [&str; 6] = ["parts", "seed", "method", "align", "discover", "registration"];
/// Sections that training reads as well.
const TRAINING: [&str; 5] = ["single", "start", "canonical", "types", "articulate"];

/// Keys of the stages of a run. A saved result is valid if its key is still the same.
pub(super) struct StageKeys {
    capture: String,
    /// Settings as text, by section.
    settings: BTreeMap<String, String>,
    /// Keys under which results were saved.
    saved: BTreeMap<String, String>,
}

impl StageKeys {
    /// Records the capture in the folder, if there is one; `resume` takes the keys of the earlier run.
    pub(super) fn new(
        folder: Option<&RunFolder>,
        capture: &Capture,
        config: &Config,
        resume: bool,
    ) -> Result<Self, super::Error> {
        let capture = fingerprint(capture);
        let mut saved = BTreeMap::new();
        if let Some(folder) = folder {
            write_atomic(&folder.capture_fingerprint(), capture.as_bytes())?;
            if resume {
                // A file that cannot be read makes every stage run again.
                saved = load_json(&folder.stage_keys()).ok().flatten().unwrap_or_default();
            }
        }
        let table: toml::Table = config.to_toml()?.parse().map_err(crate::config::ConfigError::Toml)?;
        let settings = table.into_iter().map(|(section, value)| (section, value.to_string())).collect();
        Ok(Self { capture, settings, saved })
    }

    /// Hash of what a stage and those before it read.
    fn key(&self, stage: &str) -> String {
        let training: &[&str] = match stage {
            "single" | "discover" | "register" => &["single", "start"],
            _ => &TRAINING,
        };
        let mut hash = XxHash3_64::new();
        hash.write(env!("CARGO_PKG_VERSION").as_bytes());
        hash.write(self.capture.as_bytes());
        for section in BEFORE_TRAINING.iter().chain(training) {
            hash.write(section.as_bytes());
            hash.write(self.settings.get(*section).map_or(&[][..], |text| text.as_bytes()));
        }
        format!("{:016x}", hash.finish())
    }

    /// True if the saved result of a stage was computed from the same input; none if there is none.
    pub(super) fn is_valid(&self, stage: &str) -> Option<bool> {
        self.saved.get(stage).map(|saved| *saved == self.key(stage))
    }

    /// Records that the result of a stage is about to be replaced: a run that is killed between the result and its key must
    /// not leave a new result with an old key.
    pub(super) fn forget(&mut self, stage: &str, folder: &RunFolder) -> Result<(), FileError> {
        self.saved.remove(stage);
        save_json(&folder.stage_keys(), &self.saved)
    }

    /// Records that a stage was computed.
    pub(super) fn computed(&mut self, stage: &str, folder: &RunFolder) -> Result<(), FileError> {
        self.saved.insert(stage.into(), self.key(stage));
        save_json(&folder.stage_keys(), &self.saved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::State;
    use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};

    fn capture() -> Capture {
        cabinet_capture(&CabinetOptions { views: 3, size: 32, ..CabinetOptions::default() }).unwrap().0
    }

    #[test]
    fn a_stage_depends_on_its_settings_and_on_those_before_it() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::new(root.path());
        let (capture, config) = (capture(), Config::default());
        let mut keys = StageKeys::new(Some(&folder), &capture, &config, false).unwrap();
        for stage in ["discover", "articulate"] {
            assert_eq!(keys.is_valid(stage), None);
            keys.computed(stage, &folder).unwrap();
        }
        let valid = |capture: &Capture, config: &Config| {
            let keys = StageKeys::new(Some(&folder), capture, config, true).unwrap();
            ["discover", "articulate"].map(|stage| keys.is_valid(stage))
        };
        assert_eq!(valid(&capture, &config), [Some(true), Some(true)]);
        let mut steps = config.clone();
        steps.articulate.steps += 1;
        assert_eq!(valid(&capture, &steps), [Some(true), Some(false)]);
        let mut spacing = config.clone();
        spacing.discover.spacing *= 2.0;
        assert_eq!(valid(&capture, &spacing), [Some(false), Some(false)]);
        let mut surface = config.clone();
        surface.surface.resolution *= 2.0;
        assert_eq!(valid(&capture, &surface), [Some(true), Some(true)]);
        let mut other = capture.clone();
        other.states[State::START].train.swap(0, 1);
        assert_eq!(valid(&other, &config), [Some(false), Some(false)]);
        // Killed after the result was replaced.
        StageKeys::new(Some(&folder), &capture, &spacing, true).unwrap().forget("discover", &folder).unwrap();
        assert_eq!(valid(&capture, &config), [None, Some(true)]);
    }
}
