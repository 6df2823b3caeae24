//! Pages of replicas, of parts before training, and of captures.

use crate::export::export_locked;
use crate::failure::Failure;
use crate::folder::{load_capture, lock, photos_of, require_replica};
use crate::output::note;
use crate::style::Style;
use anyhow::Context;
use artgs::discover::{DiscoverConfig, moved_points};
use artgs_core::{Alternative, Capture, JointEstimate, Rigid, State, View};
use artgs_io::RunFolder;
use artgs_io::asset::Format;
use artgs_io::export_report::ExportReport;
use artgs_physical::Up;
use artgs_physical::export::ExportOptions;
use artgs_view::{CameraView, Cloud, FoundJoint, Page, Placement, page_html};
use glam::DVec3;
use std::path::Path;

/// Cameras shown per state; more of them only hide each other.
const CAMERAS: usize = 16;

/// The page of a replica, which loads nothing. The error is what the program prints, and its exit code.
pub fn replica_page(folder: &Path) -> Result<String, (String, u8)> {
    const STYLE: Style = Style { json: false, quiet: true, silent: true };
    let run = RunFolder::new(folder);
    let made = require_replica(&run)
        .and_then(|()| page_of(&run, None, STYLE))
        .and_then(|page| page_html(&page.shared(false)).map_err(Failure::bad_input));
    made.map_err(|failure| (failure.to_string(), failure.exit_code()))
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
pub(crate) fn camera_views<'a>(views: &'a [View], state: State, before: &str) -> Vec<(CameraView, &'a View)> {
    let step = views.len().div_ceil(CAMERAS).max(1);
    let shown = views.iter().step_by(step);
    let camera = |view: &View| CameraView {
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
