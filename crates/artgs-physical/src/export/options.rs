//! What to export and how.

use super::error::ExportError;
use super::run::upward;
use crate::{Collision, Front, PhysicalConfig, Up};
use artgs_core::Upward;
use artgs_io::asset::{Actuators, Format, Frames, Provenance, SpzVersion, WriteOptions};
use artgs_io::export_report::{ExportReport, RequestedOptions};
use artgs_io::{FileError, RunFolder};
use glam::DVec3;
use std::path::PathBuf;
use std::str::FromStr;

/// What parts collide with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CollisionSource {
    /// Convex pieces, cut so that parts do not overlap.
    #[default]
    Hulls,
    /// Convex pieces by the Python package `coacd`, cut likewise.
    Coacd,
    /// Nothing collides.
    None,
}

impl CollisionSource {
    /// Every value.
    pub const ALL: [Self; 3] = [Self::Hulls, Self::Coacd, Self::None];

    /// Name on the command line and in `export.json`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hulls => "hulls",
            Self::Coacd => "coacd",
            Self::None => "none",
        }
    }
}

impl FromStr for CollisionSource {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|source| source.name() == text);
        found.ok_or_else(|| format!("no collision is called `{text}`; there are hulls, coacd and none"))
    }
}

/// Front of the object in the frame of the capture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrontAxis {
    /// Where drawers come out and doors open to.
    #[default]
    Auto,
    /// Along this axis, 0 to 2 for X to Z, in the positive or negative direction.
    Axis(usize, bool),
    /// The frame of the capture stays as it is.
    Capture,
}

impl FrontAxis {
    /// Every value.
    pub const ALL: [Self; 8] = [
        Self::Auto,
        Self::Axis(0, true),
        Self::Axis(0, false),
        Self::Axis(1, true),
        Self::Axis(1, false),
        Self::Axis(2, true),
        Self::Axis(2, false),
        Self::Capture,
    ];

    /// Name on the command line and in `export.json`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Axis(0, true) => "x",
            Self::Axis(0, false) => "-x",
            Self::Axis(1, true) => "y",
            Self::Axis(1, false) => "-y",
            Self::Axis(_, true) => "z",
            Self::Axis(_, false) => "-z",
            Self::Capture => "capture",
        }
    }

    /// The front for an upward axis; none if it is that axis.
    fn in_upright_frame(self, up: Up) -> Option<Front> {
        match self {
            Self::Auto => Some(Front::Found),
            Self::Capture => Some(Front::Captured),
            Self::Axis(axis, positive) => {
                let direction = up.upright() * DVec3::AXES[axis.min(2)] * if positive { 1.0 } else { -1.0 };
                (direction.z.abs() < 0.5).then_some(Front::Towards(direction))
            }
        }
    }
}

impl FromStr for FrontAxis {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|front| front.name() == text);
        found.ok_or_else(|| format!("no front is called `{text}`; there are {}", Self::ALL.map(Self::name).join(", ")))
    }
}

/// What to export and how.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportOptions {
    /// Formats, in the order in which they are written.
    pub formats: Vec<Format>,
    /// Name of the object in the files.
    pub name: String,
    /// Folder of a capture of both states, in the world of the replica, whose images are baked into textures; none: the images that the
    /// run noted.
    pub capture: Option<PathBuf>,
    /// Metres per unit of the capture.
    pub scale: f64,
    /// Which way is up in the frame of the capture.
    pub up: Up,
    /// How that is known; none if it is not known how.
    pub up_known: Option<Upward>,
    /// Kilograms per cubic metre; none for the default of [`PhysicalConfig`].
    pub density: Option<f64>,
    /// The same for single links, by their names.
    pub densities: Vec<(String, f64)>,
    /// Kilograms of all links together; none for what follows from the densities.
    pub mass: Option<f64>,
    /// What parts collide with.
    pub collision: CollisionSource,
    /// Convex pieces per link at most; none for the default of [`PhysicalConfig`].
    pub hulls: Option<u32>,
    /// Joints end at the observed states.
    pub observed_limits: bool,
    /// Triangles per link, about, for drawing; none for the default of [`PhysicalConfig`].
    pub triangles: Option<usize>,
    /// Millimetres per texel; none for the resolution of the photos.
    pub texel: Option<f64>,
    /// Front of the object in the frame of the capture.
    pub front: FrontAxis,
    /// Links keep the names of the replica's parts instead of names by their classes.
    pub part_names: bool,
    /// What some formats write only if asked to.
    pub write: WriteOptions,
}

impl Default for ExportOptions {
    /// Every format that is built in.
    fn default() -> Self {
        Self {
            formats: Format::ALL.into_iter().filter(|format| format.is_available()).collect(),
            name: Self::NAME.into(),
            capture: None,
            scale: 1.0,
            up: Up::Z,
            up_known: None,
            density: None,
            densities: Vec::new(),
            mass: None,
            collision: CollisionSource::Hulls,
            hulls: None,
            observed_limits: false,
            triangles: None,
            texel: None,
            front: FrontAxis::Auto,
            part_names: false,
            write: WriteOptions::default(),
        }
    }
}

impl ExportOptions {
    /// Name of an exported object by default.
    pub const NAME: &str = "replica";

    /// Formats that the viewer shows.
    pub const SHOWN: [Format; 2] = [Format::Urdf, Format::Splats];

    /// The options of a first export of these formats: the replica upright if its reconstruction found out which way is up.
    pub fn first(folder: &RunFolder, formats: Vec<Format>) -> Self {
        let up_known = upward(folder, None).ok();
        let up = up_known.and_then(|up| Up::towards(up.direction)).unwrap_or_default();
        Self { formats, up, up_known, ..Self::default() }
    }

    /// The options of the last export into a folder, with the formats that are there and those that the viewer shows;
    /// default ones if nothing was exported.
    pub fn of_last_export(folder: &RunFolder) -> Result<Self, FileError> {
        let wanted = |format: &Format| Self::SHOWN.contains(format) || folder.has_export(*format);
        let formats = Self::default().formats.into_iter().filter(wanted).collect();
        let Some(report) = ExportReport::load(folder)? else { return Ok(Self::first(folder, formats)) };
        let up = last_upward(&report);
        let asked = report.options;
        let malformed = |reason: String| FileError::malformed(&folder.export_report(), reason);
        let front = asked.front.as_deref().map(FrontAxis::from_str).transpose().map_err(malformed)?;
        let RequestedOptions { name, capture, density, densities, mass, collision, hulls, .. } = asked;
        let actuators = Actuators::ALL.into_iter().find(|kind| asked.actuators.as_deref() == Some(kind.name()));
        let frames = Frames::ALL.into_iter().find(|kind| asked.frames.as_deref() == Some(kind.name()));
        let write = WriteOptions {
            actuators,
            free_base: asked.free_base,
            package: asked.package,
            frames: frames.unwrap_or_default(),
            spz: asked.spz.and_then(SpzVersion::of).unwrap_or_default(),
            provenance: Provenance {
                author: asked.author,
                license: asked.license,
                item: asked.item,
                ..Provenance::default()
            },
        };
        let defaults = Self::default();
        let collision =
            collision.map(|name| name.parse().map_err(|e| FileError::malformed(&folder.export_report(), e)));
        Ok(Self {
            formats,
            name: name.unwrap_or(defaults.name),
            capture: capture.filter(|folder| folder.is_dir()),
            scale: if report.scale > 0.0 { report.scale } else { defaults.scale },
            up: up.and_then(|up| Up::towards(up.direction)).or_else(|| report.up.parse().ok()).unwrap_or_default(),
            up_known: up,
            density,
            densities: densities.into_iter().collect(),
            mass,
            collision: collision.transpose()?.unwrap_or_default(),
            hulls,
            observed_limits: asked.observed_limits,
            triangles: asked.triangles,
            texel: asked.texel,
            front: front.unwrap_or_default(),
            part_names: asked.part_names,
            write,
        })
    }

    /// Refuses names that no file can have, and numbers out of range: scales from micrometres to kilometres, densities from foam to the
    /// heaviest metal, masses from a gram to a ship, and pieces with which engines are still fast.
    pub(super) fn check(&self) -> Result<(), ExportError> {
        let usable = |c: char| !c.is_control();
        let long = self.name.chars().count() > 100;
        if long || !self.name.chars().any(char::is_alphanumeric) || !self.name.chars().all(usable) {
            return Err(ExportError::Name(self.name.clone()));
        }
        let whole = |n: usize| n as f64;
        let densities = self.density.iter().chain(self.densities.iter().map(|(_, density)| density));
        let given = densities.map(|density| ("density", *density, 1.0..=25_000.0));
        let given = given.chain([("scale", self.scale, 1e-6..=1e3)]);
        let given = given.chain(self.mass.map(|mass| ("mass", mass, 1e-3..=1e6)));
        let given = given.chain(self.texel.map(|texel| ("texel", texel, 1e-2..=1e3)));
        let given = given.chain(self.triangles.map(|n| ("triangles", whole(n), 4.0..=1e8)));
        let mut given = given.chain(self.hulls.map(|n| ("hulls", f64::from(n), 1.0..=1000.0)));
        match given.find(|(_, value, range)| !range.contains(value)) {
            Some((name, value, range)) => {
                Err(ExportError::Setting { name, value, range: [*range.start(), *range.end()] })
            }
            None => Ok(()),
        }
    }

    /// The settings of what is built; an error for options that cannot be used.
    pub fn config(&self) -> Result<PhysicalConfig, ExportError> {
        let defaults = PhysicalConfig::default();
        let config = PhysicalConfig {
            scale: self.scale,
            density: self.density.unwrap_or(defaults.density),
            densities: self.densities.clone(),
            mass: self.mass,
            up: self.up,
            collision: if self.collision == CollisionSource::None { Collision::None } else { Collision::Hulls },
            most_hulls: self.hulls.unwrap_or(defaults.most_hulls),
            extend_limits: !self.observed_limits,
            triangles: self.triangles.unwrap_or(defaults.triangles),
            texel: self.texel.map(|millimetres| 1e-3 * millimetres),
            front: self.front.in_upright_frame(self.up).ok_or(ExportError::Front(self.front))?,
            part_names: self.part_names,
            ..defaults
        };
        self.check()?;
        Ok(config)
    }

    pub(super) fn requested(&self) -> RequestedOptions {
        RequestedOptions {
            name: Some(self.name.clone()),
            // Absolute, because the next export may start elsewhere.
            capture: self.capture.as_ref().and_then(|folder| std::fs::canonicalize(folder).ok()),
            density: self.density,
            densities: self.densities.iter().cloned().collect(),
            mass: self.mass,
            collision: Some(self.collision.name().into()),
            hulls: self.hulls,
            observed_limits: self.observed_limits,
            triangles: self.triangles,
            texel: self.texel,
            front: (self.front != FrontAxis::Auto).then(|| self.front.name().into()),
            part_names: self.part_names,
            free_base: self.write.free_base,
            actuators: self.write.actuators.map(|kind| kind.name().into()),
            package: self.write.package.clone(),
            frames: (self.write.frames != Frames::All).then(|| self.write.frames.name().into()),
            spz: (self.write.spz != SpzVersion::default()).then(|| self.write.spz.number()),
            author: self.write.provenance.author.clone(),
            license: self.write.provenance.license.clone(),
            item: self.write.provenance.item.clone(),
        }
    }
}

/// What the last export took for up; none if its report does not say how that was known.
fn last_upward(report: &ExportReport) -> Option<Upward> {
    let direction = report.up.parse::<Up>().ok()?.direction();
    Some(Upward { direction, source: report.up_source?, confidence: report.up_confidence.unwrap_or(1.0) })
}
