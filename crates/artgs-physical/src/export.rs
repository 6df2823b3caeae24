//! From a run's folder to exported files: reads the replica, builds the asset, writes every format and `export.json`.

use crate::build::{BuiltAsset, Parts, build};
use crate::coacd;
use crate::portrait::portrait;
use crate::stance::{Range, Stop};
use crate::{Collision, Front, GivenClass, PhysicalConfig, Up};
use artgs_core::{Capture, JointInterval, JointKind, Mesh, Replica, State, UpSource, Upward, odd_size};
use artgs_io::asset::{Actuators, Format, Frames, Provenance, SpzVersion, WriteOptions, check_asset};
use artgs_io::export_report::{ExportReport, HandleReport, LinkReport, RequestedOptions};
use artgs_io::replica::ReplicaFileError;
use artgs_io::run_folder::load_text;
use artgs_io::{Corrections, FileError, RunFolder, read_corrections};
use glam::DVec3;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::{SystemTime, UNIX_EPOCH};

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
    /// Folder with the photos if the user named one; only written into the report.
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

    /// Refuses numbers that are not positive and finite.
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
        let densities = config.densities.iter().map(|(_, density)| ("density", *density));
        let given = [("scale", config.scale), ("density", config.density)].into_iter().chain(densities);
        let given = given.chain(config.mass.map(|mass| ("mass", mass)));
        for (name, value) in given.chain(self.texel.map(|texel| ("texel", texel))) {
            if !(value > 0.0 && value.is_finite()) {
                return Err(ExportError::Setting { name, value });
            }
        }
        Ok(config)
    }

    fn requested(&self) -> RequestedOptions {
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

/// Why nothing, or not everything, was exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A setting out of range.
    #[error("`{name}` is {value}; give a number above 0")]
    Setting {
        /// Field of [`ExportOptions`].
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A front that is the upward or downward axis.
    #[error("the front {} is the upward axis of the capture or opposite to it; give a horizontal direction", .0.name())]
    Front(FrontAxis),
    /// Nothing says which way is up.
    #[error(
        "which way is up is not known: the recording does not state it, and no floor or walls say it; give --up with an axis of \
         the capture (x, -x, y, -y, z or -z) or a direction such as 0.1,0,0.99"
    )]
    UnknownUp,
    /// A format whose writer is not built in.
    #[error("format {0} is not built into this program")]
    NotBuiltIn(Format),
    /// The replica cannot be read.
    #[error(transparent)]
    Replica(#[from] ReplicaFileError),
    /// A mesh or Gaussians of the replica cannot be read.
    #[error(transparent)]
    Input(FileError),
    /// No asset can be built from it.
    #[error("{0}")]
    Build(String),
    /// The built asset is not valid.
    #[error("{}: {reason}", path.display())]
    Asset {
        /// The `replica.json`.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A file could not be written.
    #[error(transparent)]
    Output(FileError),
}

impl ExportError {
    /// True if the user has to change the replica, the options or the build.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, Self::Output(_))
    }
}

/// What happens during an export.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportEvent<'a> {
    /// A surface that is not as it should be, in one sentence.
    Warning(&'a str),
    /// The next step begins.
    Begins(ExportStep),
    /// So many formats of all are written.
    Written(usize, usize),
}

/// A step of an export.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportStep {
    /// Closed and textured meshes.
    Surfaces,
    /// Masses and joint limits.
    Limits,
    /// Convex pieces.
    Hulls,
    /// Files.
    Write,
}

impl ExportStep {
    /// Name for people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Surfaces => "surfaces",
            Self::Limits => "limits",
            Self::Hulls => "hulls",
            Self::Write => "write",
        }
    }
}

/// Which way is up in the world of a run's replica: as given, or as its reconstruction found out. An error where neither is
/// certain.
pub fn upward(folder: &RunFolder, given: Option<Up>) -> Result<Upward, ExportError> {
    if let Some(up) = given {
        return Ok(Upward { direction: up.direction(), source: UpSource::Option, confidence: 1.0 });
    }
    let replica = artgs_io::read_replica(folder.root())?;
    match replica.up {
        Some(up) if up.is_certain() => Ok(up),
        Some(_) => Err(ExportError::UnknownUp),
        None => Ok(Upward { direction: DVec3::Z, source: UpSource::Assumed, confidence: Upward::CERTAIN }),
    }
}

/// What the last export took for up; none if its report does not say how that was known.
fn last_upward(report: &ExportReport) -> Option<Upward> {
    let direction = report.up.parse::<Up>().ok()?.direction();
    Some(Upward { direction, source: report.up_source?, confidence: report.up_confidence.unwrap_or(1.0) })
}

/// Exports the replica in a folder into its folder `exports`. Textures are baked from the training views of `capture`,
/// without it they hold the colours of the meshes. `watch` gets what happens meanwhile.
pub fn export(
    folder: &RunFolder,
    options: &ExportOptions,
    capture: Option<&Capture>,
    mut watch: impl FnMut(ExportEvent<'_>),
) -> Result<ExportReport, ExportError> {
    let mut config = options.config()?;
    if let Some(format) = options.formats.iter().find(|format| !format.is_available()) {
        return Err(ExportError::NotBuiltIn(*format));
    }
    let replica = artgs_io::read_replica(folder.root())?;
    config.classes = given_classes(folder, replica.parts.len())?;
    let meshes = folder.load_meshes(&replica, State::START).map_err(ExportError::Input)?;
    let splats = folder.load_part_splats(replica.parts.len()).map_err(ExportError::Input)?;
    let parts = Parts { replica: &replica, meshes: &meshes, splats: splats.as_deref() };
    let by_coacd = |mesh: &Mesh| coacd::decompose(mesh);
    let decomposer =
        (options.collision == CollisionSource::Coacd).then_some(&by_coacd as &crate::decompose::Decomposer);
    let mut begins = |step| watch(ExportEvent::Begins(step));
    let built = build(&options.name, &parts, capture, &config, decomposer, &mut begins).map_err(ExportError::Build)?;
    let warnings = built.surfaces.iter().flat_map(|surface| &surface.warnings);
    for warning in odd_size(built.asset.bounds_diagonal()).iter().chain(warnings) {
        watch(ExportEvent::Warning(warning));
    }
    check_asset(&built.asset).map_err(|reason| ExportError::Asset { path: folder.replica(), reason })?;
    let again = formats_of_other_options(folder, options);
    if !again.is_empty() {
        let names = again.iter().map(|format| format.name()).collect::<Vec<_>>().join(", ");
        watch(ExportEvent::Warning(&format!("exported earlier with other options, so written again: {names}")));
    }
    let options = &ExportOptions { formats: [options.formats.clone(), again].concat(), ..options.clone() };
    watch(ExportEvent::Begins(ExportStep::Write));
    let write = write_options(folder, options, &built);
    let mut files = Vec::new();
    for (i, format) in options.formats.iter().enumerate() {
        files.extend(format.replace_with(&folder.exports(), &built.asset, &write).map_err(ExportError::Output)?);
        watch(ExportEvent::Written(i + 1, options.formats.len()));
    }
    let decided = report(&built, &replica, options);
    let mut report = ExportReport { options: options.requested(), files, density: config.density, ..decided };
    report.record_digests(folder, &options.formats).map_err(ExportError::Output)?;
    report.save(folder).map_err(ExportError::Output)?;
    Ok(report)
}

/// What formats are asked for, with what this export knows of the provenance.
fn write_options(folder: &RunFolder, options: &ExportOptions, built: &BuiltAsset) -> WriteOptions {
    if !options.formats.contains(&Format::Simready) {
        return options.write.clone();
    }
    let source = folder.replica().file_name().map(|name| name.to_string_lossy().into_owned());
    let (date, picture) = (Some(today()), portrait(&built.asset));
    WriteOptions {
        provenance: Provenance { source, date, picture, ..options.write.provenance.clone() },
        ..options.write.clone()
    }
}

/// The day of `SOURCE_DATE_EPOCH`, as reproducible builds set it, or of the clock, `YYYY-MM-DD` in UTC.
fn today() -> String {
    let given = std::env::var("SOURCE_DATE_EPOCH").ok().and_then(|text| text.parse::<u64>().ok());
    let clock = || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
    day(given.unwrap_or_else(clock))
}

/// The day of a time in seconds since 1970, UTC.
fn day(seconds: u64) -> String {
    /// Days of four hundred years, after which the calendar repeats, and days from March of the year 0 to 1970.
    const ERA: u64 = 146_097;
    const TO_1970: u64 = 719_468;
    let days = seconds / 86_400 + TO_1970;
    let (era, of_era) = (days / ERA, days % ERA);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    // Months from March on have 31, 30, 31, 30, 31 days in turn.
    let from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
    format!("{:04}-{month:02}-{day:02}", 400 * era + year_of_era + u64::from(month < 3))
}

/// Formats in the folder that are not written now and were exported with other options: exports of one folder agree.
fn formats_of_other_options(folder: &RunFolder, options: &ExportOptions) -> Vec<Format> {
    // A report that cannot be read says nothing about options.
    let Some(last) = ExportReport::load(folder).ok().flatten() else { return Vec::new() };
    let same = last.options == options.requested() && last.scale == options.scale && last.up == options.up.to_string();
    let left = |format: &Format| !same && !options.formats.contains(format) && folder.has_export(*format);
    Format::ALL.into_iter().filter(|format| format.is_available() && left(format)).collect()
}

/// Classes in `corrections.json`, by the parts of the replica. The file counts parts as they were found.
fn given_classes(folder: &RunFolder, parts: usize) -> Result<Vec<GivenClass>, ExportError> {
    let wanted = read_corrections(folder.root()).map_err(ExportError::Input)?.unwrap_or_default().classes;
    let applied = load_text(&folder.replica_corrections()).map_err(ExportError::Input)?;
    let applied = applied.and_then(|text| Corrections::parse(text.as_bytes()).ok()).unwrap_or_default();
    let mut out = Vec::new();
    for (i, mark) in wanted.iter().enumerate() {
        match applied.number_after(mark.part) {
            Some(part) if part < parts => out.push(GivenClass { part, class: mark.class }),
            Some(part) => {
                let reason =
                    format!("field `classes[{i}]`: there is no part {part}, the largest number is {}", parts - 1);
                return Err(ExportError::Input(FileError::malformed(&folder.corrections(), reason)));
            }
            // The part was removed after its class was given.
            None => {}
        }
    }
    Ok(out)
}

/// What was decided about an asset.
fn report(built: &BuiltAsset, replica: &Replica, asked: &ExportOptions) -> ExportReport {
    let BuiltAsset { asset, decisions, .. } = built;
    let [before, after] = decisions.clearance.volume;
    ExportReport {
        options: RequestedOptions::default(),
        scale: decisions.scale,
        up: asked.up.to_string(),
        up_source: asked.up_known.map(|up| up.source),
        up_confidence: asked.up_known.map(|up| up.confidence),
        frame: Some(decisions.object),
        links: (0..asset.links.len()).map(|i| link_report(built, replica, i, &asked.formats)).collect(),
        penetration: [decisions.clearance.deepest, decisions.penetration],
        lost_pieces: decisions.clearance.lost,
        cut_share: if before > 0.0 { 1.0 - after / before } else { 0.0 },
        ..ExportReport::default()
    }
}

/// The interval of the joint of part `i` in metres.
fn scaled(interval: &JointInterval, replica: &Replica, i: usize, scale: f64) -> JointInterval {
    let slides = replica.joint(i).is_some_and(|joint| joint.kind == JointKind::Prismatic);
    let motion = if slides { scale * interval.motion } else { interval.motion };
    JointInterval { position: interval.position.map(|p| scale * p), motion, ..*interval }
}

fn link_report(built: &BuiltAsset, replica: &Replica, i: usize, formats: &[Format]) -> LinkReport {
    let (link, surface, decisions) = (&built.asset.links[i], &built.surfaces[i], &built.decisions);
    let is_screw = link.joint.is_some_and(|j| j.kind == JointKind::Screw);
    let hinge_in = formats.iter().filter(|format| is_screw && !format.has_screws());
    let [texels, seen] = surface.texels;
    let range: Option<&Range> = decisions.ranges[i].as_ref();
    LinkReport {
        name: link.name.clone(),
        part: Some(replica.parts[i].name.clone()),
        class: link.semantics.map(|s| s.class),
        class_confidence: link.semantics.map(|s| s.confidence),
        class_given: link.semantics.is_some_and(|s| s.given),
        hinge: link.semantics.and_then(|s| s.hinge),
        handles: link.handles.iter().map(HandleReport::from).collect(),
        mass: link.inertial.mass,
        hulls: link.collision.len(),
        lost_pieces: decisions.lost.get(i).copied().unwrap_or(0),
        triangles: link.visual.mesh.triangles.len(),
        fused_triangles: surface.fused,
        watertight: surface.closed,
        surface_error: surface.error.most * decisions.scale,
        evidence: surface.evidence,
        textured_share: (seen > 0).then(|| seen as f64 / texels as f64),
        zero_state: decisions.nearer_state[i].map(|state| state.name().into()),
        closed_state: range
            .filter(|range| range.closed)
            .and(decisions.nearer_state[i])
            .map(|state| state.name().into()),
        parent: link.parent.map(|p| built.asset.links[p].name.clone()),
        joint: link.joint.map(|j| j.kind),
        pitch: link.joint.filter(|_| is_screw).map(|j| j.pitch),
        hinge_in: hinge_in.map(|format| format.name().into()).collect(),
        interval: link
            .joint
            .and(replica.parts[i].interval)
            .map(|interval| scaled(&interval, replica, i, decisions.scale)),
        limits: link.joint.map(|j| j.limits),
        observed: link.joint.map(|j| State::ALL.map(|state| j.observed[state])),
        sources: range.map(|range| range.sources.map(|source| source.name().into())),
        stops: range.map(|range| range.stops.each_ref().map(reason)),
        effort: link.joint.map(|j| j.effort),
        velocity: link.joint.map(|j| j.velocity),
        damping: link.joint.map(|j| j.damping),
        friction: link.joint.map(|j| j.friction),
    }
}

fn reason(stop: &Stop) -> String {
    match stop {
        Stop::Observed => "as observed".into(),
        Stop::Contact(link) => format!("before it meets {link}"),
        Stop::Flush(link) => format!("where it is flush with {link}"),
        Stop::Support => "where a quarter of its length is still supported".into(),
        Stop::Reach => "the largest range that is assumed".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::day;

    #[test]
    fn days_of_known_times() {
        let known = [
            (0, "1970-01-01"),
            (951_782_400, "2000-02-29"),
            (1_709_251_199, "2024-02-29"),
            (4_107_542_400, "2100-03-01"),
        ];
        for (seconds, wanted) in known {
            assert_eq!(day(seconds), wanted);
        }
    }
}
