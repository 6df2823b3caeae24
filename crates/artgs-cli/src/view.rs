//! `artgs view`: a replica, or a capture before any reconstruction, in the browser.

use crate::args::{Export, Format, View};
use crate::commands::Style;
use crate::export::{self, DECISIONS, EXPORTS};
use crate::failure::Failure;
use crate::folder;
use crate::library;
use crate::output::{note, say};
use crate::rerun;
use anyhow::Context;
use artgs::discover::{DiscoverConfig, glimpse};
use artgs_core::{Capture, Joint, JointEstimate, State};
use artgs_physical::Up;
use artgs_view::{CameraView, Cloud, Page, Placement, Server, ViewError, export_page};
use glam::DVec3;
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Cameras shown per state; more of them only hide each other.
const CAMERAS: usize = 16;

pub(crate) fn run(args: &View, style: Style) -> Result<(), Failure> {
    if !args.what.is_dir() {
        return Err(Failure::bad(format!("{}: no such folder; give a replica or a capture", args.what.display())));
    }
    let page = page_of(&args.what, args.capture.as_deref(), style)?;
    if let Some(file) = &args.export {
        export_page(&page, file).map_err(failure)?;
        return if style.quiet { Ok(()) } else { say(format!("page in {}", file.display())) };
    }
    let is_run = is_replica(&args.what) || folder::has_parts(&args.what);
    let mut server = Server::bind(page, args.port, is_run.then(|| args.what.clone())).map_err(failure)?;
    if is_run {
        server = server.with_rerun(rerun::rerun_of(&args.what, args.capture.as_deref(), style));
    }
    let server = Arc::new(server);
    announce(&server.url(), !args.no_open, style)?;
    let stop = stopped(&server)?;
    server.run(&stop);
    Ok(())
}

/// Becomes true at Ctrl-C. A run that is under way then ends at once: its files are whole, and it can be resumed.
pub(crate) fn stopped(server: &Arc<Server>) -> Result<Arc<AtomicBool>, Failure> {
    const INTERRUPTED: i32 = 130;
    let stop = Arc::new(AtomicBool::new(false));
    let (flag, server) = (Arc::clone(&stop), Arc::clone(server));
    let end = move || {
        if server.is_busy() {
            std::process::exit(INTERRUPTED);
        }
        flag.store(true, Ordering::Relaxed);
    };
    ctrlc::set_handler(end).context("cannot watch for Ctrl-C")?;
    Ok(stop)
}

fn is_replica(folder: &Path) -> bool {
    folder.join("replica.json").is_file()
}

/// Page of a replica, of what a run has found before training, or of a capture. `photos` of the first two: where they
/// are, if the user said so.
pub(crate) fn page_of(what: &Path, photos: Option<&Path>, style: Style) -> Result<Page, Failure> {
    match what {
        out if is_replica(out) => replica(out, photos, style),
        out if folder::has_parts(out) => found(out, photos, style),
        folder => capture(folder, style),
    }
}

/// Page of a replica, exported first if it is not; with the photos if they are where they were.
fn replica(out: &Path, photos: Option<&Path>, style: Style) -> Result<Page, Failure> {
    let exports = out.join(EXPORTS);
    let lacks_splats = out.join("splats").is_dir() && !exports.join("splats").is_dir();
    if !exports.join("urdf").is_dir() || lacks_splats {
        note("the replica has no exports to show yet: making them", style);
        let mut wanted = Export::of(out.into());
        wanted.to = vec![Format::Urdf, Format::Splats];
        wanted.capture = photos.map(Path::to_path_buf);
        export::export(&wanted, style)?;
    }
    let mut page = Page::of_replica(out).map_err(failure)?;
    page.place(placement(&exports.join(DECISIONS)));
    add_photos(&mut page, out, photos, style)?;
    page.corrected = artgs::run::corrections_of(out);
    Ok(page)
}

/// Page of parts before training: labelled points of both states on joints that move them.
fn found(out: &Path, photos: Option<&Path>, style: Style) -> Result<Page, Failure> {
    let unreadable = || Failure::bad(format!("{}: stages cannot be read; start afresh with --force", out.display()));
    let found = artgs::run::found(out).ok_or_else(unreadable)?;
    let name = out.file_name().map_or("run".into(), |n| n.to_string_lossy().into_owned());
    let joint = |(k, part): (usize, &JointEstimate)| {
        let own =
            found.clouds[0].points.iter().zip(&found.labels[0]).filter(|(_, label)| usize::from(**label) == k + 1);
        let own: Vec<DVec3> = own.map(|(p, _)| p.as_dvec3()).collect();
        let middle = own.iter().sum::<DVec3>() / own.len().max(1) as f64;
        (part.joint_near(middle), part.confidence)
    };
    let joints: Vec<(Joint, Option<f64>)> = found.parts.iter().enumerate().map(joint).collect();
    let placement = Placement::default();
    let mut page = Page::of_joints(&name, &joints, placement);
    for (state, (cloud, labels)) in State::ALL.into_iter().zip(found.clouds.iter().zip(&found.labels)) {
        // More parts than that are never asked for.
        let marks = labels.iter().map(|label| u8::try_from(*label).unwrap_or(u8::MAX)).collect();
        page.add_cloud(&points(state, cloud, marks), placement);
    }
    add_photos(&mut page, out, photos, style)?;
    Ok(page)
}

/// Adds the cameras of the run's capture, if the photos are where they were.
fn add_photos(page: &mut Page, out: &Path, photos: Option<&Path>, style: Style) -> Result<(), Failure> {
    let place = photos.map(Path::to_path_buf).or_else(|| folder::capture_of(out)).filter(|f| f.is_dir());
    let Some(folder) = place else {
        note("the photos are not where they were: no cameras are shown; see --capture", style);
        return Ok(());
    };
    let placement = page.scene.placement.unwrap_or_default();
    page.add_cameras(&cameras(&library::load(&folder)?, &folder), placement).map_err(failure)
}

fn points(state: State, cloud: &artgs::discover::observe::Cloud, marks: Vec<u8>) -> Cloud {
    let colors = cloud.colors.iter().map(|c| c.to_array().map(|x| (255.0 * x).round().clamp(0.0, 255.0) as u8));
    Cloud { state, points: cloud.points.iter().map(|p| p.to_array()).collect(), colors: colors.collect(), marks }
}

/// Page of a capture: its cameras and the surface points of both states.
fn capture(folder: &Path, style: Style) -> Result<Page, Failure> {
    let capture = library::load(folder)?;
    let name = folder.file_name().map_or("capture".into(), |n| n.to_string_lossy().into_owned());
    let mut page = Page::empty(&name);
    let placement = Placement::default();
    page.place(placement);
    page.add_cameras(&cameras(&capture, folder), placement).map_err(failure)?;
    let seen = glimpse(&capture, &DiscoverConfig::default()).map_err(|e| Failure::BadInput(e.into()))?;
    if seen.iter().all(|s| s.cloud.is_empty()) {
        note("the capture has no depth: no points are shown", style);
    }
    for (state, seen) in State::ALL.into_iter().zip(&seen) {
        let marks = seen.moved.iter().map(|moved| u8::from(*moved)).collect();
        page.add_cloud(&points(state, &seen.cloud, marks), placement);
    }
    Ok(page)
}

fn cameras(capture: &Capture, folder: &Path) -> Vec<CameraView> {
    let mut out = Vec::new();
    for (state, views) in capture.states.enumerate() {
        let step = views.train.len().div_ceil(CAMERAS).max(1);
        out.extend(views.train.iter().step_by(step).map(|view| CameraView {
            name: format!("{} {}", state.name(), stem(&view.name)),
            state,
            camera: view.camera,
            photo: Some(folder.join(&view.name)).filter(|file| file.is_file()),
            rendering: None,
            mask: None,
        }));
    }
    out
}

fn stem(name: &str) -> String {
    Path::new(name).file_stem().map_or_else(|| name.into(), |s| s.to_string_lossy().into_owned())
}

/// How the export turned and scaled the capture; metres and +Z up where it does not say.
fn placement(decisions: &Path) -> Placement {
    let text = std::fs::read(decisions).unwrap_or_default();
    let told: Value = serde_json::from_slice(&text).unwrap_or_default();
    let scale = told["scale"].as_f64().filter(|s| s.is_finite() && *s > 0.0).unwrap_or(1.0);
    let up = if told["up"].as_str() == Some("y") { Up::Y } else { Up::Z };
    Placement { scale, rotation: up.upright() }
}

fn failure(error: ViewError) -> Failure {
    Failure::BadInput(error.into())
}

/// Says where a page is, and shows it if asked to.
pub(crate) fn announce(url: &str, show: bool, style: Style) -> Result<(), Failure> {
    if style.json {
        say(json!({ "event": "listening", "url": url }))?;
    } else {
        say(format!("page at {url} (Ctrl-C to end)"))?;
    }
    if show && !open(url) {
        note("no browser could be started; open the address yourself", style);
    }
    Ok(())
}

/// Shows an address in the user's browser; false if that cannot be started.
fn open(url: &str) -> bool {
    let (program, before): (&str, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("cmd", &["/C", "start", ""]),
        _ => ("xdg-open", &[]),
    };
    let mut command = Command::new(program);
    command.args(before).arg(url).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().is_ok()
}
