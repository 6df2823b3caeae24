#![allow(clippy::unwrap_used, reason = "tests")]

use super::super::read::read_rows;
use super::super::testing::{cupboard, found_as};
use super::*;
use artgs::discover::Discovery;
use artgs_core::{Splats, State};
use artgs_io::{RunFolder, write_atomic, write_mesh_ply, write_splat_ply};
use serde_json::json;
use std::ops::Range;
use std::sync::Mutex;

/// A program that makes the capture of a cupboard and answers every run with its exact parts, after it writes its arguments into
/// `calls` and runs the shell script `behaviour`.
struct Fake {
    root: tempfile::TempDir,
    program: PathBuf,
}

impl Fake {
    fn new(behaviour: &str) -> Self {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        write_truth(&at("capture/gt"));
        write_run(&RunFolder::new(at("run")), &found_as(&cupboard(), &[1, 2]));
        let script = format!(
            "#!/bin/sh\necho \"$@\" >> '{root}/calls'\nverb=$1\nseed=$3\n{behaviour}\n\
             while [ \"$1\" != -o ]; do shift; done\nmkdir -p \"$2\"\n\
             if [ $verb = synth ]; then cp -r '{root}/capture/.' \"$2\"; else cp -r '{root}/run/.' \"$2\"; fi\n",
            root = root.path().display()
        );
        // Written by a process of its own: a program that any thread's child has open for writing cannot be started.
        std::fs::write(at("fake.txt"), script).unwrap();
        let copy = "cat \"$0/fake.txt\" > \"$0/fake.sh\" && chmod +x \"$0/fake.sh\"";
        let copied = std::process::Command::new("sh").args(["-c", copy]).arg(root.path()).status().unwrap();
        assert!(copied.success());
        Self { program: at("fake.sh"), root }
    }

    fn options(&self, seeds: Range<u64>) -> Options {
        Options {
            out: self.root.path().join("out"),
            seeds: seeds.collect(),
            sensor: Options::ANY.into(),
            still: false,
            size: None,
            stop_after_discover: true,
            timeout: None,
            jobs: 1,
            threads: None,
            device: None,
            keep: false,
            force: false,
            retry_failed: false,
        }
    }

    fn run(&self, options: &Options) -> Result<Finished, BenchError> {
        run(options, &self.program, &AtomicBool::new(false), &|_| ())
    }

    /// The commands since the last call.
    fn calls(&self) -> Vec<String> {
        let path = self.root.path().join("calls");
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        let _ = std::fs::remove_file(path);
        text.lines().map(String::from).collect()
    }
}

fn write_truth(gt: &Path) {
    let truth = cupboard();
    let joint = |kind: &str, axis: [i32; 3], to: f64| json!({ "type": kind, "axis": { "o": [0, 0, 0], "d": axis }, kind: { "l": 0, "r": to } });
    let trans = json!({
        "trans_info": [joint("rotate", [0, 0, 1], -60.0), joint("translate", [0, -1, 0], 0.4)],
        "population": { "category": "cupboard", "sensor": "exact", "features": ["look-alike"], "undecidable": [] },
    });
    write_atomic(&gt.join("trans.json"), trans.to_string().as_bytes()).unwrap();
    for state in State::ALL {
        let name = state.name();
        let file = |part: &str| gt.join(format!("{name}/{name}{part}_rotate.ply"));
        write_mesh_ply(&file(""), &truth.whole[state]).unwrap();
        write_mesh_ply(&file("_static"), &truth.fixed[state]).unwrap();
        for (index, mesh) in truth.movable.iter().enumerate() {
            write_mesh_ply(&file(&format!("_dynamic_{index}")), &mesh[state]).unwrap();
        }
    }
}

fn write_run(run: &RunFolder, found: &Discovery) {
    for (state, cloud) in found.clouds.enumerate() {
        let mut splats = Splats::empty(0);
        for point in &cloud.points {
            splats.means.push(point.to_array());
            splats.rotations.push([1.0, 0.0, 0.0, 0.0]);
            splats.log_scales.push([-5.0; 3]);
            splats.logit_opacities.push(2.0);
            splats.sh.extend([0.0; 3]);
        }
        write_splat_ply(&run.found_points(state), &splats, Some(&found.labels[state]), state.name()).unwrap();
    }
    let parts =
        json!({ "parts": found.parts, "diagonal": 2.0, "spacing": 0.01, "tolerance": 0.01, "warnings": ["a doubt"] });
    save_json(&run.found_parts(), &parts).unwrap();
}

#[test]
fn objects_are_made_run_scored_and_removed() {
    let fake = Fake::new("");
    let seen = Mutex::new(Vec::new());
    let note = |event: Event<'_>| {
        if let Event::Finished { row } = event {
            seen.lock().unwrap().push((row.seed, super::super::verdict(row)));
        }
    };
    let options = Options { threads: Some(2), size: Some(300), ..fake.options(4..6) };
    let finished = run(&options, &fake.program, &AtomicBool::new(false), &note).unwrap();
    assert_eq!(*seen.lock().unwrap(), [(4, "right".to_string()), (5, "right".to_string())]);
    assert_eq!((finished.rows.len(), finished.missing), (2, 0));
    let row = &finished.rows[0];
    assert!(row.right && row.joints_right && row.decidable && row.category == "cupboard", "{row:#?}");
    assert_eq!(
        (row.parts_true, row.joints.len(), row.warnings, row.features.join(" ")),
        (2, 2, 1, "look-alike".into())
    );
    assert!(row.seconds > 0.0 && row.make_seconds > 0.0 && row.program.starts_with("0.1.0 ("), "{row:#?}");
    let out = options.out.display().to_string();
    let calls = fake.calls();
    assert_eq!(calls[0], format!("synth --random 4 -o {out}/objects/4/capture --size 300 --threads 2"));
    let run = format!("reconstruct {out}/objects/4/capture -o {out}/objects/4/run --json");
    assert_eq!(calls[1], format!("{run} --stop-after discover --threads 2"));
    assert_eq!(calls.len(), 4);
    assert!(!options.out.join("objects/4").exists() && options.out.join("logs/4.run.log").is_file());
    for table in finished.tables.unwrap() {
        assert_eq!(read_rows(&table).unwrap(), finished.rows);
    }

    let again = fake.run(&Options { keep: true, jobs: 2, ..fake.options(4..6) }).unwrap_err().to_string();
    assert!(again.contains("rows/4.json was made with another --size (2 such runs)"), "{again}");
    let more = fake.run(&Options { keep: true, jobs: 2, seeds: (3..7).collect(), ..options.clone() }).unwrap();
    assert_eq!(more.rows.iter().map(|row| row.seed).collect::<Vec<_>>(), [3, 4, 5, 6]);
    assert_eq!(fake.calls().len(), 4, "the rows of two seeds are kept");
    assert!(options.out.join("objects/6/run/stages/parts.json").is_file());
}

#[test]
fn other_settings_are_refused_or_replaced() {
    let fake = Fake::new("");
    fake.run(&fake.options(0..2)).unwrap();
    fake.calls();
    let lidar = Options { sensor: "lidar".into(), stop_after_discover: false, ..fake.options(0..2) };
    let error = fake.run(&lidar).unwrap_err();
    assert!(
        error.is_bad_input() && error.to_string().contains("another --sensor, --stop-after (2 such runs)"),
        "{error}"
    );
    let finished = fake.run(&Options { force: true, ..lidar.clone() }).unwrap();
    assert_eq!(finished.rows.iter().map(|row| row.seed).collect::<Vec<_>>(), [0, 1]);
    let calls = fake.calls();
    assert!(calls[0].ends_with("--sensor lidar") && calls[1].ends_with("--json"), "{calls:?}");

    std::fs::write(&fake.program, "#!/bin/sh\nexit 0\n").unwrap();
    let error = fake.run(&lidar).unwrap_err().to_string();
    assert!(error.contains("another program"), "{error}");
    let reserved = fake.run(&fake.options(9_990..10_001)).unwrap_err();
    assert!(reserved.is_bad_input() && reserved.to_string().contains("seeds from 10000 on"), "{reserved}");
}

#[test]
fn rows_of_other_seeds_are_never_removed() {
    let fake = Fake::new("");
    fake.run(&fake.options(0..3)).unwrap();
    fake.calls();
    let before = read_rows(&fake.options(0..1).out).unwrap();
    for (seeds, words) in
        [(2..4, "2 rows outside of --seeds"), (1..3, "1 row outside of --seeds"), (7..9, "3 rows outside")]
    {
        for force in [false, true] {
            let other = Options { size: Some(64), force, ..fake.options(seeds.clone()) };
            let error = fake.run(&other).unwrap_err();
            let said = error.to_string();
            assert!(error.is_bad_input() && said.contains(words) && said.contains("another --size"), "{said}");
            assert!(said.contains("another folder to -o") && said.contains("rows/0.json"), "{said}");
        }
    }
    assert_eq!(read_rows(&fake.options(0..1).out).unwrap(), before);
    assert!(fake.calls().is_empty());
    let all = fake.run(&Options { size: Some(64), force: true, ..fake.options(0..4) }).unwrap();
    assert_eq!((all.rows.len(), fake.calls().len()), (4, 8));
}

#[test]
fn what_interrupted_seeds_left_is_removed() {
    let fake = Fake::new("");
    let options = fake.options(0..1);
    let objects = options.out.join("objects");
    let left = |name: &str| std::fs::create_dir_all(objects.join(name).join("capture")).unwrap();
    let names = || {
        let entries = std::fs::read_dir(&objects).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        entries.collect::<std::collections::BTreeSet<_>>().into_iter().collect::<Vec<_>>()
    };
    fake.run(&options).unwrap();
    // Kept by an earlier call, left by an interrupted one, and of someone else.
    ["0", "5", "mine"].iter().for_each(|name| left(name));
    fake.run(&Options { keep: true, ..options.clone() }).unwrap();
    assert_eq!(names(), ["0", "5", "mine"]);
    fake.run(&options).unwrap();
    assert_eq!(names(), ["0", "mine"]);
}

#[test]
fn earlier_failures_are_counted_apart() {
    let fake = Fake::new("case \"$verb $*\" in reconstruct*objects/1/*) exit 1;; esac");
    fake.run(&fake.options(0..3)).unwrap();
    let seen = Mutex::new(Vec::new());
    let note = |event: Event<'_>| {
        if let Event::Kept { objects, failed } = event {
            seen.lock().unwrap().push((objects, failed));
        }
    };
    let stop = AtomicBool::new(false);
    for options in [fake.options(1..4), fake.options(2..3), Options { retry_failed: true, ..fake.options(0..4) }] {
        run(&options, &fake.program, &stop, &note).unwrap();
    }
    assert_eq!(*seen.lock().unwrap(), [(1, 1), (1, 0), (3, 0)]);
}

#[test]
fn refused_and_failed_objects_are_rows() {
    let refuse = "echo '{\"event\":\"error\",\"message\":\"no depth\"}'; exit 2";
    let fake = Fake::new(&format!(
        "if [ -e \"$0.good\" ]; then :; else case \"$verb $*\" in synth*' 2 '*) exit 1;; reconstruct*objects/0/*) {refuse};; \
         reconstruct*objects/1/*) kill -9 $$;; reconstruct*objects/3/*) exit 0;; esac; fi"
    ));
    let options = fake.options(0..5);
    let finished = fake.run(&options).unwrap();
    let of = |seed: usize| &finished.rows[seed];
    assert_eq!((of(0).status, of(0).reason.as_str()), (Status::Refused, "no depth"));
    for (seed, words) in [(1, "signal 9"), (2, "could not be made: exit code 1"), (3, "the run left no result")] {
        assert!(of(seed).status == Status::Failed && of(seed).reason.contains(words), "{:?}", of(seed));
        assert!(!of(seed).right);
    }
    assert_eq!((of(0).parts_true, of(0).missing, of(1).missing, of(0).category.as_str()), (2, 2, 2, "cupboard"));
    assert_eq!((of(2).parts_true, of(4).status), (0, Status::Done));
    assert!(!of(2).is_made() && !of(2).decidable && of(1).is_made() && of(1).decidable, "{:?}", of(2));
    fake.calls();
    fake.run(&options).unwrap();
    assert!(fake.calls().is_empty(), "failures are not repeated");
    std::fs::write(fake.root.path().join("fake.sh.good"), "").unwrap();
    let repeated = fake.run(&Options { retry_failed: true, ..options }).unwrap();
    assert_eq!(fake.calls().len(), 6, "three failed, and one was refused");
    assert_eq!(repeated.rows.iter().filter(|row| row.right).count(), 4);
}

#[test]
fn nothing_that_moved_is_a_result() {
    let fake = Fake::new("");
    write_run(&RunFolder::new(fake.root.path().join("run")), &found_as(&cupboard(), &[0, 0]));
    let finished = fake.run(&fake.options(0..1)).unwrap();
    let row = &finished.rows[0];
    assert_eq!((row.status, row.parts_found, row.missing, row.right), (Status::Done, 0, 2, false));
}

#[test]
fn a_stopped_bench_keeps_its_rows_and_continues() {
    let fake = Fake::new("");
    let stop = AtomicBool::new(false);
    let options = fake.options(0..4);
    let stop_after_two = |event: Event<'_>| {
        if matches!(event, Event::Finished { row } if row.seed == 1) {
            stop.store(true, Ordering::Relaxed);
        }
    };
    let finished = run(&options, &fake.program, &stop, &stop_after_two).unwrap();
    assert_eq!((finished.rows.len(), finished.missing), (2, 2));
    assert_eq!(read_rows(&finished.tables.unwrap()[0]).unwrap().len(), 2);
    // A row that was damaged is made again.
    std::fs::write(options.out.join("rows/0.json"), "{").unwrap();
    fake.calls();
    let finished = fake.run(&options).unwrap();
    assert_eq!((finished.rows.len(), finished.missing, fake.calls().len()), (4, 0, 6));
}

#[test]
fn foreign_folders_are_left_alone() {
    let fake = Fake::new("");
    let options = fake.options(0..1);
    std::fs::create_dir(&options.out).unwrap();
    std::fs::write(options.out.join("thesis.tex"), "").unwrap();
    assert!(matches!(fake.run(&options), Err(BenchError::ForeignFolder(_))));
    assert!(fake.calls().is_empty());
}
