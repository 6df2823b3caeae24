//! Arguments of `artgs export`.

use artgs_io::asset::{Actuators, Format, Frames, Provenance, SpzVersion};
use artgs_physical::Up;
use artgs_physical::export::{ExportOptions, FrontAxis};
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use std::num::NonZeroUsize;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct Export {
    /// Folder that `reconstruct` made; files go to its folder `exports`
    pub(crate) out: PathBuf,
    /// Formats, separated by commas; all of them if absent
    #[arg(long, value_name = "LIST", value_enum, value_delimiter = ',')]
    pub(crate) to: Vec<FormatArg>,
    /// Folder with the photos, for textures; where the run found them if absent
    #[arg(long, value_name = "DIR")]
    pub(crate) capture: Option<PathBuf>,
    /// Name of the object in the files
    #[arg(long, default_value = ExportOptions::NAME)]
    pub(crate) name: String,
    /// Metres per unit of the capture
    #[arg(long, value_name = "M", default_value_t = 1.0)]
    pub(crate) scale: f64,
    /// Which way is up in the capture: x, -x, y, -y, z, -z, or a direction such as 0.1,0,0.99; if absent, as the recordings state or
    /// their floor and walls say; z for captures
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    pub(crate) up: Option<Up>,
    /// Front of the object in the capture's frame, which is along -Y in exports: `auto` (where drawers come out and doors open
    /// to), x, -x, y, -y, z, -z, or `capture` to keep the frame of the capture
    #[arg(long, value_name = "AXIS", default_value = "auto", allow_hyphen_values = true)]
    pub(crate) front: FrontAxis,
    /// Links keep the names `part_1`, `part_2`, ... instead of names by their classes such as `door_left`
    #[arg(long)]
    pub(crate) part_names: bool,
    /// MJCF: an actuator per joint, whose control is a force or the value of the joint
    #[arg(long, value_name = "motor|position", value_parser = actuators)]
    pub(crate) actuators: Option<Actuators>,
    /// MJCF: the base moves freely instead of being fixed to the world
    #[arg(long)]
    pub(crate) free_base: bool,
    /// URDF: mesh paths begin with package://NAME/, the folder `urdf` being the package
    #[arg(long, value_name = "NAME", value_parser = package)]
    pub(crate) package: Option<String>,
    /// Frames without a body: `all`, or `none` to leave out grasp frames and the root link of the URDF, at which some importers stop
    #[arg(long, value_name = "all|none", value_parser = frames, default_value = "all")]
    pub(crate) frames: Frames,
    /// Version of the SPZ files: 2 and 3 are gzip streams, 4 has zstd streams
    #[arg(long, value_name = "2|3|4", default_value_t)]
    pub(crate) spz: SpzVersion,
    /// SimReady: who made the object
    #[arg(long, value_name = "NAME", value_parser = stated)]
    pub(crate) author: Option<String>,
    /// SimReady: the terms under which the files may be used
    #[arg(long, value_name = "TEXT", value_parser = stated)]
    pub(crate) license: Option<String>,
    /// SimReady: Wikidata item of the kind of object, such as Q42177; that of a physical object if absent
    #[arg(long, value_name = "ITEM", value_parser = wikidata)]
    pub(crate) wikidata: Option<String>,
    /// Kilograms per cubic metre, of all parts or of one; may be repeated; 650 if absent
    #[arg(long, value_name = "KG|PART=KG", value_parser = density)]
    pub(crate) density: Vec<(Option<String>, f64)>,
    /// Kilograms of all parts together
    #[arg(long, value_name = "KG")]
    pub(crate) mass: Option<f64>,
    /// What parts collide with
    #[arg(long, value_enum, default_value_t = CollisionKind::Hulls)]
    pub(crate) collision: CollisionKind,
    /// Convex pieces per link at most; 400 if absent
    #[arg(long, value_name = "N")]
    pub(crate) hulls: Option<u32>,
    /// Joints go from one observed state to the other and no further
    #[arg(long)]
    pub(crate) observed_limits: bool,
    /// Triangles per link for drawing, at most about this many; 20000 if absent
    #[arg(long, value_name = "N")]
    pub(crate) triangles: Option<usize>,
    /// Millimetres per texel of the textures; as in the photos if absent
    #[arg(long, value_name = "MM")]
    pub(crate) texel: Option<f64>,
    /// Number of threads; all cores if absent
    #[arg(long, value_name = "N", value_parser = crate::args::count)]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Write JSON
    #[arg(long)]
    pub(super) json: bool,
}

/// A format as the value of a flag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FormatArg(pub(crate) Format);

impl ValueEnum for FormatArg {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [FormatArg; Format::ALL.len()] = {
            let mut all = [FormatArg(Format::Urdf); Format::ALL.len()];
            let mut i = 0;
            while i < all.len() {
                all[i] = FormatArg(Format::ALL[i]);
                i += 1;
            }
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let hidden = !self.0.is_available();
        Some(PossibleValue::new(self.0.name()).help(self.0.description()).hide(hidden))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum CollisionKind {
    /// Convex pieces, cut so that hulls of different parts do not collide
    Hulls,
    /// Convex pieces by CoACD, cut likewise; needs the Python package `coacd` and takes minutes
    Coacd,
    /// Nothing collides
    None,
}

/// A density, or one of a part.
fn density(text: &str) -> Result<(Option<String>, f64), String> {
    let (part, number) = text.split_once('=').map_or((None, text), |(part, number)| (Some(part.to_string()), number));
    Ok((part, number.parse().map_err(|_| format!("`{number}` is not a number"))?))
}

fn actuators(text: &str) -> Result<Actuators, String> {
    Actuators::ALL.into_iter().find(|kind| kind.name() == text).ok_or_else(|| "motor or position".into())
}

fn frames(text: &str) -> Result<Frames, String> {
    Frames::ALL.into_iter().find(|kind| kind.name() == text).ok_or_else(|| "all or none".into())
}

/// Names of ROS packages.
fn package(text: &str) -> Result<String, String> {
    let usable = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '-';
    let valid = text.starts_with(|c: char| c.is_ascii_lowercase()) && text.chars().all(usable) && text.len() <= 100;
    if valid { Ok(text.into()) } else { Err("lower case letters, digits, `_` and `-`, a letter first".into()) }
}

/// A text that says something.
fn stated(text: &str) -> Result<String, String> {
    if text.trim().is_empty() { Err("a text that is not empty".into()) } else { Ok(text.trim().into()) }
}

fn wikidata(text: &str) -> Result<String, String> {
    if Provenance::is_item(text) { Ok(text.into()) } else { Err("the letter Q and a number, such as Q42177".into()) }
}
