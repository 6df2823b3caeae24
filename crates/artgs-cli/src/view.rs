//! `artgs view`: a replica, or a capture or recording before any reconstruction, in the browser.

use crate::args::View;
use crate::browser::{announce, stopped};
use crate::failure::Failure;
use crate::output::say;
use crate::pages::page_of;
use crate::recordings::given_option;
use crate::style::Style;
use crate::{object_box, rerun, view_recording};
use artgs_io::recording::RecordingFormat;
use artgs_io::{BoxBounds, RunFolder};
use artgs_view::{Page, Server, export_page};
use std::path::{Path, PathBuf};
use std::sync::Arc;

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
