use super::*;
use crate::testing::write_truth;
use artgs_core::{Replica, State};
use artgs_io::{load_ground_truth, write_mesh_ply, write_replica};
use std::sync::Arc;

/// A capture that contains only its ground truth, and a program that answers every run with an exact replica and a line in
/// `calls`, after it runs the shell script `behaviour`.
struct Fake {
    root: tempfile::TempDir,
    tools: Tools,
}

impl Fake {
    fn new(behaviour: &str) -> Self {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        for object in ["one", "two"] {
            let gt = at("captures").join(object).join("gt");
            write_truth(&gt, 1);
            for (state, part) in ["start", "end"].iter().flat_map(|s| ["", "_static", "_dynamic"].map(|p| (s, p))) {
                let mesh = artgs_core::Mesh {
                    vertices: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
                    triangles: vec![[0, 1, 2]],
                    ..artgs_core::Mesh::default()
                };
                write_mesh_ply(&gt.join(format!("{state}/{state}{part}_rotate.ply")), &mesh).unwrap();
            }
        }
        perfect_replica(&at("perfect"), &at("captures/one/gt"));
        let script = format!(
            "#!/bin/sh\necho \"$@\" >> '{root}/calls'\n{behaviour}\nwhile [ \"$1\" != -o ]; do shift; done\n\
             mkdir -p \"$2\" && cp -r '{root}/perfect/.' \"$2\"\n",
            root = root.path().display()
        );
        // The copy is written by a process of its own: a program that any thread's child still has open for writing cannot
        // be started.
        std::fs::write(at("fake.txt"), script).unwrap();
        let copy = "cat \"$0/fake.txt\" > \"$0/fake.sh\" && chmod +x \"$0/fake.sh\"";
        let copied = std::process::Command::new("sh").args(["-c", copy]).arg(root.path()).status().unwrap();
        assert!(copied.success());
        let tools = Tools { program: at("fake.sh"), measure: Arc::new(quickly) };
        Self { root, tools }
    }

    fn options(&self) -> Options {
        Options {
            out: self.root.path().join("out"),
            seeds: 2,
            timeout: None,
            jobs: 1,
            threads: None,
            parts_given: true,
            stop_after_discover: false,
            device: None,
            force: false,
            retry_failed: false,
        }
    }

    fn items(&self) -> Vec<Item> {
        crate::items_of_folder(&self.root.path().join("captures")).unwrap()
    }

    fn run_with(&self, variants: &[Variant], options: &Options) -> Result<Finished, BenchError> {
        run(&self.items(), variants, options, &self.tools, &AtomicBool::new(false), &|_| ())
    }

    fn run(&self, options: &Options) -> Finished {
        self.run_with(&[full()], options).unwrap()
    }

    fn calls(&self) -> Vec<String> {
        let text = std::fs::read_to_string(self.root.path().join("calls")).unwrap_or_default();
        text.lines().map(String::from).collect()
    }

    fn forget_calls(&self) {
        std::fs::write(self.root.path().join("calls"), "").unwrap();
    }
}

fn full() -> Variant {
    Variant::preset("full", "default", "default settings")
}

/// Reads what the run wrote, without scoring, which takes seconds.
fn quickly(folder: &Path, _: &Path) -> Result<crate::Measured, String> {
    let metrics = crate::measure::read_metrics(folder)?;
    artgs_io::read_replica(folder).map_err(|e| e.to_string())?;
    Ok(crate::Measured { metrics, ..crate::testing::measured(0.5) })
}

fn perfect_replica(folder: &Path, gt: &Path) {
    let truth = load_ground_truth(gt).unwrap();
    let replica = Replica::new(&truth.joints);
    for (part, meshes) in replica.parts.iter().zip(std::iter::once(&truth.fixed).chain(&truth.movable)) {
        State::ALL.iter().for_each(|s| write_mesh_ply(&folder.join(&part.meshes[*s]), &meshes[*s]).unwrap());
    }
    State::ALL.iter().for_each(|s| write_mesh_ply(&folder.join(&replica.whole[*s]), &truth.whole[*s]).unwrap());
    write_replica(folder, &replica).unwrap();
    let metrics = json!({ "parts": 2, "gaussians": 5, "test": [{ "psnr": 30.0, "ssim": 0.9, "views": 2 }, null],
                          "total_seconds": 3.0, "peak_memory_mib": 99.0 });
    std::fs::write(folder.join("metrics.json"), metrics.to_string()).unwrap();
}

fn reasons(finished: &Finished) -> Vec<&str> {
    let reason = |r: &'_ Record| matches!(r.outcome, Outcome::Failed(_));
    let failed = finished.records.iter().filter(|r| reason(r));
    failed.map(|r| if let Outcome::Failed(reason) = &r.outcome { reason.as_str() } else { "" }).collect()
}

#[test]
fn runs_are_made_scored_and_not_made_again() {
    let fake = Fake::new("");
    let options = fake.options();
    let first = fake.run(&options);
    assert_eq!((first.records.len(), first.missing), (4, 0));
    let names: Vec<_> = first.records.iter().map(|r| (r.object.as_str(), r.seed)).collect();
    assert_eq!(names, [("one", 0), ("one", 1), ("two", 0), ("two", 1)]);
    for record in &first.records {
        let measured = record.measured().unwrap();
        assert_eq!((measured.metrics.total_seconds, measured.metrics.peak_memory_mib), (3.0, Some(99.0)));
    }
    let calls = fake.calls();
    assert_eq!(calls.len(), 4);
    assert!(calls[0].starts_with("reconstruct ") && calls[0].contains("captures/one -o "), "{}", calls[0]);
    assert!(calls[0].ends_with("--preset default --parts 2 --seed 0 --json"), "{}", calls[0]);
    assert!(calls[1].contains("captures/two") && calls[2].ends_with("--seed 1 --json"), "{calls:?}");

    let second = fake.run(&options);
    assert_eq!(fake.calls().len(), 4, "nothing is made again");
    assert_eq!(second.records, first.records, "records come back from files as they were");

    // As if the benchmark had been killed during this run.
    std::fs::remove_file(options.out.join("runs/full/two/seed_1/run.json")).unwrap();
    fake.forget_calls();
    assert_eq!(fake.run(&options).records, first.records);
    assert_eq!(fake.calls().len(), 1);
    assert!(fake.calls()[0].contains("captures/two") && fake.calls()[0].contains("--seed 1"));

    // More seeds and variants are added to existing runs.
    fake.forget_calls();
    let more = Options { seeds: 3, jobs: 2, threads: None, ..options.clone() };
    let overlay = Variant::with_overlay("wide", "paper", "wider", "[discover]\nrounds = 7\n".into());
    let third = fake.run_with(&[full(), overlay], &more).unwrap();
    assert_eq!((third.records.len(), fake.calls().len()), (12, 8));
    let wide = fake.calls().into_iter().find(|c| c.contains("--preset paper")).unwrap();
    assert!(wide.contains("--config ") && wide.contains("variants/wide.toml"), "{wide}");

    // Another device counts as another setting.
    let elsewhere = Options { device: Some("gpu:1".into()), ..options };
    let refused = fake.run_with(&[full()], &elsewhere).unwrap_err().to_string();
    assert!(refused.contains("device"), "{refused}");
    fake.forget_calls();
    fake.run(&Options { force: true, ..elsewhere });
    let calls = fake.calls();
    assert!(calls.len() == 4 && calls.iter().all(|c| c.ends_with("--device gpu:1 --json")), "{calls:?}");
}

#[test]
fn a_failing_run_is_a_row_with_its_reason() {
    let fake = Fake::new("case \"$*\" in *captures/one*'--seed 1'*) echo 'error: no depth'; exit 2;; esac");
    let options = fake.options();
    let finished = fake.run(&options);
    assert_eq!((finished.records.len(), finished.missing), (4, 0));
    assert_eq!(reasons(&finished), ["exit code 2: error: no depth"]);
    assert!(options.out.join("runs/full/one/seed_1.log").is_file());
    fake.forget_calls();
    assert_eq!(fake.run(&options).records, finished.records);
    assert_eq!(fake.calls().len(), 0, "a failed run is finished");
    fake.run(&Options { retry_failed: true, ..options });
    assert_eq!(fake.calls().len(), 1);
}

#[test]
fn slow_runs_and_runs_without_results_fail() {
    let slow = Fake::new("case \"$*\" in *captures/one*) sleep 30;; esac");
    let options = Options { seeds: 1, timeout: Some(Duration::from_secs(2)), ..slow.options() };
    let finished = slow.run(&options);
    assert_eq!(reasons(&finished), ["stopped after the time limit of 2 s"]);
    assert!(finished.records[1].measured().is_some());
    let empty = Fake::new("exit 0");
    let finished = empty.run(&Options { seeds: 1, ..empty.options() });
    assert!(reasons(&finished).iter().all(|r| r.contains("metrics.json")) && finished.records.len() == 2);
}

#[test]
fn a_second_benchmark_in_the_same_folder_is_refused() {
    let fake = Fake::new("");
    let options = Options { seeds: 1, ..fake.options() };
    fake.run(&options);
    let lock = artgs_io::FolderLock::take(&options.out, "artgs bench").unwrap();
    let refused = fake.run_with(&[full()], &options).unwrap_err();
    assert!(refused.is_bad_input() && refused.to_string().contains("in use by process"), "{refused}");
    drop(lock);
    fake.run(&options);
}

#[test]
fn other_settings_are_refused_unless_forced() {
    let fake = Fake::new("");
    let options = Options { seeds: 1, ..fake.options() };
    fake.run(&options);
    let other = Options { threads: Some(3), ..options.clone() };
    let refused = fake.run_with(&[full()], &other).unwrap_err();
    let message = refused.to_string();
    assert!(
        refused.is_bad_input() && message.contains("another threads (2 such runs)") && message.contains("--force"),
        "{message}"
    );
    fake.forget_calls();
    assert_eq!(fake.run(&Options { force: true, ..other }).records.len(), 2);
    assert!(fake.calls().len() == 2 && fake.calls()[0].contains("--threads 3"), "{:?}", fake.calls());
}

#[test]
fn a_stopped_benchmark_is_resumed() {
    let fake = Fake::new("");
    let options = fake.options();
    let stop = AtomicBool::new(false);
    let after_one = |event: Event<'_>| {
        if matches!(event, Event::Finished { .. }) {
            stop.store(true, Ordering::Relaxed);
        }
    };
    let stopped = run(&fake.items(), &[full()], &options, &fake.tools, &stop, &after_one).unwrap();
    assert_eq!((stopped.records.len(), stopped.missing), (1, 3));
    let rest = fake.run(&options);
    assert_eq!((rest.records.len(), rest.missing, fake.calls().len()), (4, 0, 4));
}

#[test]
fn foreign_folders_are_refused() {
    let fake = Fake::new("");
    let options = fake.options();
    std::fs::create_dir_all(&options.out).unwrap();
    std::fs::write(options.out.join("thesis.tex"), "x").unwrap();
    assert!(matches!(fake.run_with(&[full()], &options), Err(BenchError::ForeignFolder(_))));
}

#[test]
fn procedural_objects_are_rendered_once() {
    let fake = Fake::new("");
    let truth = fake.root.path().join("captures/one/gt");
    let options = Options { seeds: 1, ..fake.options() };
    let shots = Arc::new(AtomicUsize::new(0));
    let bench = |settings: &str, fails: bool| {
        let (truth, shots) = (truth.clone(), shots.clone());
        let write = move |folder: &Path| {
            shots.fetch_add(1, Ordering::Relaxed);
            let status = std::fs::create_dir_all(folder).map_err(|e| e.to_string()).and_then(|()| {
                let copy = std::process::Command::new("cp").arg("-r").arg(&truth).arg(folder).status();
                copy.map_err(|e| e.to_string())
            })?;
            if fails || !status.success() { Err("no film".into()) } else { Ok(()) }
        };
        let item = Item {
            name: "procedural".into(),
            source: Source::Procedural { settings: settings.into(), write: Box::new(write) },
            parts: Some(2),
            stands_for: None,
            same_object: false,
            noise: Some("0.01".into()),
        };
        let forced = Options { force: true, ..options.clone() };
        run(&[item], &[full()], &forced, &fake.tools, &AtomicBool::new(false), &|_| ()).unwrap()
    };
    assert!(bench("10 views", false).records[0].measured().is_some());
    std::fs::remove_file(options.out.join("runs/full/procedural/seed_0/run.json")).unwrap();
    assert!(bench("10 views", false).records[0].measured().is_some());
    assert_eq!(shots.load(Ordering::Relaxed), 1);
    assert_eq!(reasons(&bench("20 views", true)), ["could not be rendered: no film"]);
    assert_eq!(shots.load(Ordering::Relaxed), 2);
}

#[test]
fn only_variants_that_need_the_number_of_parts_get_it_if_it_is_to_be_found() {
    let fake = Fake::new("");
    let options = Options { seeds: 1, parts_given: false, ..fake.options() };
    let paper = Variant::preset("paper", "paper", "as published");
    let finished = fake.run_with(&[full(), paper], &options).unwrap();
    let given: Vec<_> = finished.records.iter().map(|r| r.settings.parts).collect();
    assert_eq!(given, [None, None, Some(2), Some(2)]);
    let stopped = Options { stop_after_discover: true, out: fake.root.path().join("stopped"), ..options };
    assert_eq!(fake.run(&stopped).records[0].settings.arguments, ["--stop-after", "discover"]);
    assert!(fake.calls()[4].ends_with("--json --stop-after discover"), "{:?}", fake.calls());
    let counted = |call: &String| call.contains("--parts");
    assert_eq!(fake.calls()[..4].iter().map(counted).collect::<Vec<_>>(), [false, false, true, true]);
}

#[test]
fn a_perfect_replica_is_measured_so() {
    let fake = Fake::new("");
    let tools = Tools { measure: Arc::new(|run, capture| crate::measure(run, capture, None)), ..fake.tools.clone() };
    let options = Options { seeds: 1, ..fake.options() };
    let item = fake.items().into_iter().take(1).collect::<Vec<_>>();
    let finished = run(&item, &[full()], &options, &tools, &AtomicBool::new(false), &|_| ()).unwrap();
    let measured = finished.records[0].measured().unwrap();
    assert!(measured.scores.joints.axis_angle_deg.unwrap() < 1e-9 && measured.scores.counts.found == 1);
    assert!(measured.scores.whole.mean.f_score > 0.9 && measured.scores.whole.mean.chamfer < 2.0);
    assert!(options.out.join("runs/full/one/seed_0/scores.json").is_file());
}
