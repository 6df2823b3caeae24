//! `artgs reconstruct --view`: training in the browser while it runs.

use crate::browser::announce;
use crate::failure::Failure;
use crate::job::Job;
use crate::output::Report;
use artgs::observer::{Event, Observer, Snapshot};
use artgs_view::{Live, Placement, Server};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Passes events and snapshots of a run to a page.
pub(crate) struct PageObserver(pub(crate) Arc<Live>);

impl Observer for PageObserver {
    fn event(&mut self, event: Event) {
        match event {
            Event::StageStarted { stage } => self.0.stage_started(&stage),
            Event::Progress { stage, step, total, loss, psnr, gaussians } => {
                self.0.event(&stage, [step, total], loss, psnr, gaussians);
            }
            Event::StageFinished { stage, seconds, reused } => self.0.stage_finished(&stage, seconds, reused),
            Event::Warning { .. } | Event::Note { .. } => {}
        }
    }

    fn wants_snapshot(&mut self) -> bool {
        self.0.wants_splats()
    }

    fn snapshot(&mut self, snapshot: &Snapshot<'_>) {
        self.0.update_splats(snapshot.splats, snapshot.labels);
    }
}

/// Time for a page to fetch the end of a run.
pub(crate) const FINAL_STATE: Duration = Duration::from_secs(5);

/// Reconstructs with a page that follows the run and its end.
pub(crate) fn reconstruct(job: &Job) -> Result<Report, Failure> {
    let live = Arc::new(Live::new(&job.run.name(), Placement::default()));
    let server = Server::bind_live(Arc::clone(&live), None).map_err(Failure::failed)?;
    announce(&server.url(), true, job.style)?;
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| server.run(&stop));
        let result = job.reconstruct(&mut PageObserver(Arc::clone(&live)));
        live.finish(result.as_ref().map(|_| ()).map_err(ToString::to_string));
        live.wait_until_end_is_shown(FINAL_STATE);
        stop.store(true, Ordering::Relaxed);
        result
    })
}
