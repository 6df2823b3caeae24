//! One case of the table: a command on a changed copy of a good input, and what must come of it.

use crate::folder::Folder;
use crate::seeds;
use std::ffi::OsString;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Longest time that a case may take.
const PATIENCE: Duration = Duration::from_secs(20);

/// How an input is changed.
pub(crate) type Change<'a> = &'a dyn Fn(&Folder);

/// A row of a table.
pub(crate) struct Case {
    name: &'static str,
    seed: &'static str,
    command: &'static str,
    exit: i32,
    words: &'static [&'static str],
    change: fn(&Folder),
}

/// A case that is refused: exit code 2.
pub(crate) const fn bad(
    name: &'static str,
    seed: &'static str,
    command: &'static str,
    words: &'static [&'static str],
    change: fn(&Folder),
) -> Case {
    Case { name, seed, command, exit: 2, words, change }
}

/// A case that is odd, and works: exit code 0.
pub(crate) const fn odd(
    name: &'static str,
    seed: &'static str,
    command: &'static str,
    words: &'static [&'static str],
    change: fn(&Folder),
) -> Case {
    Case { name, seed, command, exit: 0, words, change }
}

impl Case {
    /// The same with another exit code.
    pub(crate) const fn exits(self, exit: i32) -> Self {
        Self { exit, ..self }
    }
}

/// Runs a table, and names all cases that fail.
pub(crate) fn check(table: &[Case]) {
    let mut trials = Trials::default();
    for case in table {
        trials.run(case.name, case.seed, case.command, case.exit, case.words, &case.change);
    }
    trials.finish();
}

/// Cases that have run.
#[derive(Default)]
pub(crate) struct Trials {
    count: usize,
    failures: Vec<String>,
}

/// What a run of the program gave.
struct Outcome {
    /// None if it was ended.
    exit: Option<i32>,
    stdout: String,
    stderr: String,
}

impl Trials {
    /// Runs one case. In `command`, `IN` is the changed copy of the seed (nothing but an empty folder if the seed is empty), and
    /// `OUT` a folder beside it that does not exist.
    pub(crate) fn run(&mut self, name: &str, seed: &str, command: &str, exit: i32, words: &[&str], change: Change<'_>) {
        self.count += 1;
        let place = place();
        let input = place.join("in");
        seeds::copy(seed, &input);
        let folder = Folder::new(&input);
        change(&folder);
        let before = folder.listing();
        let args: Vec<OsString> = command.split_whitespace().map(|word| argument(word, &place)).collect();
        let begun = Instant::now();
        let outcome = artgs(&args, &place);
        let seconds = begun.elapsed().as_secs_f64();
        if std::env::var_os("ARTGS_SHOW").is_some() {
            let shown = outcome.stderr.replace(place.to_str().unwrap_or_default(), "");
            println!("[{name}] {command} -> {:?} in {seconds:.2} s\n{shown}{}", outcome.exit, outcome.stdout);
        }
        let mut faults = faults(&outcome, exit, words);
        if exit != 0 {
            faults.extend(left_behind(&place.join("OUT")).map(|files| format!("it left {files:?}")));
            if folder.listing() != before {
                faults.push("it changed its input".into());
            }
        }
        if faults.is_empty() {
            let _ = fs::remove_dir_all(&place);
        } else {
            let Outcome { exit, stdout, stderr } = outcome;
            self.failures.push(format!(
                "[{name}] {command}: {}\n  exit {exit:?}\n  stderr: {stderr}\n  stdout: {stdout}\n  kept in {}",
                faults.join("; "),
                place.display()
            ));
        }
    }

    /// Fails if a case did.
    pub(crate) fn finish(self) {
        let Self { count, failures } = self;
        assert!(failures.is_empty(), "{} of {count} cases:\n{}", failures.len(), failures.join("\n"));
        println!("{count} cases");
    }
}

/// Files of a folder that a later run would take for results, or that are no whole files.
fn left_behind(out: &Path) -> Option<Vec<String>> {
    const BEGUN: [&str; 6] =
        ["config.toml", "keys.json", "events.jsonl", "capture.txt", "capture_folder.txt", "refused.txt"];
    let left = Folder::new(out).listing().into_iter().map(|(file, _)| file);
    let left: Vec<String> = left.filter(|file| !BEGUN.iter().any(|name| file.ends_with(name))).collect();
    (!left.is_empty()).then_some(left)
}

/// A new folder for a case.
fn place() -> std::path::PathBuf {
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    let place = seeds::root().join(format!("case-{}", NEXT.fetch_add(1, Ordering::Relaxed)));
    fs::create_dir_all(&place).unwrap();
    place
}

/// A word of a command with its paths.
fn argument(word: &str, place: &Path) -> OsString {
    let shown = place.to_str().unwrap();
    let replaced = word.replace("IN", &format!("{shown}/in")).replace("OUT", &format!("{shown}/OUT"));
    // A space within an argument.
    replaced.replace('~', " ").into()
}

/// What is wrong with an outcome.
fn faults(outcome: &Outcome, exit: i32, words: &[&str]) -> Vec<String> {
    let mut faults = Vec::new();
    let Outcome { exit: found, stdout, stderr } = outcome;
    match found {
        None => faults.push(format!("no answer within {} s", PATIENCE.as_secs())),
        Some(found) if *found != exit => faults.push(format!("exit code {found}, expected {exit}")),
        _ => {}
    }
    if stderr.contains("panicked") || stderr.contains("itself failed") || matches!(found, Some(70 | 101)) {
        faults.push("an error in the program".into());
    }
    let errors = stderr.lines().filter(|line| line.starts_with("error:")).count();
    if errors != usize::from(exit == 1 || exit == 2) {
        faults.push(format!("{errors} lines begin with `error:`"));
    }
    let all = format!("{stderr}{stdout}");
    faults.extend(words.iter().filter(|word| !all.contains(*word)).map(|word| format!("`{word}` is missing")));
    if all.chars().any(|c| c.is_control() && !matches!(c, '\n' | '\t')) {
        faults.push("control characters reach the terminal".into());
    }
    faults
}

/// Runs the program, and ends it when it takes too long. Its output goes to files: a full pipe would block it.
fn artgs(args: &[OsString], place: &Path) -> Outcome {
    let [stdout, stderr] = ["stdout.txt", "stderr.txt"].map(|name| place.join(name));
    let mut child = Command::new(env!("CARGO_BIN_EXE_artgs"))
        .args(args)
        .current_dir(place)
        .env_remove("NO_COLOR")
        .env_remove("RUST_BACKTRACE")
        .stdin(Stdio::null())
        .stdout(File::create(&stdout).unwrap())
        .stderr(File::create(&stderr).unwrap())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    let exit = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break Some(status.code().unwrap_or(-1));
        }
        if begun.elapsed() > PATIENCE {
            child.kill().unwrap();
            child.wait().unwrap();
            break None;
        }
        std::thread::sleep(Duration::from_millis(3));
    };
    let text = |path: &Path| String::from_utf8_lossy(&fs::read(path).unwrap()).into_owned();
    Outcome { exit, stdout: text(&stdout), stderr: text(&stderr) }
}
