//! `artgs view`: a replica, or a capture or recording before any reconstruction, in the browser.

use crate::args::View;
use crate::commands::Style;
use crate::export::export_locked;
use crate::failure::Failure;
use crate::folder::{load_capture, lock, photos_of, require_replica};
use crate::output::{note, say};
use crate::recordings::given_option;
use crate::{object_box, rerun, view_recording};
use anyhow::Context;
use artgs::discover::{DiscoverConfig, moved_points};
use artgs_core::{Alternative, Capture, JointEstimate, Rigid, State, View as SourceView};
use artgs_io::asset::Format;
use artgs_io::export_report::ExportReport;
use artgs_io::recording::RecordingFormat;
use artgs_io::{BoxBounds, RunFolder};
use artgs_physical::Up;
use artgs_physical::export::ExportOptions;
use artgs_view::{CameraView, Cloud, FoundJoint, Page, Placement, Server, export_page, page_html};
use glam::DVec3;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Cameras shown per state; more of them only hide each other.
const CAMERAS: usize = 16;

pub(crate) fn run(args: &View, style: Style) -> Result<(), Failure> {
    let run = RunFolder::new(&args.what);
    let is_run = run.has_replica() || run.has_found_parts();
    let is_recording =
        !is_run && args.what.exists() && (args.recording.format.is_some() || RecordingFormat::of(&args.what).is_some());
    if !is_recording && !args.what.is_dir() {
        let shown = args.what.display();
        return Err(Failure::bad(format!("{shown}: no such folder; give a replica, a capture or a recording")));
    }
    let aligned = if is_run || is_recording { None } else { object_box::of_alignment(&args.what) };
    let box_file = box_file(args, is_recording, aligned.is_some())?;
    let saved = box_file.iter().flatten().find_map(|file| BoxBounds::read(file).ok());
    let mut page = if is_recording {
        view_recording::page(&args.what, &args.recording, saved, style)?
    } else {
        page_of(&run, args.capture.as_deref(), style)?
    };
    if let Some(bounds) = saved.or(aligned).filter(|_| !is_recording) {
        page.scene.object_box = Some(view_recording::scene_box(bounds, saved.is_some()));
    }
    if let Some(file) = &args.export {
        return write_page(page, file, args, style);
    }
    let mut server = Server::bind(page, args.port, is_run.then(|| args.what.clone())).map_err(Failure::bad_input)?;
    if is_run {
        server = server.with_rerun(rerun::rerun_of(&run, args.capture.as_deref(), style));
    }
    if let Some(file) = box_file {
        server = server.with_box(file);
    }
    let server = Arc::new(server);
    announce(&server.url(), !args.no_open, style)?;
    let stop = stopped(&server)?;
    server.run(&stop);
    Ok(())
}

/// The page of a replica, which loads nothing. The error is what the program prints, and its exit code.
pub fn replica_page(folder: &Path) -> Result<String, (String, u8)> {
    const STYLE: Style = Style { json: false, quiet: true, silent: true };
    let run = RunFolder::new(folder);
    let made = require_replica(&run)
        .and_then(|()| page_of(&run, None, STYLE))
        .and_then(|page| page_html(&page.shared(false)).map_err(Failure::bad_input));
    made.map_err(|failure| (failure.to_string(), failure.exit_code()))
}

/// Writes a page that can be given to others, and says what it has.
fn write_page(page: Page, file: &Path, args: &View, style: Style) -> Result<(), Failure> {
    let had = page.scene.cameras.iter().filter(|camera| camera.photo.is_some()).count();
    let mut page = page.shared(args.photos);
    if let Some(title) = &args.title {
        page.scene.name.clone_from(title);
    }
    export_page(&page, file).map_err(Failure::bad_input)?;
    if style.quiet {
        return Ok(());
    }
    let size = std::fs::metadata(file).map_or(0.0, |about| about.len() as f64 / 1e6);
    let photos = match (args.photos, had) {
        (_, 0) => String::new(),
        (true, _) => format!(", with {had} photos of the capture"),
        (false, _) => ", without photos; --photos adds them".into(),
    };
    say(format!("page in {} ({size:.1} MB{photos})", file.display()))
}

/// Where the page of a recording, or of two that a run aligned, saves the box, or why it does not; none for pages without
/// a box.
fn box_file(args: &View, is_recording: bool, is_aligned: bool) -> Result<Option<Result<PathBuf, String>>, Failure> {
    let (shown, named) = (args.what.display(), args.save_box.as_deref());
    if let Some(option) = given_option(&args.recording).filter(|_| !is_recording) {
        return Err(Failure::bad(format!("{option} is for a recording of one state, and {shown} is none")));
    }
    if is_recording || is_aligned {
        let file = is_recording.then(|| object_box::file_of(&args.what));
        return object_box::file_to_save(file, named).map(Some);
    }
    match named {
        Some(_) => Err(Failure::bad(format!("--save-box is for a recording of one state, and {shown} is none"))),
        None => Ok(None),
    }
}

/// Becomes true at Ctrl-C. A run in progress then ends at once: its files are complete, and it can be resumed.
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

/// Page of a replica, of what a run has found before training, or of a capture. `photos` of the first two is the folder
/// that the user named, if any.
pub(crate) fn page_of(run: &RunFolder, photos: Option<&Path>, style: Style) -> Result<Page, Failure> {
    if run.has_replica() {
        replica(run, photos, style)
    } else if run.has_found_parts() {
        found(run, photos, style)
    } else {
        capture(run.root(), style)
    }
}

/// Page of a replica, exported first if it is not; with the photos if they are where they were.
fn replica(run: &RunFolder, photos: Option<&Path>, style: Style) -> Result<Page, Failure> {
    let lacks_splats = run.has_splats() && !run.has_export(Format::Splats);
    let mut page = if run.has_export(Format::Urdf) && !lacks_splats {
        exported(run)?
    } else {
        note("the replica has no exports to show yet: exporting them", style);
        match export_shown(run, photos, style) {
            Ok(()) => exported(run)?,
            Err(failure @ Failure::Failed(_)) => {
                note(&format!("{failure}; the exports are kept in memory"), style);
                exported_in_memory(run, photos, style)?
            }
            Err(failure) => return Err(failure),
        }
    };
    add_photos(&mut page, run, photos, style)?;
    page.corrected = artgs::run::corrections_of(run);
    Ok(page)
}

/// Page of the exports of a replica.
fn exported(run: &RunFolder) -> Result<Page, Failure> {
    let mut page = Page::of_run(run).map_err(Failure::bad_input)?;
    page.place(placement(run)?);
    Ok(page)
}

fn export_shown(run: &RunFolder, photos: Option<&Path>, style: Style) -> Result<(), Failure> {
    let _lock = lock(run, "artgs view", style)?;
    export_locked(run, &shown_formats(run, photos), style).map(drop)
}

/// Page of a replica whose folder cannot be written: files of exports exist only while they are made.
fn exported_in_memory(run: &RunFolder, photos: Option<&Path>, style: Style) -> Result<Page, Failure> {
    let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
    let elsewhere = run.clone().with_exports(folder.path());
    export_locked(&elsewhere, &shown_formats(run, photos), style)?;
    let mut page = exported(&elsewhere)?;
    page.load_files().map_err(Failure::failed)?;
    Ok(page)
}

/// What the page shows, upright and with the options of the last export; a report of it that cannot be read says nothing.
fn shown_formats(run: &RunFolder, photos: Option<&Path>) -> ExportOptions {
    let formats = ExportOptions::SHOWN.to_vec();
    let last = ExportOptions::of_last_export(run).unwrap_or_else(|_| ExportOptions::first(run, formats.clone()));
    let capture = photos.map(Path::to_path_buf).or(last.capture);
    ExportOptions { formats, capture, ..last }
}

/// Page of parts before training: labelled points of both states on joints that move them.
fn found(run: &RunFolder, photos: Option<&Path>, style: Style) -> Result<Page, Failure> {
    let shown = run.root().display();
    let unreadable = || Failure::bad(format!("{shown}: stages cannot be read; reconstruct again with --force"));
    let found = artgs::run::found_parts(run).ok_or_else(unreadable)?;
    let joint = |(k, part): (usize, &JointEstimate)| {
        let middle = found.middle(k + 1, State::START);
        let others = found.alternatives.get(k).into_iter().flatten();
        FoundJoint {
            joint: part.joint_near(&found.parts, middle),
            parent: part.parent,
            confidence: part.confidence,
            alternatives: others.map(|other| Alternative::near(other, middle)).collect(),
        }
    };
    let joints: Vec<FoundJoint> = found.parts.iter().enumerate().map(joint).collect();
    let placement = Placement::default();
    let mut page = Page::of_joints(&run.name(), &joints, placement);
    for (state, (cloud, labels)) in State::ALL.into_iter().zip(found.clouds.iter().zip(&found.labels)) {
        // There are never as many parts.
        let marks = labels.iter().map(|label| u8::try_from(*label).unwrap_or(u8::MAX)).collect();
        page.add_cloud(&points(state, cloud, marks), placement);
    }
    add_photos(&mut page, run, photos, style)?;
    Ok(page)
}

/// Adds the cameras of the run's capture, if the photos are where they were.
fn add_photos(page: &mut Page, run: &RunFolder, photos: Option<&Path>, style: Style) -> Result<(), Failure> {
    let Some(folder) = photos_of(run, photos) else {
        note("the photos are not where they were: no cameras are shown; see --capture", style);
        return Ok(());
    };
    let placement = page.scene.placement.unwrap_or_default();
    page.add_cameras(&cameras(&load_capture(&folder)?, &folder), placement).map_err(Failure::bad_input)
}

fn points(state: State, cloud: &artgs::discover::Cloud, marks: Vec<u8>) -> Cloud {
    let colors = cloud.colors.iter().map(|c| c.to_array().map(|x| (255.0 * x).round().clamp(0.0, 255.0) as u8));
    Cloud { state, points: cloud.points.iter().map(|p| p.to_array()).collect(), colors: colors.collect(), marks }
}

/// Page of a capture: its cameras and the surface points of both states.
fn capture(folder: &Path, style: Style) -> Result<Page, Failure> {
    let capture = load_capture(folder)?;
    let mut page = Page::empty(&name_of(folder, "capture"));
    let placement = Placement::default();
    page.place(placement);
    page.add_cameras(&cameras(&capture, folder), placement).map_err(Failure::bad_input)?;
    let seen = moved_points(&capture, &DiscoverConfig::default()).map_err(|e| Failure::BadInput(e.into()))?;
    if seen.iter().all(|s| s.cloud.is_empty()) {
        note("the capture has no depth: no points are shown", style);
    }
    for (state, seen) in State::ALL.into_iter().zip(&seen) {
        let marks = seen.moved.iter().map(|moved| u8::from(*moved)).collect();
        page.add_cloud(&points(state, &seen.cloud, marks), placement);
    }
    Ok(page)
}

/// Name of a folder, or of a file without its extension; `other` for one without a name.
pub(crate) fn name_of(path: &Path, other: &str) -> String {
    let name = if path.is_dir() { path.file_name() } else { path.file_stem() };
    name.map_or_else(|| other.into(), |n| n.to_string_lossy().into_owned())
}

fn cameras(capture: &Capture, folder: &Path) -> Vec<CameraView> {
    let mut out = Vec::new();
    for (state, views) in capture.states.enumerate() {
        for (camera, view) in camera_views(&views.train, state, &format!("{} ", state.name())) {
            let photo = Some(folder.join(&view.name)).filter(|file| file.is_file());
            out.push(CameraView { photo, ..camera });
        }
    }
    out
}

/// Some of the cameras, without pictures; `before` begins their names.
pub(crate) fn camera_views<'a>(
    views: &'a [SourceView],
    state: State,
    before: &str,
) -> Vec<(CameraView, &'a SourceView)> {
    let step = views.len().div_ceil(CAMERAS).max(1);
    let shown = views.iter().step_by(step);
    let camera = |view: &SourceView| CameraView {
        name: format!("{before}{}", name_of(Path::new(&view.name), &view.name)),
        state,
        camera: view.camera,
        photo: None,
        rendering: None,
        mask: None,
    };
    shown.map(|view| (camera(view), view)).collect()
}

/// How the export turned and scaled the capture; metres and +Z up where it does not say.
fn placement(run: &RunFolder) -> Result<Placement, Failure> {
    let report = ExportReport::load(run).map_err(Failure::bad_input)?.unwrap_or_default();
    let scale = Some(report.scale).filter(|s| s.is_finite() && *s > 0.0).unwrap_or(1.0);
    let up: Up = report.up.parse().unwrap_or_default();
    // Exports of earlier versions only turned the upward axis.
    let frame = report.frame.unwrap_or(Rigid { rotation: up.upright(), translation: DVec3::ZERO });
    Ok(Placement { scale, rotation: frame.rotation, translation: frame.translation })
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

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{Replica, UpSource, Upward};

    /// Recordings have their own axes: without this a fridge lies on its side in the page.
    #[test]
    fn a_replica_is_shown_upright_before_anything_was_exported() {
        let dir = tempfile::tempdir().unwrap();
        let up = Upward { direction: DVec3::NEG_Y, source: UpSource::Floor, confidence: 0.9 };
        artgs_io::write_replica(dir.path(), &Replica { up: Some(up), ..Replica::new(&[]) }).unwrap();
        for mesh in ["start/whole", "start/part_0", "end/whole", "end/part_0"] {
            artgs_io::write_atomic(&dir.path().join(format!("meshes/{mesh}.ply")), b"").unwrap();
        }
        let run = RunFolder::new(dir.path());
        let options = shown_formats(&run, None);
        assert!(options.up.direction().distance(DVec3::NEG_Y) < 1e-9, "{:?}", options.up);
        assert_eq!(options.formats, ExportOptions::SHOWN);
    }
}
