//! Runs that are started from a page: what corrections change is made again, with what a folder tells of its run.

use crate::commands::{Style, observed_by, watched};
use crate::device::{self, Chosen, DeviceChoice};
use crate::failure::Failure;
use crate::live::{LAST_WORDS, Onlooker};
use crate::view::{announce, page_of, stopped};
use crate::{export, folder, library, output};
use artgs_core::Capture;
use artgs_view::{Live, Page, Placement, Rerun, Server};
use library::Config;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};

/// What a page of the folder can start, or why it cannot. `photos`: where they are, if the user said so.
pub(crate) fn rerun_of(out: &Path, photos: Option<&Path>, style: Style) -> Result<Box<Rerun<'static>>, String> {
    if !folder::has_parts(out) {
        let out = out.display();
        return Err(format!(
            "{out} has no stages to go on from; artgs reconstruct CAPTURE -o {out} --force makes them"
        ));
    }
    if !artgs::run::finds_parts(&library::settings_of(out)?) {
        return Err("parts were learnt in training here, and corrections are of parts found before it".into());
    }
    let Some(photos) = photos.map(Path::to_path_buf).or_else(|| folder::capture_of(out)).filter(|f| f.is_dir()) else {
        return Err("the photos are not where they were; start artgs view with --capture".into());
    };
    Ok(going_on(out, &photos, DeviceChoice::Auto, style))
}

fn going_on(out: &Path, photos: &Path, device: DeviceChoice, style: Style) -> Box<Rerun<'static>> {
    let (out, photos) = (out.to_path_buf(), photos.to_path_buf());
    Box::new(move |live| {
        go_on(&out, &photos, device, live, style).map_err(|failure| {
            // The page may be closed by now, and the terminal is where runs tell the rest.
            output::error(&failure, style.json);
            failure.to_string()
        })
    })
}

/// The run, the exports that the page shows, and the page.
fn go_on(out: &Path, photos: &Path, device: DeviceChoice, live: &Arc<Live>, style: Style) -> Result<Page, Failure> {
    /// Its name among the stages of the run.
    const EXPORT: &str = "export";
    let config = library::settings_of(out).map_err(Failure::bad)?;
    let device = device::choose(device, &config)?;
    let capture = library::load(photos)?;
    observed_by(&mut Onlooker(Arc::clone(live)), &capture, out, &config, true, &device, style)?;
    folder::note_capture(out, photos)?;
    live.stage_started(EXPORT);
    let begun = std::time::Instant::now();
    export::again(out, style)?;
    live.stage_finished(EXPORT, begun.elapsed().as_secs_f64(), false);
    page_of(out, Some(photos), style)
}

/// `artgs reconstruct --stop-after discover --view`: the page follows the first stages, shows what they found, takes
/// corrections and goes on. `choice` is what `device` was chosen by.
pub(crate) fn find_parts(
    capture: &Capture,
    photos: &Path,
    out: &Path,
    config: &Config,
    resume: bool,
    (device, choice): (&Chosen, DeviceChoice),
    style: Style,
) -> Result<(), Failure> {
    let name = out.file_name().map_or("run".into(), |n| n.to_string_lossy().into_owned());
    let mut page = Page::empty(&name);
    page.place(Placement::default());
    let server = Server::bind(page, None, Some(out.into())).map_err(|e| Failure::Failed(e.into()))?;
    let server = Arc::new(server.with_rerun(Ok(going_on(out, photos, choice, style))));
    let stop = stopped(&server)?;
    let failed = Mutex::new(None);
    let first = |live: &Arc<Live>| {
        let found = watched(&mut Onlooker(Arc::clone(live)), out, style, |observer| {
            device.tell(observer);
            library::find_parts(capture, out, config, resume, device.devices.as_ref(), observer)
        });
        let shown = found.and_then(|_| page_of(out, Some(photos), style));
        shown.map_err(|failure| {
            let told = failure.to_string();
            failed.lock().unwrap_or_else(PoisonError::into_inner).replace((failure, Arc::clone(live)));
            told
        })
    };
    announce(&server.url(), true, style)?;
    std::thread::scope(|scope| {
        scope.spawn(|| server.run(&stop));
        server.follow(&first);
        let Some((failure, live)) = failed.lock().unwrap_or_else(PoisonError::into_inner).take() else { return Ok(()) };
        live.wait_until_end_is_shown(LAST_WORDS);
        stop.store(true, Ordering::Relaxed);
        Err(failure)
    })
}
