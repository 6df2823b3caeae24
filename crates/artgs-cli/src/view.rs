//! `artgs view`: a replica, or a capture before any reconstruction, in the browser.

use crate::args::{Export, Format, View};
use crate::commands::Style;
use crate::export::{self, DECISIONS, EXPORTS};
use crate::failure::Failure;
use crate::folder;
use crate::library;
use crate::output::{note, say};
use anyhow::Context;
use artgs::discover::{DiscoverConfig, glimpse};
use artgs_core::{Capture, STATE_NAMES};
use artgs_physical::Up;
use artgs_view::{CameraView, Cloud, Page, Placement, Server, ViewError, export_page};
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
    let is_replica = args.what.join("replica.json").is_file();
    let page = if is_replica { replica(args, style)? } else { capture(&args.what, style)? };
    if let Some(file) = &args.export {
        export_page(&page, file).map_err(failure)?;
        return if style.quiet { Ok(()) } else { say(format!("page in {}", file.display())) };
    }
    let corrections = is_replica.then(|| args.what.clone());
    let server = Server::bind(page, args.port, corrections).map_err(failure)?;
    announce(&server.url(), !args.no_open, style)?;
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).context("cannot watch for Ctrl-C")?;
    server.run(&stop);
    Ok(())
}

/// Page of a replica, exported first if it is not; with the photos if they are where they were.
fn replica(args: &View, style: Style) -> Result<Page, Failure> {
    let exports = args.what.join(EXPORTS);
    let lacks_splats = args.what.join("splats").is_dir() && !exports.join("splats").is_dir();
    if !exports.join("urdf").is_dir() || lacks_splats {
        note("the replica has no exports to show yet: making them", style);
        let mut wanted = Export::of(args.what.clone());
        wanted.to = vec![Format::Urdf, Format::Splats];
        export::export(&wanted, style)?;
    }
    let mut page = Page::of_replica(&args.what).map_err(failure)?;
    let placement = placement(&exports.join(DECISIONS));
    page.place(placement);
    let photos = args.capture.clone().or_else(|| folder::capture_of(&args.what)).filter(|f| f.is_dir());
    match photos.map(|folder| Ok::<_, Failure>((library::load(&folder)?, folder))).transpose()? {
        Some((capture, folder)) => page.add_cameras(&cameras(&capture, &folder), placement).map_err(failure)?,
        None => note("the photos are not where they were: no cameras are shown; see --capture", style),
    }
    Ok(page)
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
    for (state, seen) in seen.iter().enumerate() {
        let points = seen.cloud.points.iter().map(|p| p.to_array()).collect();
        let colors =
            seen.cloud.colors.iter().map(|c| c.to_array().map(|x| (255.0 * x).round().clamp(0.0, 255.0) as u8));
        page.add_cloud(&Cloud { state, points, colors: colors.collect(), moved: seen.moved.clone() }, placement);
    }
    Ok(page)
}

fn cameras(capture: &Capture, folder: &Path) -> Vec<CameraView> {
    let mut out = Vec::new();
    for (state, views) in capture.states.iter().enumerate() {
        let step = views.train.len().div_ceil(CAMERAS).max(1);
        out.extend(views.train.iter().step_by(step).map(|view| CameraView {
            name: format!("{} {}", STATE_NAMES[state], stem(&view.name)),
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
