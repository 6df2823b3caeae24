//! Output folders: a run is never mixed with files of something else or, without a flag, with an earlier run.

use crate::args::Earlier;
use crate::failure::Failure;
use artgs_core::Capture;
use artgs_io::run_folder::Contents;
use artgs_io::{CaptureOptions, RunFolder};
use std::path::{Path, PathBuf};

/// Refuses a folder unless it is missing, empty, an output folder without results, or comes with `--resume` or
/// `--force`. Changes nothing.
pub(crate) fn check(run: &RunFolder, earlier: Earlier) -> Result<(), Failure> {
    let shown = run.root().display();
    let refusal = match run.contents().map_err(Failure::bad_input)? {
        Contents::File => format!("{shown} is a file; give a folder to -o"),
        Contents::Foreign => format!("{shown} holds files that artgs did not write; give an empty folder to -o"),
        Contents::Results if !earlier.force && !earlier.resume => {
            format!("{shown} holds an earlier run; add --resume to continue it, or --force to discard it")
        }
        Contents::Nothing | Contents::Started | Contents::Results => return Ok(()),
    };
    Err(Failure::bad(refusal))
}

/// Makes a folder ready for a run; `--force` removes what a later `--resume` would take for its own.
pub(crate) fn prepare(run: &RunFolder, earlier: Earlier) -> Result<(), Failure> {
    check(run, earlier)?;
    if earlier.force {
        run.discard().map_err(Failure::failed)?;
    }
    run.create().map_err(Failure::failed)
}

/// Reads a capture.
pub(crate) fn load_capture(folder: &Path) -> Result<Capture, Failure> {
    load_capture_with(folder, &CaptureOptions::default())
}

/// Reads a capture.
pub(crate) fn load_capture_with(folder: &Path, options: &CaptureOptions) -> Result<Capture, Failure> {
    artgs_io::load_capture_with(folder, options).map_err(Failure::bad_input)
}

/// The folder with the photos of a run: `named` by the user, or else as the run noted it; none if it does not exist.
pub(crate) fn photos_of(run: &RunFolder, named: Option<&Path>) -> Option<PathBuf> {
    named.map(Path::to_path_buf).or_else(|| run.capture_folder()).filter(|folder| folder.is_dir())
}

/// Refuses a folder without a replica, and says how to get one.
pub(crate) fn require_replica(run: &RunFolder) -> Result<(), Failure> {
    let shown = run.root().display();
    let refusal = if run.has_replica() {
        return Ok(());
    } else if !run.root().is_dir() {
        format!("{shown}: no such folder")
    } else if run.has_found_parts() {
        let how = format!("artgs reconstruct CAPTURE -o {shown} --resume continues it");
        format!("{shown}: its run stopped before there was a replica; {how}")
    } else {
        format!("{shown}: there is no replica.json here; artgs reconstruct makes one")
    };
    Err(Failure::bad(refusal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const FRESH: Earlier = Earlier { resume: false, force: false };
    const RESUME: Earlier = Earlier { resume: true, force: false };
    const FORCE: Earlier = Earlier { resume: false, force: true };

    #[test]
    fn missing_and_empty_folders_are_taken() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path().join("a/b"));
        prepare(&run, FRESH).unwrap();
        prepare(&run, FRESH).unwrap();
        assert!(run.root().is_dir());
    }

    #[test]
    fn foreign_files_are_never_touched() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path());
        fs::write(root.path().join("thesis.tex"), "x").unwrap();
        fs::create_dir(run.stage("")).unwrap();
        for earlier in [FRESH, RESUME, FORCE] {
            let failure = prepare(&run, earlier).unwrap_err();
            assert_eq!(failure.exit_code(), 2);
            assert!(failure.to_string().contains("did not write"), "{failure}");
            let file = RunFolder::new(root.path().join("thesis.tex"));
            assert_eq!(prepare(&file, earlier).unwrap_err().exit_code(), 2);
        }
        assert!(run.stage("").is_dir());
    }

    #[test]
    fn an_earlier_run_is_resumed_or_discarded_only_on_request() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path());
        fs::write(run.events(), "").unwrap();
        prepare(&run, FRESH).unwrap();
        fs::create_dir(run.stage("")).unwrap();
        let failure = prepare(&run, FRESH).unwrap_err();
        assert!(failure.to_string().contains("--resume") && failure.exit_code() == 2, "{failure}");
        prepare(&run, RESUME).unwrap();
        assert!(run.stage("").is_dir());
        prepare(&run, FORCE).unwrap();
        assert!(!run.stage("").exists());
        prepare(&run, FRESH).unwrap();
    }
}
