//! `artgs reconstruct --view`: training in the browser as it goes.

use crate::commands::{Style, observed_by};
use crate::device::Chosen;
use crate::failure::Failure;
use crate::library::Config;
use crate::output::Report;
use crate::view::announce;
use artgs::observer::{Event, Observer, Snapshot};
use artgs_core::Capture;
use artgs_view::{Live, Placement, Server};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Tells a page what happens.
pub(crate) struct Onlooker(pub(crate) Arc<Live>);

impl Observer for Onlooker {
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

/// Time for a page to hear of the end.
pub(crate) const LAST_WORDS: Duration = Duration::from_secs(5);

/// Runs the method with a page that follows it; the page is told how it ended.
pub(crate) fn observed(
    capture: &Capture,
    out: &Path,
    config: &Config,
    resume: bool,
    device: &Chosen,
    style: Style,
) -> Result<Report, Failure> {
    let name = out.file_name().map_or("run".into(), |n| n.to_string_lossy().into_owned());
    let live = Arc::new(Live::new(&name, Placement::default()));
    let server = Server::bind_live(Arc::clone(&live), None).map_err(|e| Failure::Failed(e.into()))?;
    announce(&server.url(), true, style)?;
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| server.run(&stop));
        let result = observed_by(&mut Onlooker(Arc::clone(&live)), capture, out, config, resume, device, style);
        live.finish(result.as_ref().map(|_| ()).map_err(ToString::to_string));
        live.wait_until_end_is_shown(LAST_WORDS);
        stop.store(true, Ordering::Relaxed);
        result
    })
}
