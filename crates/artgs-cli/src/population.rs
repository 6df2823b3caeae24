//! `artgs bench population`: random objects one by one, as child processes of this program.

use crate::args::{Bench, Parts};
use crate::bench::{device_of, watched};
use crate::commands::Style;
use crate::device;
use crate::failure::Failure;
use crate::output::say;
use crate::process;
use crate::seeds::Seeds;
use anyhow::{Context, anyhow};
use artgs_bench::population::{self, Event, Finished, Options, RESERVED, Row, Status, verdict};
use clap::ValueEnum;
use serde_json::{Value, json};
use std::io::{self, Write};
use std::path::Path;

/// What is given in place of a suite.
const NAME: &str = "population";

/// True if the random objects are meant; an error if other objects are named beside them.
pub(crate) fn is_meant(args: &Bench) -> Result<bool, Failure> {
    let named = args.what.iter().any(|what| what.as_os_str() == NAME);
    if named && args.what.len() > 1 {
        return Err(Failure::bad("population cannot be combined with other objects; run two benches"));
    }
    if named && Path::new(NAME).is_dir() {
        return Err(Failure::bad(format!(
            "{NAME} stands for the random objects and is a folder here: write ./{NAME} for the folder"
        )));
    }
    Ok(named)
}

pub(crate) fn run(args: &Bench, style: Style) -> Result<(), Failure> {
    let options = options(args)?;
    // Fails now instead of in every run.
    device::open(args.device)?;
    let program = process::program().context("cannot find the path of this program")?;
    let stop = watched()?;
    let finished = population::run(&options, program, &stop, &|event| show(&event, style))
        .map_err(|e| if e.is_bad_input() { Failure::BadInput(e.into()) } else { Failure::Failed(e.into()) })?;
    conclude(&finished, style)?;
    if finished.missing > 0 {
        let more = format!("interrupted with {} objects left; the same command continues", finished.missing);
        return Err(Failure::Interrupted(anyhow!(more)));
    }
    if finished.rows.iter().all(|row| row.status == Status::Failed) {
        let rows = args.out.join("rows");
        return Err(Failure::Failed(anyhow!("every object failed; {} has the reasons", rows.display())));
    }
    Ok(())
}

/// Refuses options that mean nothing here.
fn options(args: &Bench) -> Result<Options, Failure> {
    let of_others = [
        ("--variants", !args.variants.is_empty()),
        ("--variant-config", !args.variant_config.is_empty()),
        ("--parts given", args.parts == Some(Parts::Given)),
        ("--views", !args.views.is_empty()),
        ("--noise", !args.noise.is_empty()),
        ("--photo-seed", args.photo_seed.is_some()),
        ("--schedule", args.schedule.is_some()),
        ("--lpips", args.lpips.is_some()),
        ("--same-object", !args.same_object.is_empty()),
        ("--stand-in", !args.stand_in.is_empty()),
    ];
    if let Some((option, _)) = of_others.iter().find(|(_, given)| *given) {
        return Err(Failure::bad(format!("{option} cannot be used with a population; leave it out")));
    }
    let seeds = match &args.seeds {
        Some(Seeds::Of(seeds)) => seeds.clone(),
        Some(Seeds::Count(count)) => {
            return Err(Failure::bad(format!("--seeds of a population is a range: write --seeds 0..{count}")));
        }
        None => return Err(Failure::bad("a population needs its objects: add --seeds A..B, such as --seeds 0..100")),
    };
    if seeds.last().is_some_and(|last| *last >= RESERVED) {
        return Err(Failure::bad(artgs_bench::BenchError::ReservedSeeds));
    }
    if args.size.len() > 1 {
        return Err(Failure::bad("--size of a population is one number"));
    }
    let sensor = args.sensor.and_then(|sensor| sensor.to_possible_value());
    Ok(Options {
        out: args.out.clone(),
        seeds,
        sensor: sensor.map_or_else(|| Options::ANY.into(), |value| value.get_name().into()),
        size: args.size.first().copied(),
        stop_after_discover: args.stop_after.is_some(),
        timeout: args.timeout,
        jobs: args.jobs.get(),
        threads: args.threads.map(Into::into),
        device: device_of(args),
        keep: args.keep,
        force: args.force,
        retry_failed: args.retry_failed,
    })
}

fn show(event: &Event<'_>, style: Style) {
    if style.json {
        // A closed pipe does not stop the bench.
        let _ = say(event_json(event));
    } else if !style.quiet
        && let Some(text) = event_text(event)
    {
        let _ = writeln!(io::stderr(), "{text}");
    }
}

/// One line per object.
fn event_text(event: &Event<'_>) -> Option<String> {
    match event {
        Event::Kept { objects } => Some(format!("{objects} objects are complete already")),
        Event::Started { .. } => None,
        Event::Finished { row } => {
            let category = if row.category.is_empty() { String::new() } else { format!(" {}", row.category) };
            Some(format!("seed {}{category}: {}, {:.0} s", row.seed, verdict(row), row.make_seconds + row.seconds))
        }
    }
}

fn event_json(event: &Event<'_>) -> Value {
    match event {
        Event::Kept { objects } => json!({ "event": "kept", "objects": objects }),
        Event::Started { seed, number, of } => {
            json!({ "event": "object_started", "seed": seed, "number": number, "of": of })
        }
        Event::Finished { row } => json!({ "event": "object_finished", "row": row }),
    }
}

fn conclude(finished: &Finished, style: Style) -> Result<(), Failure> {
    let rows = &finished.rows;
    let count = |which: &dyn Fn(&Row) -> bool| rows.iter().filter(|row| which(row)).count();
    let right = count(&|row| row.right);
    let joints_right = count(&|row| row.joints_right);
    let refused = count(&|row| row.status == Status::Refused);
    let failed = count(&|row| row.status == Status::Failed);
    if style.json {
        return say(json!({
            "event": "result", "objects": rows.len(), "right": right, "joints_right": joints_right,
            "refused": refused, "failed": failed, "tables": finished.tables,
        }));
    }
    let Some([table, _]) = finished.tables.as_ref().filter(|_| !style.quiet) else { return Ok(()) };
    say(format!(
        "{} objects: {right} right, {joints_right} of them with all joints correct; {refused} refused, {failed} failed; \
         table in {}",
        rows.len(),
        table.display()
    ))
}
