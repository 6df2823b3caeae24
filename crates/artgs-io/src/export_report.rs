//! `exports/export.json`: what an export was asked for and what it decided.

use crate::asset::Format;
use crate::run_folder::{RunFolder, load_json, save_json};
use crate::shared_files::store_once;
use crate::{FileDigest, FileError};
use artgs_core::{Handle, HingeSide, JointInterval, JointKind, PartClass, Rigid, UpSource};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Component, Path, PathBuf};

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
    /// The same for single links.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub densities: BTreeMap<String, f64>,
    /// Kilograms of all links together.
    pub mass: Option<f64>,
    /// What parts collide with: `hulls`, `coacd` or `none`.
    pub collision: Option<String>,
    /// Convex pieces per link at most.
    pub hulls: Option<u32>,
    /// Joints end at the observed states.
    pub observed_limits: bool,
    /// Triangles per link, about.
    pub triangles: Option<usize>,
    /// Millimetres per texel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub texel: Option<f64>,
    /// Front in the frame of the capture, as on the command line.
    pub front: Option<String>,
    /// Links keep the names of the replica's parts.
    pub part_names: bool,
    /// The base is not fixed to the world.
    pub free_base: bool,
    /// Actuators of the MJCF: `motor` or `position`.
    pub actuators: Option<String>,
    /// ROS package that the mesh paths of the URDF begin with.
    pub package: Option<String>,
    /// Frames without a body: `none` if they are left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<String>,
    /// Version of the SPZ files.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spz: Option<u32>,
    /// Who made the object.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub author: Option<String>,
    /// Terms of use.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub license: Option<String>,
    /// Wikidata item of the kind of object.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub item: Option<String>,
}

/// What an export decided.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ExportReport {
    /// What was asked for.
    pub options: RequestedOptions,
    /// Metres per unit of the capture; 0 if unknown.
    pub scale: f64,
    /// Kilograms per cubic metre of links without a density of their own.
    pub density: f64,
    /// Which way is up in the frame of the capture: an axis such as `z` or `-x`, or three numbers separated by commas.
    pub up: String,
    /// How that is known; none in reports of versions that did not say it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up_source: Option<UpSource>,
    /// Certainty of that direction, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up_confidence: Option<f64>,
    /// Motion from the scaled frame of the capture to the object's frame of the export; none in reports of versions that
    /// only turned the upward axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<Rigid>,
    /// One entry per link.
    pub links: Vec<LinkReport>,
    /// Deepest penetration of convex pieces before and after cutting, metres.
    pub penetration: [f64; 2],
    /// Convex pieces that cutting removed whole.
    pub lost_pieces: usize,
    /// Share of the volume of the convex pieces that was cut off.
    pub cut_share: f64,
    /// Sides of the static part that were not recorded, so that most of what closes them is invented: of `back`, `left`, `right` (as seen from the
    /// front) and `top`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unrecorded_sides: Vec<String>,
    /// All files written.
    pub files: Vec<PathBuf>,
    /// Size and hash of every file of every format in the folder of exports, by its path relative to that folder, with `/`.
    /// Empty in reports of versions before there were digests.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub digests: BTreeMap<String, FileDigest>,
    /// Bytes that files of the same content in several formats would need in addition: they are stored once, as hard links.
    pub shared_bytes: u64,
    /// Hash of the replica that was exported; none in reports of versions before there were digests.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub replica: Option<String>,
}

/// Shares of the area of a surface, 0 to 1, together 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Of the fused surface, and not only shown by derived depth.
    pub seen: f64,
    /// Depth was derived from photos and from surfaces that continue there.
    pub derived: f64,
    /// Nothing was recorded: it closes the surface.
    pub invented: f64,
}

/// One link of an export.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LinkReport {
    /// Its name in every format.
    pub name: String,
    /// Name of the part in `replica.json`; none in reports of versions in which links had these names.
    pub part: Option<String>,
    /// What it is.
    pub class: Option<PartClass>,
    /// Confidence of the class, 0 to 1.
    pub class_confidence: Option<f64>,
    /// True if a person gave the class.
    pub class_given: bool,
    /// Edge of the hinge seen from the front; only of doors and flaps.
    pub hinge: Option<HingeSide>,
    /// Where a gripper holds it.
    pub handles: Vec<HandleReport>,
    /// Kilograms.
    pub mass: f64,
    /// Number of convex pieces.
    pub hulls: usize,
    /// Places of the surface that are left without a hull.
    pub lost_pieces: usize,
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
    /// What its surface rests on; none without a surface or without a capture with depth.
    pub evidence: Option<Evidence>,
    /// State in which the part is closed, `start` or `end`: there it meets another part, or nearly so, where it closes further.
    pub closed_state: Option<String>,
    /// State that is nearer to being closed, at joint value 0; none if that is unknown, then 0 is the start state.
    pub zero_state: Option<String>,
    /// Link that carries it; none for the base.
    pub parent: Option<String>,
    /// Type of its joint.
    pub joint: Option<JointKind>,
    /// Metres along the axis per radian; only of screws.
    pub pitch: Option<f64>,
    /// Formats written in which the screw is a hinge.
    pub hinge_in: Vec<String>,
    /// How far the joint may be off if its type is right: half widths of 95 % intervals, of the axis in degrees, of its place in metres, of
    /// the motion between the states in radians or metres; none if unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval: Option<JointInterval>,
    /// Lower and upper limit, radians or metres.
    pub limits: Option<[f64; 2]>,
    /// Values in the observed states, radians or metres.
    pub observed: Option<[f64; 2]>,
    /// What each limit rests on: `observed`, `contact` of surfaces that were seen, `inferred` (a contact that closes a part that no
    /// state shows closed, or the visible length of a part that slides) or `assumed`.
    pub sources: Option<[String; 2]>,
    /// Why the limits are where they are.
    pub stops: Option<[String; 2]>,
    /// Largest force of an actuator at the joint, newtons, or torque, newton metres; assumed, as all that follows.
    pub effort: Option<f64>,
    /// Largest speed, metres or radians per second.
    pub velocity: Option<f64>,
    /// Newton seconds per metre, or newton metre seconds per radian.
    pub damping: Option<f64>,
    /// Dry friction, newtons or newton metres.
    pub friction: Option<f64>,
}

/// A handle of a link; lengths in metres.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct HandleReport {
    /// Its name in every format.
    pub name: String,
    /// Origin of the grasp frame, link frame.
    pub position: [f64; 3],
    /// Orientation of the grasp frame in the link frame, x y z w: Z is the direction of approach, fingers close along Y.
    pub orientation: [f64; 4],
    /// Direction of approach, link frame.
    pub approach: [f64; 3],
    /// Direction in which the fingers close, link frame.
    pub closing: [f64; 3],
    /// Opening that the handle needs.
    pub width: f64,
    /// Extent of the handle across opening and approach.
    pub length: f64,
    /// How far the handle stands out.
    pub depth: f64,
}

impl From<&Handle> for HandleReport {
    fn from(handle: &Handle) -> Self {
        let Handle { name, frame, width, length, depth } = handle.clone();
        Self {
            name,
            position: frame.translation.to_array(),
            orientation: frame.rotation.to_array(),
            approach: frame.turn(DVec3::Z).to_array(),
            closing: frame.turn(DVec3::Y).to_array(),
            width,
            length,
            depth,
        }
    }
}

impl ExportReport {
    /// Name of the part of the replica that a link shows.
    pub fn part_of(&self, link: &str) -> Option<&str> {
        let found = self.links.iter().find(|l| l.name == link)?;
        Some(found.part.as_deref().unwrap_or(&found.name))
    }

    /// Writes it into a run's folder.
    pub fn save(&self, folder: &RunFolder) -> Result<(), FileError> {
        let path = folder.export_report();
        // By way of a value, whose keys are sorted.
        let value = serde_json::to_value(self).map_err(|e| FileError::malformed(&path, e.to_string()))?;
        save_json(&path, &value)
    }

    /// Records digests of the written files and of the replica. Those of formats that were exported earlier, and not written
    /// again now, are kept.
    pub fn record_digests(&mut self, folder: &RunFolder, formats: &[Format]) -> Result<(), FileError> {
        let exports = folder.exports();
        // A report that cannot be read is replaced.
        self.digests = Self::load(folder).ok().flatten().unwrap_or_default().digests;
        let is_kept = |format: &Format| !formats.contains(format) && folder.has_export(*format);
        self.digests.retain(|name, _| Format::ALL.iter().filter(|f| is_kept(f)).any(|f| is_of(name, *f)));
        for file in &self.files {
            let Ok(inside) = file.strip_prefix(&exports) else { continue };
            let words: Vec<_> = inside.iter().map(|word| word.to_string_lossy()).collect();
            self.digests.insert(words.join("/"), FileDigest::of(file)?);
        }
        self.shared_bytes = store_once(self.written(&exports));
        self.replica = folder.replica_digest()?;
        Ok(())
    }

    /// The files written by this export into a folder of exports, with their digests, in the order of their names.
    fn written<'a>(&'a self, exports: &'a Path) -> impl Iterator<Item = (PathBuf, &'a FileDigest)> {
        let files: BTreeSet<&PathBuf> = self.files.iter().collect();
        let all = self.digests.iter().map(|(name, digest)| (exports.join(name), digest));
        all.filter(move |(path, _)| files.contains(path))
    }

    /// Bytes of all files of every format in the folder of exports.
    pub fn sizes(&self) -> Vec<(Format, u64)> {
        let size = |format: Format| {
            let own = self.digests.iter().filter(|(name, _)| is_of(name, format));
            own.map(|(_, digest)| digest.bytes).sum()
        };
        Format::ALL.into_iter().map(|format| (format, size(format))).filter(|(_, bytes)| *bytes > 0).collect()
    }

    /// What differs from what was written, one sentence per file; none if the report has no digests.
    pub fn altered(&self, folder: &RunFolder) -> Option<Vec<String>> {
        if self.digests.is_empty() {
            return None;
        }
        let problem = |(name, written): (&String, &FileDigest)| {
            let inside = Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
            let path = folder.exports().join(name);
            let what = match FileDigest::of(&path) {
                _ if !inside => "is not a path inside the folder".into(),
                Ok(found) if found == *written => return None,
                Ok(found) if found.bytes != written.bytes => {
                    format!("was altered: {} bytes, {} were written", found.bytes, written.bytes)
                }
                Ok(_) => "was altered after it was written".into(),
                Err(_) if !path.exists() => "is missing".into(),
                Err(error) => error.to_string(),
            };
            Some(format!("{name} {what}; export again"))
        };
        Some(self.digests.iter().filter_map(problem).collect())
    }

    /// Reads it from a run's folder; none if nothing was exported.
    pub fn load(folder: &RunFolder) -> Result<Option<Self>, FileError> {
        load_json(&folder.export_report())
    }
}

fn is_of(name: &str, format: Format) -> bool {
    name.strip_prefix(format.name()).is_some_and(|rest| rest.starts_with('/'))
}

/// Sides with articles, none if there are none.
fn sides_in_words(sides: &[String]) -> Option<String> {
    let named: Vec<String> = sides
        .iter()
        .map(|side| match side.as_str() {
            "left" | "right" => format!("the {side} side"),
            other => format!("the {other}"),
        })
        .collect();
    match named.split_last()? {
        (last, []) => Some(last.clone()),
        (last, others) => Some(format!("{} and {last}", others.join(", "))),
    }
}

impl fmt::Display for ExportReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<16} {:<9} {:<18} {:>9} {:>6} {:>10} {:>6} {:>8} {:>9}  closed",
            "link", "part", "class", "kg", "hulls", "triangles", "seen", "derived", "invented"
        )?;
        for link in &self.links {
            let share = |pick: fn(Evidence) -> f64| {
                link.evidence.map_or("-".into(), |evidence| format!("{:.0} %", 100.0 * pick(evidence)))
            };
            let [seen, derived, invented] = [share(|e| e.seen), share(|e| e.derived), share(|e| e.invented)];
            let closed = if link.watertight { "yes" } else { "no" };
            let LinkReport { name, mass, hulls, triangles, .. } = link;
            let part = link.part.as_deref().unwrap_or("-");
            let class = class_of(link);
            writeln!(
                f,
                "{name:<16} {part:<9} {class:<18} {mass:>9.3} {hulls:>6} {triangles:>10} {seen:>6} {derived:>8} {invented:>9}  \
                 {closed}"
            )?;
        }
        self.joints(f)?;
        for handle in self.links.iter().flat_map(|link| &link.handles) {
            let HandleReport { name, width, length, depth, .. } = handle;
            let [width, length, depth] = [width, length, depth].map(|x| 1000.0 * x);
            writeln!(f, "{name}: {width:.0} mm between the fingers, {length:.0} mm long, {depth:.0} mm deep")?;
        }
        if let Some(sides) = sides_in_words(&self.unrecorded_sides) {
            writeln!(
                f,
                "not recorded: {sides}; the surface there is missing or invented. To have it measured, record it in either state"
            )?;
        }
        writeln!(f, "size: 1 unit of the capture is taken as {} m; --scale gives another length", self.scale)?;
        if let (Some(source), Some(confidence)) = (self.up_source, self.up_confidence) {
            writeln!(f, "up: {} of the capture, {}, certainty {confidence:.2}", self.up, source.words())?;
        }
        let [before, after] = self.penetration.map(|p| 1000.0 * p);
        writeln!(
            f,
            "hulls overlapped by {before:.1} mm, now by {after:.2} mm; {:.1} % of them cut off",
            100.0 * self.cut_share
        )?;
        writeln!(f)?;
        self.files.iter().filter(|file| is_main(file)).try_for_each(|file| writeln!(f, "{}", file.display()))?;
        if let Some(scene) = self.files.iter().find(|file| file.ends_with("mjcf/scene.xml")) {
            writeln!(f, "python -m mujoco.viewer --mjcf={} shows it on a floor", scene.display())?;
        }
        let sizes = self.sizes();
        if sizes.is_empty() {
            return Ok(());
        }
        let all: u64 = sizes.iter().map(|(_, bytes)| bytes).sum();
        let each: Vec<String> = sizes.iter().map(|(format, bytes)| format!("{format} {}", megabytes(*bytes))).collect();
        writeln!(f)?;
        write!(f, "{}; together {}", each.join(", "), megabytes(all))?;
        match self.shared_bytes {
            0 => writeln!(f),
            shared => writeln!(f, ", of which {} are shared between formats", megabytes(shared)),
        }
    }
}

impl ExportReport {
    /// A table of the joints: both limits with their reasons, and the values in the observed states.
    fn joints(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows: Vec<[String; 6]> = self.links.iter().filter_map(joint_row).collect();
        if rows.is_empty() {
            return writeln!(f);
        }
        let head = ["joint", "closed", "seen", "open", "closes until", "opens until"].map(str::to_owned);
        let width =
            |column: usize| rows.iter().chain([&head]).map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: [usize; 6] = std::array::from_fn(width);
        writeln!(f)?;
        for row in std::iter::once(&head).chain(&rows) {
            let cells: Vec<String> = row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
            writeln!(f, "{}", cells.join("  ").trim_end())?;
        }
        writeln!(f)
    }
}

/// Name, closing limit, observed values, opening limit and the reasons of both limits; none without a joint.
fn joint_row(link: &LinkReport) -> Option<[String; 6]> {
    let (limits, observed, [closes, opens]) = (link.limits?, link.observed?, link.stops.clone()?);
    let (factor, unit) = match link.joint {
        Some(JointKind::Prismatic) => (1000.0, "mm"),
        _ => (1f64.to_degrees(), "deg"),
    };
    let [low, high, start, end] = [limits[0], limits[1], observed[0], observed[1]].map(|x| rounded(factor * x));
    let closes = match (&link.closed_state, &link.zero_state) {
        (Some(state), _) => format!("{closes}, seen closed at the {state} (0)"),
        (None, Some(state)) => format!("{closes}; 0 is the {state}"),
        (None, None) => closes,
    };
    let seen = format!("{start} to {end} {unit}");
    Some([link.name.clone(), format!("{low} {unit}"), seen, format!("{high} {unit}"), closes, opens])
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

/// With one digit, without a negative zero.
fn rounded(value: f64) -> String {
    format!("{:.1}", if value.abs() < 0.05 { 0.0 } else { value })
}

/// Class and confidence in percent.
fn class_of(link: &LinkReport) -> String {
    let name = link.class.map_or("-", PartClass::name);
    match link.class_confidence {
        _ if link.class_given => format!("{name} (given)"),
        Some(confidence) if link.parent.is_some() => format!("{name} ({:.0} %)", 100.0 * confidence),
        _ => name.into(),
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

    #[test]
    fn names_of_classes_are_those_of_files_and_links_know_their_parts() {
        for class in PartClass::ALL {
            assert_eq!(serde_json::to_value(class).unwrap(), class.name());
        }
        for side in [HingeSide::Left, HingeSide::Right, HingeSide::Bottom, HingeSide::Top] {
            assert_eq!(serde_json::to_value(side).unwrap(), side.name());
        }
        let named = |name: &str, part: Option<&str>| {
            let class = Some(PartClass::Door);
            LinkReport { name: name.into(), part: part.map(Into::into), class, ..LinkReport::default() }
        };
        let links = vec![named("door", Some("part_2")), named("part_1", None)];
        let report = ExportReport { links, ..ExportReport::default() };
        assert_eq!([report.part_of("door"), report.part_of("part_1")], [Some("part_2"), Some("part_1")]);
        assert_eq!(report.part_of("lid"), None);
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["links"][0]["class"], "door");
    }

    #[test]
    fn the_summary_has_the_sizes_of_formats_and_what_they_share() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::new(root.path());
        let names = ["urdf/meshes/base.obj", "sdf/meshes/base.obj", "glb/replica.glb"];
        let files: Vec<PathBuf> = names.iter().map(|name| folder.exports().join(name)).collect();
        for (file, byte) in files.iter().zip([b'a', b'a', b'b']) {
            crate::write_atomic(file, &[byte; 1_500_000]).unwrap();
        }
        let mut report = ExportReport { files, ..ExportReport::default() };
        assert!(!report.to_string().contains("MB"));
        report.record_digests(&folder, &[Format::Urdf, Format::Sdf, Format::Glb]).unwrap();
        let text = report.to_string();
        let expected =
            "urdf 1.5 MB, glb 1.5 MB, sdf 1.5 MB; together 4.5 MB, of which 1.5 MB are shared between formats\n";
        assert!(text.ends_with(expected), "{text}");
    }

    #[test]
    fn the_table_of_links_says_what_surfaces_rest_on() {
        let evidence = Some(Evidence { seen: 0.5, derived: 0.125, invented: 0.375 });
        let base = LinkReport { name: "base".into(), evidence, watertight: true, ..LinkReport::default() };
        let links = vec![base, LinkReport { name: "empty".into(), ..LinkReport::default() }];
        let text = ExportReport { links, ..ExportReport::default() }.to_string();
        let row = |name: &str| {
            text.lines().find(|l| l.starts_with(name)).unwrap().split_whitespace().collect::<Vec<_>>().join(" ")
        };
        assert!(row("base").ends_with("50 % 12 % 38 % yes"), "{text}");
        assert!(row("empty").ends_with("- - - no"), "{text}");
    }

    #[test]
    fn sides_that_were_not_recorded_are_named() {
        let text = |sides: &[&str]| {
            let unrecorded_sides = sides.iter().map(|side| (*side).to_string()).collect();
            ExportReport { unrecorded_sides, ..ExportReport::default() }.to_string()
        };
        assert!(!text(&[]).contains("not recorded"));
        assert!(text(&["back"]).contains("not recorded: the back; "));
        assert!(text(&["back", "left", "top"]).contains("not recorded: the back, the left side and the top; "));
    }

    #[test]
    fn the_joints_are_a_table_with_reasons() {
        let drawer = LinkReport {
            name: "drawer".into(),
            joint: Some(JointKind::Prismatic),
            limits: Some([-0.0442, 0.3281]),
            observed: Some([0.0, 0.3165]),
            stops: Some(["before it meets base".into(), "as observed".into()]),
            zero_state: Some("start".into()),
            ..LinkReport::default()
        };
        let door = LinkReport {
            name: "door_left".into(),
            joint: Some(JointKind::Revolute),
            limits: Some([0.0, 1.5]),
            closed_state: Some("end".into()),
            ..drawer.clone()
        };
        let report = ExportReport { links: vec![LinkReport::default(), drawer, door], ..ExportReport::default() };
        let text = report.to_string();
        let row = |name: &str| text.lines().rfind(|line| line.starts_with(name)).unwrap().to_owned();
        let words =
            |line: String| line.split("  ").map(str::trim).filter(|w| !w.is_empty()).map(str::to_owned).collect();
        let drawer: Vec<String> = words(row("drawer"));
        let until = "before it meets base; 0 is the start";
        assert_eq!(drawer, ["drawer", "-44.2 mm", "0.0 to 316.5 mm", "328.1 mm", until, "as observed"]);
        let door: Vec<String> = words(row("door_left"));
        assert_eq!(door[1..4], ["0.0 deg", "0.0 to 18.1 deg", "85.9 deg"]);
        assert!(door[4].ends_with("seen closed at the end (0)"), "{door:?}");
    }

    #[test]
    fn altered_and_missing_files_are_named_wherever_the_folder_is() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::new(root.path().join("a"));
        let file = |name: &str| folder.exports().join(name);
        for name in ["urdf/replica.urdf", "urdf/meshes/base.obj", "glb/replica.glb"] {
            crate::write_atomic(&file(name), name.as_bytes()).unwrap();
        }
        let write = |formats: &[Format], names: &[&str]| {
            let mut report = ExportReport { files: names.iter().map(|n| file(n)).collect(), ..ExportReport::default() };
            assert_eq!(report.altered(&folder), None, "a report without digests");
            report.record_digests(&folder, formats).unwrap();
            report.save(&folder).unwrap();
        };
        write(&[Format::Glb, Format::Urdf], &["urdf/replica.urdf", "urdf/meshes/base.obj", "glb/replica.glb"]);
        // Another export of one format keeps the digests of the other.
        std::fs::write(file("glb/replica.glb"), "another").unwrap();
        write(&[Format::Glb], &["glb/replica.glb"]);
        let moved = RunFolder::new(root.path().join("b"));
        std::fs::rename(folder.root(), moved.root()).unwrap();
        let altered = || ExportReport::load(&moved).unwrap().unwrap().altered(&moved).unwrap();
        assert_eq!(altered(), Vec::<String>::new());
        std::fs::write(moved.exports().join("glb/replica.glb"), "anothes").unwrap();
        std::fs::write(moved.exports().join("urdf/replica.urdf"), "").unwrap();
        std::fs::remove_file(moved.exports().join("urdf/meshes/base.obj")).unwrap();
        let found = altered();
        assert_eq!(found.len(), 3);
        for (problem, words) in found.iter().zip(["glb/replica.glb was altered", "base.obj is missing", "0 bytes, 17"])
        {
            assert!(problem.contains(words), "{problem}");
        }
        let sizes = ExportReport::load(&moved).unwrap().unwrap().sizes();
        assert_eq!(sizes, [(Format::Urdf, 17 + 20), (Format::Glb, 7)]);
        // A format that is gone and was not written again is not expected any more.
        std::fs::remove_dir_all(moved.exports().join("urdf")).unwrap();
        let mut report = ExportReport::default();
        report.record_digests(&moved, &[Format::Glb]).unwrap();
        assert!(report.digests.is_empty());
    }
}
