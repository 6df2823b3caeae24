//! `artgs bench`: many runs as child processes of this program, and their report.

use crate::args::{Bench, Parts};
use crate::device;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::say;
use crate::population;
use crate::seeds::Seeds;
use crate::started;
use crate::style::Style;
use crate::suites::{self, Photos};
use crate::threads::use_threads;
use anyhow::{Context, anyhow};
use artgs::Config;
use artgs::evaluate::Lpips;
use artgs_bench::{
    Circumstances, Collected, Event, Files, Finished, Item, Options, Outcome, RunName, Source, Tools, Variant, counted,
    items_of_folder, measure, paper, stages::measure_stages,
};
use serde_json::{Value, json};
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

pub(crate) fn run(args: &Bench, style: Style) -> Result<(), Failure> {
    use_threads(args.threads)?;
    if population::is_meant(args)? {
        return population::run(args, style);
    }
    let seeds = seeds(args)?;
    let (items, variants) = (items(args)?, variants(args)?);
    // Fails now instead of in every run.
    device::open(args.device)?;
    let program = started::program().context("cannot find the path of this program")?.to_path_buf();
    let stop = interrupt::watched()?;
    let report = |event: Event<'_>| show(&event, style);
    let lpips = args.lpips.as_deref().map(Lpips::load).transpose().map_err(Failure::bad)?;
    let tools = Tools { program, measure: Arc::new(move |run, capture| measure(run, capture, lpips.as_ref())) };
    let finished = artgs_bench::run(&items, &variants, &options(args, seeds), &tools, &stop, &report)
        .map_err(|e| if e.is_bad_input() { Failure::BadInput(e.into()) } else { Failure::Failed(e.into()) })?;
    let Finished { records, missing } = finished;
    let all = Collected::new(&items, &variants, records);
    let files = artgs_bench::write_report(&args.out, &all, &circumstances(args)).map_err(anyhow::Error::from)?;
    if args.stages {
        write_stages(args, &items, &all, style)?;
    }
    conclude(&all, &files, style)?;
    if missing > 0 {
        let more = format!("interrupted with {} left; the same command continues", counted(missing, "run"));
        return Err(Failure::Interrupted(anyhow!(more)));
    }
    if all.records.iter().all(|r| r.measured().is_none()) {
        return Err(Failure::Failed(anyhow!("every run failed; {} lists the reasons", files.markdown.display())));
    }
    Ok(())
}

/// Measures the stages of all runs of the published method, and says which runs have none.
fn write_stages(args: &Bench, items: &[Item], all: &Collected, style: Style) -> Result<(), Failure> {
    let mut runs = Vec::new();
    for record in all.records.iter().filter(|r| r.measured().is_some() && r.settings.preset == "paper") {
        let name = format!("{} {} seed {}", record.variant, record.object, record.seed);
        let Some(item) = items.iter().find(|i| i.name == record.object) else { continue };
        let capture = match &item.source {
            Source::Folder(path) => path.clone(),
            Source::Procedural { .. } => args.out.join("captures").join(&item.name),
        };
        match measure_stages(&args.out.join(&record.folder), &capture) {
            Ok(measures) => runs.push((name, measures)),
            Err(why) if !style.quiet => drop(writeln!(io::stderr(), "{name}: {why}")),
            Err(_) => {}
        }
    }
    let page = artgs_bench::stages::write_stages(&args.out, &started::line(), &runs).map_err(anyhow::Error::from)?;
    if !style.quiet && !style.json {
        say(format!("measures of the stages of {} in {}", counted(runs.len(), "run"), page.display()))?;
    }
    Ok(())
}

/// Runs of every object; options of a population are refused.
fn seeds(args: &Bench) -> Result<u64, Failure> {
    if args.sensor.is_some() || args.keep {
        return Err(Failure::bad("--sensor and --keep are for `artgs bench population`"));
    }
    match &args.seeds {
        None => Ok(1),
        Some(Seeds::Count(count)) => Ok(*count),
        Some(Seeds::Of(_)) => {
            Err(Failure::bad("--seeds A..B is for `artgs bench population`; here --seeds is a number of runs"))
        }
    }
}

/// True if runs are given the number of parts.
fn parts_given(args: &Bench) -> bool {
    args.parts != Some(Parts::Auto)
}

fn options(args: &Bench, seeds: u64) -> Options {
    Options {
        out: args.out.clone(),
        seeds,
        timeout: args.timeout,
        jobs: args.jobs.get(),
        threads: args.threads.map(Into::into),
        parts_given: parts_given(args),
        stop_after_discover: args.stop_after.is_some(),
        device: args.named_device(),
        force: args.force,
        retry_failed: args.retry_failed,
    }
}

fn circumstances(args: &Bench) -> Circumstances {
    let cores = || std::thread::available_parallelism().map_or(1, Into::into);
    Circumstances {
        command: started::line(),
        threads: args.threads.map_or_else(cores, Into::into),
        jobs: args.jobs.get(),
        parts_given: parts_given(args),
        stopped_after_discover: args.stop_after.is_some(),
    }
}

/// Objects of the suites and folders named, in that order.
fn items(args: &Bench) -> Result<Vec<Item>, Failure> {
    let Bench { views, size, noise, .. } = args;
    let photos =
        Photos { views: views.clone(), size: size.clone(), noise: noise.clone(), seed: args.photo_seed.unwrap_or(0) };
    let (mut items, mut of_suites) = (Vec::new(), false);
    for what in &args.what {
        let suite = what.to_str().and_then(|name| suites::suite(name, &photos));
        if suite.is_some() && what.is_dir() {
            let name = what.display();
            return Err(Failure::bad(format!(
                "{name} is a suite or object and a folder here: write ./{name} for the folder"
            )));
        }
        match suite {
            Some(suite) => {
                items.extend(suite.map_err(Failure::bad)?);
                of_suites = true;
            }
            None => items.extend(folder_items(what)?),
        }
    }
    let as_they_are = views.is_empty() && size.is_empty() && noise.is_empty();
    if args.stages && !args.variants.iter().any(|v| v.starts_with("paper")) {
        return Err(Failure::bad(
            "--stages is for variants of the paper, of which there is none here: add --variants paper",
        ));
    }
    if args.schedule.is_some() && !args.variants.iter().any(|v| v.starts_with("paper")) {
        return Err(Failure::bad("--schedule is for variants of the paper, of which there is none here"));
    }
    if !of_suites && !as_they_are {
        let why = "--views, --size and --noise are for suites; captures in folders are taken as they are";
        return Err(Failure::bad(why));
    }
    for (pairs, same) in [(&args.same_object, true), (&args.stand_in, false)] {
        for (name, object) in pairs {
            relate(&mut items, name, object, same)?;
        }
    }
    Ok(items)
}

fn folder_items(folder: &Path) -> Result<Vec<Item>, Failure> {
    if !folder.is_dir() {
        let (shown, known) = (folder.display(), suites::known());
        return Err(Failure::bad(format!("{shown}: neither a folder nor a suite nor an object; {known}")));
    }
    items_of_folder(folder).map_err(Failure::bad)
}

/// Says what an object is, or stands for, in the paper.
fn relate(items: &mut [Item], name: &str, object: &str, same: bool) -> Result<(), Failure> {
    let flag = if same { "--same-object" } else { "--stand-in" };
    let Some(item) = items.iter_mut().find(|i| i.name == name) else {
        return Err(Failure::bad(format!("{flag} {name}={object}: no object is called `{name}`")));
    };
    let Some(found) = paper::find(object) else {
        let known: Vec<&str> = paper::OBJECTS.iter().map(|o| o.id).collect();
        let known = known.join(", ");
        return Err(Failure::bad(format!("{flag} {name}={object}: the paper's objects are {known}")));
    };
    (item.stands_for, item.same_object) = (Some(found), same);
    Ok(())
}

fn variants(args: &Bench) -> Result<Vec<Variant>, Failure> {
    let default = ["full".to_string()];
    let none = args.variants.is_empty() && args.variant_config.is_empty();
    let mut variants = Vec::new();
    for name in if none { &default[..] } else { &args.variants } {
        let known = || format!("no variant is called `{name}`; there are {}", suites::variant_names().join(", "));
        variants.push(suites::variant(name, args.schedule).ok_or_else(|| Failure::bad(known()))?);
    }
    for (name, file) in &args.variant_config {
        let text = std::fs::read_to_string(file).map_err(|e| Failure::bad(format!("{file}: {e}")))?;
        let config = Config::default().overridden_by(&text).map_err(|e| Failure::bad(format!("{file}: {e}")))?;
        let needs_parts = config.check_part_count().is_err();
        let description = format!("settings of {file}");
        variants.push(Variant { needs_parts, ..Variant::with_overlay(name, "default", &description, text) });
    }
    Ok(variants)
}

fn show(event: &Event<'_>, style: Style) {
    if style.json {
        // A closed pipe does not stop the bench.
        let _ = say(event_json(event));
    } else if !style.quiet {
        let _ = writeln!(io::stderr(), "{}", event_text(event));
    }
}

fn event_text(event: &Event<'_>) -> String {
    match event {
        Event::Kept { runs: 1 } => "1 run is complete already".into(),
        Event::Kept { runs } => format!("{runs} runs are complete already"),
        Event::Rendering { object } => format!("rendering the capture of {object}"),
        Event::Started { run, number, of } => format!("run {number} of {of}: {run}"),
        Event::Finished { run, outcome: Outcome::Done(_), seconds } => format!("{run}: done in {seconds:.0} s"),
        Event::Finished { run, outcome: Outcome::Failed(reason), .. } => format!("{run}: failed, {reason}"),
    }
}

fn event_json(event: &Event<'_>) -> Value {
    let name = |run: &RunName<'_>| json!({ "variant": run.variant, "object": run.object, "seed": run.seed });
    match event {
        Event::Kept { runs } => json!({ "event": "kept", "runs": runs }),
        Event::Rendering { object } => json!({ "event": "rendering", "object": object }),
        Event::Started { run, number, of } => {
            json!({ "event": "run_started", "run": name(run), "number": number, "of": of })
        }
        Event::Finished { run, outcome, seconds } => {
            let failure = if let Outcome::Failed(reason) = outcome { Some(reason) } else { None };
            json!({ "event": "run_finished", "run": name(run), "failure": failure, "seconds": seconds })
        }
    }
}

fn conclude(all: &Collected, files: &Files, style: Style) -> Result<(), Failure> {
    let failed = all.records.iter().filter(|r| r.measured().is_none()).count();
    let runs = all.records.len();
    if style.json {
        return say(json!({
            "event": "result", "runs": runs, "failed": failed,
            "markdown": files.markdown, "json": files.json, "html": files.html,
        }));
    }
    if !style.quiet {
        say(artgs_bench::overview(all).trim_end())?;
        say(format!("{runs} runs, {failed} failed; tables and plots in {}", files.html.display()))?;
    }
    Ok(())
}
