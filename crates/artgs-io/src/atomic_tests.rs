//! Atomic writes on a system that fails.

use super::*;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::io::ErrorKind;

#[test]
fn writes_replaces_and_leaves_nothing_else_behind() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a/b/c.txt");
    write_atomic(&path, b"first, longer").unwrap();
    write_atomic(&path, b"second").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"second");
    assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
}

#[test]
fn an_error_names_the_file() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("file"), b"").unwrap();
    let message = write_atomic(&dir.path().join("file/under.txt"), b"x").unwrap_err().to_string();
    assert!(message.contains("under.txt"), "{message}");
}

/// What happens at a step.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    /// The step fails, and so do all later ones: a full disk stays full.
    Error(ErrorKind),
    /// A signal interrupts a write once.
    Interrupted,
    /// Half of the bytes are written, and then the disk is full.
    HalfThenFull,
    /// Every write takes one byte.
    Short,
    /// The process ends at once, as if it were killed.
    Killed,
}

/// A system on which something happens at the step with this number, counted over all files.
struct Faulty {
    at: usize,
    fault: Fault,
    step: Cell<usize>,
}

impl Faulty {
    fn new(at: usize, fault: Fault) -> Self {
        Self { at, fault, step: Cell::new(0) }
    }

    /// Counts a step; true if the fault is reached.
    fn reached(&self) -> bool {
        let step = self.step.replace(self.step.get() + 1);
        step >= self.at
    }

    fn step(&self) -> io::Result<()> {
        match (self.reached(), self.fault) {
            (true, Fault::Error(kind)) => Err(kind.into()),
            (true, Fault::Killed) => std::process::abort(),
            _ => Ok(()),
        }
    }
}

impl Steps for Faulty {
    fn make_folder(&self, folder: &Path) -> io::Result<()> {
        self.step()?;
        System.make_folder(folder)
    }

    fn create(&self, folder: &Path) -> io::Result<NamedTempFile> {
        self.step()?;
        System.create(folder)
    }

    fn write(&self, file: &mut File, bytes: &[u8]) -> io::Result<usize> {
        let step = self.step.get();
        let reached = self.reached();
        match self.fault {
            Fault::Error(kind) if reached => Err(kind.into()),
            Fault::Killed if reached => {
                // Some of the content is on the disk then.
                let _ = System.write(file, &bytes[..bytes.len() / 2]);
                std::process::abort()
            }
            Fault::Interrupted if step == self.at => Err(ErrorKind::Interrupted.into()),
            Fault::HalfThenFull if step == self.at => System.write(file, &bytes[..bytes.len().div_ceil(2)]),
            Fault::HalfThenFull if reached => Err(ErrorKind::StorageFull.into()),
            Fault::Short => System.write(file, &bytes[..1]),
            _ => System.write(file, bytes),
        }
    }

    fn rename(&self, file: NamedTempFile, path: &Path) -> io::Result<()> {
        self.step()?;
        System.rename(file, path)
    }
}

/// The files of a run in the order in which they are written; some replace earlier ones.
const RUN: [(&str, &str); 6] = [
    ("config.toml", "seed = 3\n"),
    ("stages/found.json", "{\"parts\": 2}"),
    ("meshes/start/part_1.ply", "ply, quite long, so that halves of it are no files"),
    ("stages/found.json", "{\"parts\": 3, \"corrected\": true}"),
    ("meshes/start/part_1.ply", "ply, another one"),
    ("replica.json", "{}\n"),
];

/// Writes the run until a write fails; the error names the file.
fn write_run(root: &Path, steps: &dyn Steps) -> Result<(), String> {
    for (name, text) in RUN {
        if let Err(error) = write_by(steps, &root.join(name), text.as_bytes()) {
            let message = error.to_string();
            assert!(message.contains(name) && message.contains("cannot be written"), "{message}");
            return Err(message);
        }
    }
    Ok(())
}

/// Every file below a folder with its content; names of unfinished files apart.
fn files(root: &Path) -> (BTreeMap<String, String>, usize) {
    let (mut found, mut unfinished, mut folders) = (BTreeMap::new(), 0, vec![root.to_path_buf()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
            let name = entry.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
            let last = name.rsplit('/').next().unwrap();
            if entry.is_dir() {
                folders.push(entry);
            } else if last.starts_with(".artgs-") && last.ends_with(".tmp") {
                unfinished += 1;
            } else {
                found.insert(name, std::fs::read_to_string(&entry).unwrap());
            }
        }
    }
    (found, unfinished)
}

/// Only whole files are there: each is one of those that were written under its name.
fn require_whole(root: &Path, unfinished: usize, what: &str) {
    let (found, left) = files(root);
    assert!(left <= unfinished, "{what}: {left} unfinished files are left");
    for (name, text) in &found {
        assert!(RUN.contains(&(name, text)), "{what}: {name} is {text:?}");
    }
}

#[test]
fn any_fault_at_any_step_leaves_whole_files_and_an_error_that_names_file_and_reason() {
    use Fault::{Error, HalfThenFull, Interrupted, Short};
    let denied = [ErrorKind::StorageFull, ErrorKind::PermissionDenied, ErrorKind::ReadOnlyFilesystem].map(Error);
    for fault in denied.into_iter().chain([HalfThenFull, Interrupted, Short]) {
        for at in 0.. {
            let dir = tempfile::tempdir().unwrap();
            let faulty = Faulty::new(at, fault);
            let result = write_run(dir.path(), &faulty);
            let what = format!("{fault:?} at {at}");
            require_whole(dir.path(), 0, &what);
            if let (Error(kind), Err(message)) = (fault, &result) {
                assert!(message.contains(&io::Error::from(kind).to_string()), "{what}: {message}");
            }
            // The disk has room again: the same run gives all files.
            write_run(dir.path(), &System).unwrap();
            assert_eq!(files(dir.path()).0.len(), 4);
            match fault {
                Interrupted | Short => assert!(result.is_ok(), "{what}: {result:?}"),
                _ => {}
            }
            if faulty.step.get() < at || fault == Short {
                break;
            }
        }
    }
}

/// Runs the test binary on [`killed_run`], which ends at a step, and again without a fault.
#[test]
fn a_run_that_is_killed_at_any_step_leaves_whole_files_and_completes_to_the_same_bytes() {
    let complete = tempfile::tempdir().unwrap();
    write_run(complete.path(), &System).unwrap();
    for at in 0..4 * RUN.len() {
        let dir = tempfile::tempdir().unwrap();
        let mut child = std::process::Command::new(std::env::current_exe().unwrap());
        child.args(["atomic::tests::killed_run", "--exact", "--ignored"]);
        let killed = child.env("ARTGS_KILL_AT", at.to_string()).env("ARTGS_KILL_IN", dir.path()).output().unwrap();
        assert!(!killed.status.success(), "step {at} was not reached");
        require_whole(dir.path(), 1, &format!("killed at {at}"));
        write_run(dir.path(), &System).unwrap();
        assert_eq!(files(dir.path()).0, files(complete.path()).0, "killed at {at}");
    }
}

#[test]
#[ignore = "started by another test, in a process of its own"]
fn killed_run() {
    let at = std::env::var("ARTGS_KILL_AT").unwrap().parse().unwrap();
    let folder = std::env::var_os("ARTGS_KILL_IN").unwrap();
    let _ = write_run(Path::new(&folder), &Faulty::new(at, Fault::Killed));
}
