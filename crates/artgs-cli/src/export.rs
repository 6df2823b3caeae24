//! `artgs export`: a replica as files of simulators, browsers and renderers.

use crate::args::{CollisionKind, Export, Format, UpAxis};
use crate::coacd;
use crate::commands::{Style, use_threads, write_json};
use crate::failure::Failure;
use crate::folder;
use crate::library;
use crate::output::{Report, note};
use anyhow::Context;
use artgs_core::{Asset, Capture, Mesh, Replica, Splats};
use artgs_io::asset;
use artgs_physical::decompose::Decomposer;
use artgs_physical::stance::Stop;
use artgs_physical::{BuiltAsset, Collision, Parts, PhysicalConfig, Up, build};
use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fmt;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Folder of all exports within a replica's.
pub(crate) const EXPORTS: &str = "exports";
/// What was decided, beside the exports.
pub(crate) const DECISIONS: &str = "export.json";

pub(crate) fn run(args: &Export, style: Style) -> Result<(), Failure> {
    use_threads(args.threads)?;
    let report = export(args, style)?;
    if style.json || !style.quiet {
        report.show(style.json)?;
    }
    Ok(())
}

/// Writes the formats and says what was decided.
pub(crate) fn export(args: &Export, style: Style) -> Result<Report, Failure> {
    let config = config(args)?;
    folder::holds_replica(&args.out)?;
    let replica = artgs_io::read_replica(&args.out).map_err(|e| Failure::BadInput(e.into()))?;
    let meshes = meshes(&args.out, &replica)?;
    let splats = splats(&args.out, &replica)?;
    let capture = capture(args, style)?;
    let parts = Parts { replica: &replica, meshes: &meshes, splats: splats.as_deref() };
    let by_coacd = |mesh: &Mesh| coacd::decompose(mesh);
    let decomposer: Option<&Decomposer> = (args.collision == CollisionKind::Coacd).then_some(&by_coacd);
    let built = build(&args.name, &parts, capture.as_ref(), &config, decomposer).map_err(Failure::bad)?;
    built.surfaces.iter().flat_map(|s| &s.warnings).for_each(|w| note(w, style));
    let told = asset::check_asset(&built.asset);
    told.map_err(|reason| Failure::bad(format!("{}: {reason}", args.out.join("replica.json").display())))?;
    let formats = if args.to.is_empty() { Format::ALL.to_vec() } else { args.to.clone() };
    let mut files = Vec::new();
    for format in formats {
        if format == Format::Splats && built.asset.links.iter().all(|link| link.splats.is_none()) {
            // An empty folder would look like an export that failed; one of an earlier replica would be wrong.
            remove(&args.out.join(EXPORTS).join(format.folder()))?;
            continue;
        }
        files.extend(write(&args.out.join(EXPORTS), format, &built.asset)?);
    }
    let up = if config.up == Up::Z { "z" } else { "y" };
    let told = Told { options: Options::of(args), ..Told::of(&built, up, files) };
    let report = Report::new(&told)?;
    write_json(&args.out.join(EXPORTS).join(DECISIONS), &report)?;
    Ok(report)
}

fn config(args: &Export) -> Result<PhysicalConfig, Failure> {
    let defaults = PhysicalConfig::default();
    let config = PhysicalConfig {
        scale: args.scale,
        density: args.density.unwrap_or(defaults.density),
        up: if args.up == UpAxis::Z { Up::Z } else { Up::Y },
        collision: if args.collision == CollisionKind::None { Collision::None } else { Collision::Hulls },
        extend_limits: !args.observed_limits,
        triangles: args.triangles.unwrap_or(defaults.triangles),
        ..defaults
    };
    for (flag, value) in [("--scale", config.scale), ("--density", config.density)] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(Failure::bad(format!("{flag} is {value}; give a number above 0")));
        }
    }
    Ok(config)
}

fn meshes(out: &Path, replica: &Replica) -> Result<Vec<Mesh>, Failure> {
    let read =
        |part: &artgs_core::replica::Part| artgs_io::read_mesh_ply(&out.join(&part.meshes[artgs_core::State::START]));
    replica.parts.iter().map(read).collect::<Result<_, _>>().map_err(|e| Failure::BadInput(e.into()))
}

/// Gaussians of every part; none if the method made none.
fn splats(out: &Path, replica: &Replica) -> Result<Option<Vec<Splats>>, Failure> {
    let file = |part: usize| out.join("splats").join(format!("part_{part}.ply"));
    if !file(0).is_file() {
        return Ok(None);
    }
    let read = |part: usize| artgs_io::read_splat_ply(&file(part)).map(|read| read.0);
    let read: Result<Vec<Splats>, _> = (0..replica.parts.len()).map(read).collect();
    read.map(Some).map_err(|e| Failure::BadInput(e.into()))
}

/// The photos the replica was made of: where the run left word, or where the user says.
fn capture(args: &Export, style: Style) -> Result<Option<Capture>, Failure> {
    let photos = match &args.capture {
        Some(folder) => Some(library::load(folder)?),
        None => folder::capture_of(&args.out).filter(|f| f.is_dir()).and_then(|f| library::load(&f).ok()),
    };
    match photos {
        Some(capture) if artgs::run::made_from(&args.out, &capture) == Some(false) => {
            note("the capture is not the one the replica was made of: textures may be off", style);
            Ok(Some(capture))
        }
        None => {
            note("the photos are not where they were: textures hold the colours of the meshes; see --capture", style);
            Ok(None)
        }
        known => Ok(known),
    }
}

/// Writes one format anew: beside its place first, so that neither half of it nor files of an earlier export are left.
fn write(exports: &Path, format: Format, asset: &Asset) -> Result<Vec<PathBuf>, Failure> {
    let (place, fresh) = (exports.join(format.folder()), exports.join(format!(".{}.new", format.folder())));
    remove(&fresh)?;
    fs::create_dir_all(&fresh).with_context(|| format!("cannot make {}", fresh.display()))?;
    let written = match format {
        Format::Urdf => asset::export_urdf(&fresh, asset),
        Format::Mjcf => asset::export_mjcf(&fresh, asset),
        Format::Usd => asset::usd::export_usd(&fresh, asset),
        Format::Usdz => asset::usd::export_usdz(&fresh, asset),
        Format::Glb => asset::glb::export_glb(&fresh, asset),
        Format::Sdf => asset::export_sdf(&fresh, asset),
        Format::Partnet => asset::export_partnet(&fresh, asset),
        Format::Splats => asset::splats::export_splats(&fresh, asset),
    };
    let written = written.map_err(|e| {
        // Whatever happens to the remains, the reason is what matters.
        let _ = fs::remove_dir_all(&fresh);
        Failure::Failed(e.into())
    })?;
    remove(&place)?;
    fs::rename(&fresh, &place).with_context(|| format!("cannot put {} in its place", place.display()))?;
    let moved = |file: PathBuf| file.strip_prefix(&fresh).map(|rest| place.join(rest)).unwrap_or(file.clone());
    Ok(written.into_iter().map(moved).collect())
}

fn remove(folder: &Path) -> Result<(), Failure> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(anyhow::Error::from(error).context(format!("cannot remove {}", folder.display())).into())
        }
        _ => Ok(()),
    }
}

/// Exports a replica again that is not what it was, in the same formats and with the same options.
pub(crate) fn again(out: &Path, style: Style) -> Result<Report, Failure> {
    let exports = out.join(EXPORTS);
    let text = fs::read(exports.join(DECISIONS)).unwrap_or_default();
    let told: Value = serde_json::from_slice(&text).unwrap_or_default();
    let options: Options = serde_json::from_value(told["options"].clone()).unwrap_or_default();
    let there = |format: &&Format| exports.join(format.folder()).is_dir();
    let shown = [Format::Urdf, Format::Splats];
    let mut args = Export::of(out.into());
    args.to = Format::ALL.iter().filter(|f| shown.contains(f) || there(f)).copied().collect();
    args.capture = options.capture.filter(|folder| folder.is_dir());
    args.name = options.name.unwrap_or(args.name);
    args.scale = told["scale"].as_f64().unwrap_or(args.scale);
    args.up = if told["up"] == "y" { UpAxis::Y } else { UpAxis::Z };
    args.density = options.density;
    args.collision = options.collision.and_then(|c| CollisionKind::from_str(&c, false).ok()).unwrap_or(args.collision);
    args.observed_limits = options.observed_limits;
    args.triangles = options.triangles;
    export(&args, style)
}

/// What an export was asked for, so that it can be made again.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(default)]
struct Options {
    name: Option<String>,
    capture: Option<PathBuf>,
    density: Option<f64>,
    collision: Option<String>,
    observed_limits: bool,
    triangles: Option<usize>,
}

impl Options {
    fn of(args: &Export) -> Self {
        Self {
            name: Some(args.name.clone()),
            // Wherever the program is started the next time.
            capture: args.capture.as_ref().and_then(|folder| fs::canonicalize(folder).ok()),
            density: args.density,
            collision: args.collision.to_possible_value().map(|v| v.get_name().into()),
            observed_limits: args.observed_limits,
            triangles: args.triangles,
        }
    }
}

/// What an export decided.
#[derive(Debug, Serialize)]
struct Told {
    options: Options,
    /// Metres per unit of the capture, and its upward axis.
    scale: f64,
    up: &'static str,
    links: Vec<TellLink>,
    /// Deepest penetration of convex pieces before cutting and left after it, metres.
    penetration: [f64; 2],
    /// Pieces lost and share of their volume that was cut.
    lost_pieces: usize,
    cut_share: f64,
    files: Vec<PathBuf>,
}

#[derive(Debug, Serialize)]
struct TellLink {
    name: String,
    mass: f64,
    hulls: usize,
    triangles: usize,
    fused_triangles: usize,
    watertight: bool,
    /// 99 of 100 points are within this of the fused surface, metres.
    surface_error: f64,
    /// Share of the texture that a photo shows.
    photographed: Option<f64>,
    closed_state: Option<&'static str>,
    limits: Option<[f64; 2]>,
    observed: Option<[f64; 2]>,
    stops: Option<[String; 2]>,
}

impl Told {
    fn of(built: &BuiltAsset, up: &'static str, files: Vec<PathBuf>) -> Self {
        let BuiltAsset { asset, decisions, surfaces } = built;
        let link = |(i, link): (usize, &artgs_core::AssetLink)| {
            let surface = &surfaces[i];
            let [texels, seen] = surface.texels;
            TellLink {
                name: link.name.clone(),
                mass: link.inertial.mass,
                hulls: link.collision.len(),
                triangles: link.visual.mesh.triangles.len(),
                fused_triangles: surface.fused,
                watertight: surface.closed,
                surface_error: surface.error.most * decisions.scale,
                photographed: (seen > 0).then(|| seen as f64 / texels as f64),
                closed_state: decisions.closed_state[i].map(artgs_core::State::name),
                limits: link.joint.map(|j| j.limits),
                observed: link.joint.map(|j| j.observed.into()),
                stops: decisions.ranges[i].as_ref().map(|r| [0, 1].map(|e| reason(&r.stops[e]))),
            }
        };
        let [before, after] = decisions.clearance.volume;
        Self {
            options: Options::default(),
            scale: decisions.scale,
            up,
            links: asset.links.iter().enumerate().map(link).collect(),
            penetration: [decisions.clearance.deepest, decisions.penetration],
            lost_pieces: decisions.clearance.lost,
            cut_share: if before > 0.0 { 1.0 - after / before } else { 0.0 },
            files,
        }
    }
}

fn reason(stop: &Stop) -> String {
    match stop {
        Stop::Observed => "as observed".into(),
        Stop::Contact(link) => format!("before it meets {link}"),
        Stop::Support => "before it falls out".into(),
        Stop::Reach => "as far as is ever assumed".into(),
    }
}

impl fmt::Display for Told {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:<16} {:>9} {:>6} {:>10} {:>7}  closed surface", "link", "kg", "hulls", "triangles", "photos")?;
        for link in &self.links {
            let photos = link.photographed.map_or("-".into(), |p| format!("{:.0} %", 100.0 * p));
            let closed = if link.watertight { "yes" } else { "no" };
            let TellLink { name, mass, hulls, triangles, .. } = link;
            writeln!(f, "{name:<16} {mass:>9.3} {hulls:>6} {triangles:>10} {photos:>7}  {closed}")?;
        }
        writeln!(f)?;
        for link in &self.links {
            let (Some([low, high]), Some([start, end]), Some(stops)) = (link.limits, link.observed, &link.stops) else {
                continue;
            };
            let zero = link.closed_state.map_or("start".into(), |s| format!("closed ({s})"));
            writeln!(f, "{}: 0 = {zero}, observed {start:.3} to {end:.3}", link.name)?;
            writeln!(f, "  from {low:.3}, {}, to {high:.3}, {}", stops[0], stops[1])?;
        }
        let [met, left] = self.penetration.map(|p| 1000.0 * p);
        writeln!(
            f,
            "hulls overlapped by {met:.1} mm, now by {left:.2} mm; {:.1} % of them cut off",
            100.0 * self.cut_share
        )?;
        writeln!(f)?;
        self.files.iter().filter(|file| main_file(file)).try_for_each(|file| writeln!(f, "{}", file.display()))
    }
}

/// Files that a user opens: those right in a format's folder.
fn main_file(file: &Path) -> bool {
    file.parent().and_then(Path::parent).is_some_and(|p| p.ends_with(EXPORTS))
        && file.extension().is_some_and(|e| e != "json" && e != "txt" && e != "config" && e != "spz")
}
