//! An own observer: prints the stages and their times, and looks at the Gaussians once.

#![allow(clippy::print_stdout, reason = "an example prints")]

use artgs::observer::Snapshot;
use artgs::prelude::*;
use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};

#[derive(Default)]
struct Printer {
    has_seen_gaussians: bool,
}

impl Observer for Printer {
    fn event(&mut self, event: Event) {
        match event {
            Event::StageStarted { stage } => println!("{stage} ..."),
            Event::StageFinished { stage, seconds, .. } => println!("{stage}: {seconds:.1} s"),
            Event::Warning { message } => println!("warning: {message}"),
            Event::Progress { .. } | Event::Note { .. } => {}
        }
    }

    fn wants_snapshot(&mut self) -> bool {
        !self.has_seen_gaussians
    }

    fn snapshot(&mut self, snapshot: &Snapshot<'_>) {
        self.has_seen_gaussians = true;
        println!("{} Gaussians after step {} of {}", snapshot.splats.len(), snapshot.step, snapshot.total);
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let options = CabinetOptions { views: 20, test_views: 2, size: 96, ..CabinetOptions::default() };
    let (capture, _) = cabinet_capture(&options)?;
    let mut config = Config { parts: 3.into(), ..Config::default() };
    config.articulate.steps = 40;
    config.surface.resolution = 80.0;
    let prepared = Request { config, ..Request::new(Input::Images(capture)) }.prepare(&mut NullObserver)?;
    let made = Reconstruction::new(&prepared).compute(&mut Printer::default())?;
    println!("{}", made.summary);
    Ok(())
}
