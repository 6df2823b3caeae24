//! Two recordings to a replica in a folder, with progress; started again, it continues where it was stopped.
//!
//! `cargo run --release --example recordings -- CLOSED OPEN FOLDER`

#![allow(clippy::print_stdout, reason = "an example prints")]

use artgs::prelude::*;

struct Stages;

impl Observer for Stages {
    fn event(&mut self, event: Event) {
        match event {
            Event::StageFinished { stage, seconds, reused } => println!("{stage}: {seconds:.1} s, reused: {reused}"),
            Event::Warning { message } | Event::Note { message } => println!("{message}"),
            Event::StageStarted { .. } | Event::Progress { .. } => {}
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    let [closed, open, folder] = &paths[..] else { return Err("give CLOSED OPEN FOLDER".into()) };
    let request = Request::new(Input::new(&[closed, open])?);
    let options = RunOptions { earlier: Earlier::Resume, ..RunOptions::default() };
    let made = request.run_with(folder, &options, &mut Stages)?;
    println!("{}", made.summary);
    Ok(())
}
