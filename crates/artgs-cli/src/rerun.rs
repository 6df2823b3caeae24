//! Runs that are started from a page: what corrections change is computed again, with the settings of the folder.

use crate::browser::{announce, stopped};
use crate::device;
use crate::failure::Failure;
use crate::folder::{lock, photos_of};
use crate::job::Job;
use crate::live::{FINAL_STATE, PageObserver};
use crate::pages::page_of;
use crate::settings::settings_of;
use crate::style::Style;
use crate::{export, output};
use artgs::Prepared;
use artgs::fit::DeviceChoice;
use artgs_io::{FolderLock, RunFolder};
use artgs_physical::export::ExportOptions;
use artgs_view::{Live, Page, Placement, Rerun, Server};
use std::path::Path;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};

/// What a page of the folder can start, or why it cannot. `photos` is the folder that the user named, if any.
pub(crate) fn rerun_of(run: &RunFolder, photos: Option<&Path>, style: Style) -> Result<Box<Rerun<'static>>, String> {
    if !run.has_found_parts() {
        let out = run.root().display();
        return Err(format!("{out} has no stages to resume; artgs reconstruct CAPTURE -o {out} --force makes them"));
    }
    if !artgs::run::finds_parts(&settings_of(run)?) {
        return Err("parts were learnt in training here, and corrections apply to parts found before it".into());
    }
    run.require_writable().map_err(|error| format!("{error}: no run can be started here"))?;
    let Some(photos) = photos_of(run, photos) else {
        return Err("the photos are not where they were; start artgs view with --capture".into());
    };
    Ok(boxed_rerun(run, &photos, DeviceChoice::Auto, style))
}

fn boxed_rerun(run: &RunFolder, photos: &Path, device: DeviceChoice, style: Style) -> Box<Rerun<'static>> {
    let (run, photos) = (run.clone(), photos.to_path_buf());
    Box::new(move |live| {
        rerun(&run, &photos, device, live, style).map_err(|failure| {
            // The page may be closed by now.
            output::error(&failure, style.json);
            failure.to_string()
        })
    })
}

/// The run, the exports that the page shows, and the page.
fn rerun(
    run: &RunFolder,
    photos: &Path,
    device: DeviceChoice,
    live: &Arc<Live>,
    style: Style,
) -> Result<Page, Failure> {
    /// Its name among the stages of the run.
    const EXPORT: &str = "export";
    let _lock = lock(run, "artgs view", style)?;
    let config = settings_of(run).map_err(Failure::bad)?;
    // Before the run, which removes exports of a replica that it replaces.
    let options = ExportOptions::of_last_export(run).map_err(Failure::bad_input)?;
    let device = device::choose(device, &config)?;
    let prepared = Prepared::again(run, photos, config, &mut PageObserver(Arc::clone(live))).map_err(Failure::of)?;
    Job::new(prepared, run, true, device, style).reconstruct(&mut PageObserver(Arc::clone(live)))?;
    live.stage_started(EXPORT);
    let begun = std::time::Instant::now();
    export::export_locked(run, &options, style)?;
    live.stage_finished(EXPORT, begun.elapsed().as_secs_f64(), false);
    page_of(run, Some(photos), style)
}

/// `artgs reconstruct --stop-after discover --view`: the page follows the first stages, shows what they found, takes
/// corrections and continues the run. `choice` is the choice that the device of the job was opened for. `lock` is that of the
/// folder; what the page starts later locks it again.
pub(crate) fn find_parts(job: &Job, choice: DeviceChoice, lock: FolderLock) -> Result<(), Failure> {
    let Job { run, style, .. } = job;
    let (style, photos) = (*style, job.photos());
    let mut page = Page::empty(&run.name());
    page.place(Placement::default());
    let rerun = photos.as_deref().map(|photos| boxed_rerun(run, photos, choice, style));
    let rerun = rerun.ok_or_else(|| "the images are in memory only".to_string());
    let server = Server::bind(page, None, Some(run.root().into())).map_err(Failure::failed)?;
    let server = Arc::new(server.with_rerun(rerun));
    let stop = stopped(&server)?;
    let failed = Mutex::new(None);
    let lock = Mutex::new(Some(lock));
    let first = |live: &Arc<Live>| {
        let found = job.find_parts(&mut PageObserver(Arc::clone(live)));
        lock.lock().unwrap_or_else(PoisonError::into_inner).take();
        let shown = found.and_then(|_| page_of(run, photos.as_deref(), style));
        shown.map_err(|failure| {
            let message = failure.to_string();
            failed.lock().unwrap_or_else(PoisonError::into_inner).replace((failure, Arc::clone(live)));
            message
        })
    };
    announce(&server.url(), true, style)?;
    std::thread::scope(|scope| {
        scope.spawn(|| server.run(&stop));
        server.follow(&first);
        let Some((failure, live)) = failed.lock().unwrap_or_else(PoisonError::into_inner).take() else { return Ok(()) };
        live.wait_until_end_is_shown(FINAL_STATE);
        stop.store(true, Ordering::Relaxed);
        Err(failure)
    })
}
