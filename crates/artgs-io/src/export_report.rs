//! `exports/export.json`: what an export was asked for and what it decided.

use crate::FileError;
use crate::run_folder::{RunFolder, load_json, save_json};
use artgs_core::JointKind;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};

/// What an export was asked for besides scale and upward axis, so that it can be repeated. None means the default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RequestedOptions {
    /// Name of the object in the files.
    pub name: Option<String>,
    /// Absolute path of the folder with the photos, if the user named one.
    pub capture: Option<PathBuf>,
    /// Kilograms per cubic metre.
    pub density: Option<f64>,
    /// What parts collide with: `hulls`, `coacd` or `none`.
    pub collision: Option<String>,
    /// Joints end at the observed states.
    pub observed_limits: bool,
    /// Triangles per link, about.
    pub triangles: Option<usize>,
}

/// What an export decided.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ExportReport {
    /// What was asked for.
    pub options: RequestedOptions,
    /// Metres per unit of the capture; 0 if unknown.
    pub scale: f64,
    /// Upward axis of the capture, `z` or `y`.
    pub up: String,
    /// One entry per link.
    pub links: Vec<LinkReport>,
    /// Deepest penetration of convex pieces before and after cutting, metres.
    pub penetration: [f64; 2],
    /// Convex pieces that cutting removed whole.
    pub lost_pieces: usize,
    /// Share of the volume of the convex pieces that was cut off.
    pub cut_share: f64,
    /// All files written.
    pub files: Vec<PathBuf>,
}

/// One link of an export.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LinkReport {
    /// Its name in every format.
    pub name: String,
    /// Kilograms.
    pub mass: f64,
    /// Number of convex pieces.
    pub hulls: usize,
    /// Triangles as drawn.
    pub triangles: usize,
    /// Triangles of the fused mesh before simplification.
    pub fused_triangles: usize,
    /// True if the surface is closed.
    pub watertight: bool,
    /// 99 of 100 points are within this distance of the fused surface, metres.
    pub surface_error: f64,
    /// Share of the texture that a photo shows; none without photos.
    #[serde(rename = "photographed")]
    pub textured_share: Option<f64>,
    /// State in which the part is closed, `start` or `end`.
    pub closed_state: Option<String>,
    /// Link that carries it; none for the base.
    pub parent: Option<String>,
    /// Type of its joint.
    pub joint: Option<JointKind>,
    /// Metres along the axis per radian; only of screws.
    pub pitch: Option<f64>,
    /// Formats written in which the screw is a hinge.
    pub hinge_in: Vec<String>,
    /// Lower and upper limit, radians or metres.
    pub limits: Option<[f64; 2]>,
    /// Values in the observed states, radians or metres.
    pub observed: Option<[f64; 2]>,
    /// Why the limits are where they are.
    pub stops: Option<[String; 2]>,
}

impl ExportReport {
    /// Writes it into a run's folder.
    pub fn save(&self, folder: &RunFolder) -> Result<(), FileError> {
        let path = folder.export_report();
        // By way of a value, whose keys are sorted.
        let value = serde_json::to_value(self).map_err(|e| FileError::malformed(&path, e.to_string()))?;
        save_json(&path, &value)
    }

    /// Reads it from a run's folder; none if nothing was exported.
    pub fn load(folder: &RunFolder) -> Result<Option<Self>, FileError> {
        load_json(&folder.export_report())
    }
}

impl fmt::Display for ExportReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:<16} {:>9} {:>6} {:>10} {:>7}  closed surface", "link", "kg", "hulls", "triangles", "photos")?;
        for link in &self.links {
            let photos = link.textured_share.map_or("-".into(), |p| format!("{:.0} %", 100.0 * p));
            let closed = if link.watertight { "yes" } else { "no" };
            let LinkReport { name, mass, hulls, triangles, .. } = link;
            writeln!(f, "{name:<16} {mass:>9.3} {hulls:>6} {triangles:>10} {photos:>7}  {closed}")?;
        }
        writeln!(f)?;
        for link in &self.links {
            let (Some([low, high]), Some([start, end]), Some(stops)) = (link.limits, link.observed, &link.stops) else {
                continue;
            };
            let zero = link.closed_state.as_ref().map_or("start".into(), |state| format!("closed ({state})"));
            writeln!(f, "{}: 0 = {zero}, observed {start:.3} to {end:.3}", link.name)?;
            writeln!(f, "  from {low:.3}, {}, to {high:.3}, {}", stops[0], stops[1])?;
        }
        let [before, after] = self.penetration.map(|p| 1000.0 * p);
        writeln!(
            f,
            "hulls overlapped by {before:.1} mm, now by {after:.2} mm; {:.1} % of them cut off",
            100.0 * self.cut_share
        )?;
        writeln!(f)?;
        self.files.iter().filter(|file| is_main(file)).try_for_each(|file| writeln!(f, "{}", file.display()))
    }
}

/// Files that a user opens: those directly in the folder of a format.
fn is_main(file: &Path) -> bool {
    file.parent().and_then(Path::parent).is_some_and(|p| p.ends_with(crate::run_folder::EXPORTS))
        && file.extension().is_some_and(|e| e != "json" && e != "txt" && e != "config" && e != "spz")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_is_read_back_and_unknown_fields_are_no_error() {
        let dir = tempfile::tempdir().unwrap();
        let folder = RunFolder::new(dir.path());
        assert_eq!(ExportReport::load(&folder).unwrap(), None);
        let link = LinkReport { name: "base".into(), mass: 0.1, watertight: true, ..LinkReport::default() };
        let report = ExportReport { scale: 0.5, up: "y".into(), links: vec![link], ..ExportReport::default() };
        report.save(&folder).unwrap();
        assert_eq!(ExportReport::load(&folder).unwrap(), Some(report));
        std::fs::write(folder.export_report(), r#"{"scale": 2.0, "later": 1}"#).unwrap();
        assert_eq!(ExportReport::load(&folder).unwrap().unwrap().scale, 2.0);
    }
}
