//! Runs the cases of a target in a process with limited memory.

use crate::mutate::{Random, mutated};
use crate::seeds;
use crate::targets::{ALL, Target};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, exit};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Longest time of a case.
pub(crate) const PATIENCE: Duration = Duration::from_secs(10);
/// Address space of a process, KiB. The largest image that readers accept takes 1 GiB.
const MEMORY: u64 = 5 << 20;
/// Time for a target if no number of cases is given.
const BUDGET: Duration = Duration::from_secs(4);

fn variable(name: &str) -> Option<u64> {
    std::env::var(name)
        .ok()
        .map(|value| value.parse().unwrap_or_else(|_| panic!("{name} is {value}, expected a number")))
}

/// Where a target works.
fn place(target: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("fuzz").join(target)
}

/// Starts the process of a target and waits for it.
pub(crate) fn start(name: &str) {
    let place = place(name);
    let _ = fs::remove_dir_all(&place);
    fs::create_dir_all(&place).unwrap();
    let program = std::env::current_exe().unwrap();
    let arguments = ["worker_process", "--exact", "--ignored", "--nocapture", "--test-threads", "1"];
    // Only shells limit memory without unsafe code.
    let mut command = if cfg!(unix) {
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("ulimit -v {MEMORY}; exec \"$0\" \"$@\"")]).arg(&program);
        shell
    } else {
        Command::new(&program)
    };
    let output = command.args(arguments).env("ARTGS_FUZZ_TARGET", name).env("RUST_BACKTRACE", "0").output().unwrap();
    let (stdout, stderr) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    if let Some(line) = stdout.lines().find(|line| line.contains(" cases of ")) {
        println!("{line}");
    }
    let case = fs::read_to_string(place.join("case.txt")).unwrap_or_default();
    assert!(
        output.status.success(),
        "{name} failed ({}) at {case}; its input is in {}\n{}",
        output.status,
        place.display(),
        stderr.lines().rev().take(30).collect::<Vec<_>>().into_iter().rev().collect::<Vec<_>>().join("\n")
    );
    fs::remove_dir_all(place).unwrap();
}

/// Number of the running case, counted over regressions and mutations.
static RUNNING: AtomicU64 = AtomicU64::new(0);

/// Ends the process when a case takes too long.
fn watch() {
    std::thread::spawn(|| {
        let (mut last, mut since) = (0, Instant::now());
        loop {
            std::thread::sleep(Duration::from_millis(100));
            let running = RUNNING.load(Ordering::Relaxed);
            if running != last {
                (last, since) = (running, Instant::now());
            } else if running > 0 && since.elapsed() > PATIENCE {
                eprintln!("the case takes longer than {} s", PATIENCE.as_secs());
                exit(3);
            }
        }
    });
}

/// The cases of the target in the environment.
pub(crate) fn run() {
    let name = std::env::var("ARTGS_FUZZ_TARGET").unwrap();
    let target = ALL.iter().find(|t| t.name == name).unwrap();
    let place = place(&name);
    let work = place.join("input");
    seeds::copy(target.seed, &work);
    let files = (target.files)(&work);
    let seeds: Vec<Vec<u8>> = files.iter().map(|file| fs::read(work.join(file)).unwrap()).collect();
    (target.read)(&work);
    watch();
    let note = |what: &str| replace(&place.join("case.txt"), what.as_bytes());
    for regression in regressions(&name) {
        note(&format!("regression {}", regression.display()));
        RUNNING.fetch_add(1, Ordering::Relaxed);
        // The name of a regression begins with the number of its file in the sorted list.
        let text = regression.file_name().unwrap().to_str().unwrap().to_string();
        let file = text.split('-').next().and_then(|n| n.parse::<usize>().ok()).unwrap();
        case(target, &work, &files[file], &fs::read(&regression).unwrap(), &seeds[file]);
    }
    let (from, count) = (variable("ARTGS_FUZZ_FROM").unwrap_or(0), variable("ARTGS_FUZZ_CASES"));
    let (begun, mut done) = (Instant::now(), 0);
    while count.map_or(begun.elapsed() < BUDGET, |count| done < count) {
        let number = from + done;
        let mut random = Random::new(&name, number);
        let file = random.below(files.len());
        let other = random.below(files.len());
        let bytes = mutated(&seeds[file], &seeds[other], &mut random);
        note(&format!("case {number}, file {file} {}", files[file]));
        RUNNING.fetch_add(1, Ordering::Relaxed);
        case(target, &work, &files[file], &bytes, &seeds[file]);
        done += 1;
    }
    println!("{done} cases of {name} in {:.1} s", begun.elapsed().as_secs_f64());
}

/// Reads the folder with one file changed, and restores it.
fn case(target: &Target, work: &Path, file: &str, bytes: &[u8], seed: &[u8]) {
    let path = work.join(file);
    replace(&path, bytes);
    (target.read)(work);
    replace(&path, seed);
}

/// Removes a file and writes it: file systems that flush files which are cut to nothing would limit a target to 150 cases a second.
fn replace(path: &Path, bytes: &[u8]) {
    let _ = fs::remove_file(path);
    fs::write(path, bytes).unwrap();
}

/// Inputs of a target that once failed, sorted.
fn regressions(target: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/regressions").join(target);
    let mut found: Vec<PathBuf> =
        fs::read_dir(folder).map_or(Vec::new(), |entries| entries.map(|e| e.unwrap().path()).collect());
    found.sort();
    found
}
