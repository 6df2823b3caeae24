//! All settings of a reconstruction in one place; reads and writes TOML.

use crate::align::AlignConfig;
use crate::articulation::ArticulateConfig;
use crate::discover::DiscoverConfig;
use crate::fit::single::SingleConfig;
use crate::part_count::PartCount;
use crate::published::TypeConfig;
use crate::published::canonical::init::CanonicalConfig;
use crate::registration::RegistrationConfig;
pub use crate::settings::ConfigError;
use crate::settings::{self, bad};
use crate::start::{PartSource, StartConfig};
use crate::surface::SurfaceConfig;
use artgs_io::without_mark;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// How parts and joints are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// From depth: what explains it best, a part for every surface point; then Gaussians are trained on the found parts.
    #[default]
    Discover,
    /// As published: matched Gaussians, clustered centres, learned assignment and motions.
    Paper,
    /// A baseline without Gaussians: clusters of what moved are registered and fused.
    Registration,
}

/// Settings of a reconstruction. Every field may be left out of a file; unknown fields are refused.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Number of rigid parts, the static part included: `4`, `"3..8"`, or `"auto"` to let discovery decide.
    pub parts: PartCount,
    /// Seed of all random numbers.
    pub seed: u64,
    /// How parts and joints are found.
    pub method: Method,
    /// Alignment of recordings, selection of the object, and correction of the poses of a capture.
    pub align: AlignConfig,
    /// Gaussians of each state alone. `discover` needs them only where a capture has no depth.
    pub single: SingleConfig,
    /// Part discovery of `discover`; its distance between points also serves `registration`.
    pub discover: DiscoverConfig,
    /// First canonical Gaussians of `discover`.
    pub start: StartConfig,
    /// First canonical Gaussians and part centres of `paper`.
    pub canonical: CanonicalConfig,
    /// Joint types of `paper`; the least turn of a revolute part also where `discover` learns its parts.
    pub types: TypeConfig,
    /// The baseline `registration`.
    pub registration: RegistrationConfig,
    /// Training of the articulated Gaussians.
    pub articulate: ArticulateConfig,
    /// Meshes.
    pub surface: SurfaceConfig,
}

impl Config {
    /// The published method with its constants.
    pub fn paper() -> Self {
        Self {
            method: Method::Paper,
            single: SingleConfig::paper(),
            canonical: CanonicalConfig::paper(),
            types: TypeConfig::paper(),
            articulate: ArticulateConfig::paper(),
            surface: SurfaceConfig { keep_fraction: 0.1, min_weight: 0.5, ..SurfaceConfig::default() },
            ..Self::default()
        }
    }

    /// The baseline that registers clusters of what moved.
    pub fn registration() -> Self {
        Self { method: Method::Registration, ..Self::default() }
    }

    /// True if Gaussians are trained.
    pub fn trains(&self) -> bool {
        self.method != Method::Registration
    }

    /// These settings with those replaced that the TOML text gives.
    pub fn overridden_by(&self, text: &str) -> Result<Self, ConfigError> {
        self.overridden_with(text.parse()?)
    }

    /// The same with the TOML text of a file; every error names the file.
    pub fn overridden_by_file(&self, file: &Path) -> Result<Self, ConfigError> {
        let named = |reason: String| ConfigError::File { file: file.into(), reason };
        let bytes = std::fs::read(file).map_err(|e| named(e.to_string()))?;
        let bytes = without_mark(&bytes).map_err(|reason| named(reason.into()))?;
        let text = std::str::from_utf8(bytes)
            .map_err(|e| named(format!("is no text in UTF-8 (byte {}); save it as UTF-8", e.valid_up_to() + 1)))?;
        self.overridden_by(text).map_err(|e| named(e.to_string()))
    }

    /// The same with settings that were parsed already.
    pub fn overridden_with(&self, changes: toml::Table) -> Result<Self, ConfigError> {
        let mut table = toml::Table::try_from(self)?;
        merge(&mut table, changes);
        settings::check(&table)?;
        // Its line number would be that of the merged table, which is not the file of the user.
        let named = |e: toml::de::Error| ConfigError::Field(with_choice(on_one_line(&e), &table));
        let config: Self = table.clone().try_into().map_err(named)?;
        config.check()?;
        Ok(config)
    }

    /// As TOML, complete.
    pub fn to_toml(&self) -> Result<String, ConfigError> {
        Ok(toml::to_string_pretty(self)?)
    }

    /// Refuses an unknown number of parts where nothing can find it.
    pub fn check_part_count(&self) -> Result<(), ConfigError> {
        let needed = self.method != Method::Discover || self.start.parts == PartSource::Learnt;
        if needed { self.known_parts().map(|_| ()) } else { Ok(()) }
    }

    /// The number of parts, for steps that cannot find it.
    pub(crate) fn known_parts(&self) -> Result<usize, ConfigError> {
        let who = match self.method {
            Method::Paper => "--preset paper",
            Method::Registration => "--preset registration",
            Method::Discover => "learning parts in training (`start.parts`)",
        };
        self.parts.given().ok_or(ConfigError::PartsNeeded(who))
    }

    /// Refuses values that no stage can work with: those out of the ranges of [`settings`], and some that
    /// do not go together.
    pub fn check(&self) -> Result<(), ConfigError> {
        self.parts.check().map_err(|rule| bad("", "parts", self.parts, rule))?;
        if i64::try_from(self.seed).is_err() {
            return Err(bad(
                "",
                "seed",
                self.seed,
                "must be a whole number from 0 to 9223372036854775807, as TOML has",
            ));
        }
        settings::check(&toml::Table::try_from(self)?)?;
        for (section, assign) in
            [("articulate.assign.grid", &self.articulate.assign), ("types.train.assign.grid", &self.types.train.assign)]
        {
            let finest = assign.grid.base_resolution * assign.grid.growth.powi(assign.grid.levels as i32 - 1);
            if finest > FINEST_GRID {
                let rule = "must be less: with these `base_resolution` and `growth`, the finest level has more than 16777216 points";
                return Err(bad(section, "levels", assign.grid.levels, rule));
            }
        }
        Ok(())
    }
}

/// Most points per unit length of the finest level of a hash grid.
const FINEST_GRID: f64 = 16_777_216.0;

/// What is wrong and in which section, on one line.
fn on_one_line(error: &toml::de::Error) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A message that ends with the path of a table, such as `cluster.affinity`, with the key of the alternative that the table holds:
/// the reader of alternatives does not state it.
fn with_choice(message: String, table: &toml::Table) -> String {
    let key = || {
        let path = message.strip_suffix('`')?.rsplit_once("in `")?.1;
        let mut names = path.split('.');
        let first = table.get(names.next()?)?;
        let inner = names.try_fold(first, |value, name| value.get(name))?.as_table()?;
        inner.keys().next().filter(|_| inner.len() == 1)
    };
    match key() {
        Some(key) => format!("{}.{key}`", message.trim_end_matches('`')),
        None => message,
    }
}

fn merge(into: &mut toml::Table, changes: toml::Table) {
    for (key, value) in changes {
        match (into.get_mut(&key), value) {
            (Some(toml::Value::Table(inner)), toml::Value::Table(change)) if !is_choice(inner, &change) => {
                merge(inner, change);
            }
            (_, value) => {
                into.insert(key, value);
            }
        }
    }
}

/// True if both tables hold one key and not the same: alternatives such as `rbf = 1.0` for `neighbours = 7`.
fn is_choice(inner: &toml::Table, change: &toml::Table) -> bool {
    inner.len() == 1 && change.len() == 1 && inner.keys().ne(change.keys())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_alternative_is_named_with_its_key() {
        let wrong = Config::paper().overridden_by("[registration.cluster.affinity]\nrbf = []").unwrap_err().to_string();
        assert!(wrong.contains("registration.cluster.affinity.rbf"), "{wrong}");
    }

    #[test]
    fn settings_survive_toml_and_single_fields_can_be_replaced() {
        for config in [Config::default(), Config::paper(), Config::registration()] {
            assert_eq!(Config::default().overridden_by(&config.to_toml().unwrap()).unwrap(), config);
        }
        let changed = Config::paper().overridden_by("parts = 3\n[discover]\nrounds = 7\n").unwrap();
        assert_eq!((changed.parts, changed.discover.rounds, changed.method), (3.into(), 7, Method::Paper));
        for (text, parts) in [("4", 4.into()), ("\"3..8\"", PartCount::Range { least: 3, most: 8 })] {
            let counted = Config::default().overridden_by(&format!("parts = {text}")).unwrap();
            assert_eq!(counted.parts, parts);
            assert_eq!(Config::default().overridden_by(&counted.to_toml().unwrap()).unwrap(), counted);
            assert_eq!(counted.overridden_by("parts = \"auto\"").unwrap(), Config::default());
        }
        assert_eq!(changed.single, SingleConfig::paper());
    }

    #[test]
    fn methods_that_cannot_count_parts_name_the_remedy() {
        let message = |config: &Config| config.check_part_count().unwrap_err().to_string();
        let learnt = Config::default().overridden_by("start.parts = \"learnt\"").unwrap();
        assert!(message(&Config::paper()).contains("--preset paper needs --parts K"));
        assert!(message(&Config::registration()).contains("--preset registration needs --parts K"));
        assert!(message(&learnt).contains("`start.parts`"));
        let ranged = Config { parts: PartCount::Range { least: 2, most: 4 }, ..Config::paper() };
        assert!(ranged.check_part_count().is_err() && Config::default().check_part_count().is_ok());
        assert!(Config { parts: 3.into(), ..learnt }.check_part_count().is_ok());
    }

    #[test]
    fn a_shorter_paper_run_keeps_its_proportions() {
        assert_eq!(Config::paper_scaled(1.0).unwrap(), Config::paper());
        let (short, paper) = (Config::paper_scaled(0.04).unwrap(), Config::paper());
        assert_eq!((short.single.steps, short.types.train.steps, short.articulate.steps), (400, 120, 800));
        assert_eq!((short.types.steps_for_many, short.articulate.assign.temperature_steps), (200, 400));
        let (a, b) = (&short.articulate, &paper.articulate);
        assert_eq!((a.chamfer_after, a.chamfer_before, a.centre_after), (40, 200, 120));
        assert_eq!((a.densify.after, a.densify.before, a.densify.every, a.densify.reset_every), (20, 600, 4, 120));
        assert_eq!(a.joint_rate.steps, 1600);
        assert!((a.joint_rate.from / b.joint_rate.from - 5.0).abs() < 1e-9);
        assert!((short.single.rates.sh_dc / paper.single.rates.sh_dc - 5.0).abs() < 1e-9);
        // One that is hard by its end stays so: the share of steps after the temperature has fallen is the same.
        let hard = |c: &crate::articulation::ArticulateConfig| {
            let first = (0..c.steps).find(|s| c.assign.is_hard(*s)).unwrap();
            first as f64 / c.steps as f64
        };
        assert!((hard(a) - hard(b)).abs() < 2e-3);
        for factor in [0.0, -1.0, 1.5, f64::NAN] {
            assert!(Config::paper_scaled(factor).unwrap_err().to_string().contains("schedule"));
        }
    }

    #[test]
    fn seeds_that_toml_cannot_hold_are_refused() {
        let error = Config { seed: u64::MAX, ..Config::default() }.check().unwrap_err().to_string();
        assert!(error.contains("seed = 18446744073709551615: must be a whole number from 0 to"), "{error}");
    }

    #[test]
    fn unknown_fields_and_bad_values_are_named() {
        let message = |text: &str| Config::default().overridden_by(text).unwrap_err().to_string();
        assert!(message("[discover]\nspacin = 1").contains("spacin"));
        assert!(message("parts = 1").contains("parts = 1: K counts"));
        assert!(message("parts = \"8..3\"").contains("parts = 8..3: "));
        assert!(message("parts = \"many\"").contains("`many`"));
        assert!(message("parts = -3").contains("`-3`"));
        assert!(message("parts = 2.5").contains("3..8"));
        assert!(message("[discover]\nspacing = -1.0").contains("[discover] spacing = "));
        assert!(message("seed = \"x\"").contains("seed"));
        assert!(message("[registration]\nrough_points = 0").contains("[registration] rough_points = "));
        assert!(message("[surface]\nresolution = 0.0").contains("[surface] resolution = "));
        assert!(message("method = \"magic\"").contains("magic"));
        assert!(message("[articulate.assign]\nkind = \"tree\"").contains("tree"));
        assert!(message("[canonical]\ncentres = \"best\"").contains("best"));
        assert!(message("[articulate.assign.slots]\nwidth = 0").contains("[articulate.assign.slots] width = 0: must"));
        let fine = "articulate.assign.grid = { levels = 24, growth = 4.0 }";
        assert!(message(fine).contains("[articulate.assign.grid] levels = 24: must be less"));
        assert!(message("[registration]\nreach = 2.0").contains("[registration] reach = "));
    }
}
