//! `artgs bench population`: random objects one by one, as child processes of this program.

use crate::args::{Bench, Parts};
use crate::device;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::say;
use crate::seeds::Seeds;
use crate::started;
use crate::style::Style;
use anyhow::{Context, anyhow};
use artgs_bench::counted;
use artgs_bench::population::report::Summary;
use artgs_bench::population::{self, Event, Finished, Options, RESERVED, Status, verdict};
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
    let program = started::program().context("cannot find the path of this program")?;
    let stop = interrupt::watched()?;
    let finished = population::run(&options, program, &stop, &|event| show(&event, style))
        .map_err(|e| if e.is_bad_input() { Failure::BadInput(e.into()) } else { Failure::Failed(e.into()) })?;
    conclude(&finished, style)?;
    if finished.missing > 0 {
        let more = format!("interrupted with {} left; the same command continues", counted(finished.missing, "object"));
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
        ("--stages", args.stages),
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
            return Err(Failure::bad(format!(
                "--seeds of a population is a range or a list: write --seeds 0..{count} for the seeds below {count}, or --seeds \
                 {count}..={count} for seed {count} alone"
            )));
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
        still: args.still,
        stop_after_discover: args.stop_after.is_some(),
        timeout: args.timeout,
        jobs: args.jobs.get(),
        threads: args.threads.map(Into::into),
        device: args.named_device(),
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
        Event::Kept { objects, failed } => Some(kept(*objects, *failed)),
        Event::Started { .. } => None,
        Event::Finished { row } => {
            let category = if row.category.is_empty() { String::new() } else { format!(" {}", row.category) };
            Some(format!("seed {}{category}: {}, {:.0} s", row.seed, verdict(row), row.make_seconds + row.seconds))
        }
    }
}

/// What earlier calls have done: at least one of the numbers is above 0.
fn kept(objects: usize, failed: usize) -> String {
    let verb = if objects == 1 { "is" } else { "are" };
    let complete = (objects > 0).then(|| format!("{} {verb} complete already", counted(objects, "object")));
    let them = if failed == 1 { "it" } else { "them" };
    let again = (failed > 0).then(|| format!("{failed} failed earlier; --retry-failed runs {them} again"));
    complete.into_iter().chain(again).collect::<Vec<_>>().join(", ")
}

fn event_json(event: &Event<'_>) -> Value {
    match event {
        Event::Kept { objects, failed } => json!({ "event": "kept", "objects": objects, "failed": failed }),
        Event::Started { seed, number, of } => {
            json!({ "event": "object_started", "seed": seed, "number": number, "of": of })
        }
        Event::Finished { row } => json!({ "event": "object_finished", "row": row }),
    }
}

fn conclude(finished: &Finished, style: Style) -> Result<(), Failure> {
    let summary = Summary::new(&finished.rows, None);
    if style.json {
        let undecidable = &summary.undecidable;
        return say(json!({
            "event": "result", "objects": summary.objects, "decidable": summary.right.of, "right": summary.right.count,
            "joints_right": summary.joints_right.count, "refused": summary.refused, "failed": summary.failed,
            "undecidable": undecidable.right.of, "undecidable_right": undecidable.right.count, "not_made": summary.not_made,
            "tables": finished.tables,
        }));
    }
    let Some([table, _]) = finished.tables.as_ref().filter(|_| !style.quiet) else { return Ok(()) };
    say(format!("{}; table in {}", closing(&summary), table.display()))
}

/// The numbers of all rows in one line. Undecidable objects, and those that could not be made, are apart as in the report.
fn closing(summary: &Summary) -> String {
    let (right, undecidable) = (&summary.right, &summary.undecidable.right);
    let mut text = format!(
        "{}: {} of {} right, {} of them with all joints correct; {} refused, {} failed",
        counted(summary.objects, "object"),
        right.count,
        counted(right.of, "decidable object"),
        summary.joints_right.count,
        summary.refused,
        summary.failed
    );
    if undecidable.of > 0 {
        text +=
            &format!("; {} apart, {} of them right", counted(undecidable.of, "undecidable object"), undecidable.count);
    }
    if summary.not_made > 0 {
        text += &format!("; {} could not be made", summary.not_made);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_bench::population::Row;

    #[test]
    fn earlier_objects_are_counted_in_words() {
        assert_eq!(kept(1, 0), "1 object is complete already");
        assert_eq!(kept(3, 1), "3 objects are complete already, 1 failed earlier; --retry-failed runs it again");
        assert_eq!(kept(0, 2), "2 failed earlier; --retry-failed runs them again");
    }

    #[test]
    fn undecidable_objects_are_not_among_the_wrong_ones() {
        let right =
            Row { category: "chest".into(), decidable: true, right: true, joints_right: true, ..Row::default() };
        let wrong = Row { right: false, joints_right: false, ..right.clone() };
        let hidden = Row { decidable: false, ..wrong.clone() };
        let failed = Row { status: Status::Failed, ..Row::default() };
        let rows = [right.clone(), wrong, hidden, failed];
        assert_eq!(
            closing(&Summary::new(&rows, None)),
            "4 objects: 1 of 2 decidable objects right, 1 of them with all joints correct; 0 refused, 0 failed; \
             1 undecidable object apart, 0 of them right; 1 could not be made"
        );
        let alone = closing(&Summary::new(&[right], None));
        assert_eq!(
            alone,
            "1 object: 1 of 1 decidable object right, 1 of them with all joints correct; 0 refused, 0 failed"
        );
    }
}
