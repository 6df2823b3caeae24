//! Output folders: a run is never mixed with files of something else or, without a flag, with an earlier run.

use crate::agreement;
use crate::args::Earlier;
use crate::commands::Style;
use crate::failure::Failure;
use crate::output::note;
use artgs_core::Capture;
use artgs_io::folder_lock::LockError;
use artgs_io::{CaptureError, CaptureOptions, Contents, FolderLock, RunFolder};
use std::path::{Path, PathBuf};

/// Refuses a folder that another process writes into, and any other unless it is missing, empty, an output folder without
/// results, or comes with `--resume` or `--force`. Changes nothing.
pub(crate) fn check(run: &RunFolder, earlier: Earlier) -> Result<(), Failure> {
    FolderLock::require_free(run.root()).map_err(unlockable)?;
    check_contents(run, earlier)
}

fn check_contents(run: &RunFolder, earlier: Earlier) -> Result<(), Failure> {
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

/// Makes a folder ready for a run and locks it; `--force` removes what a later `--resume` would take for its own.
pub(crate) fn prepare(run: &RunFolder, earlier: Earlier, command: &str, style: Style) -> Result<FolderLock, Failure> {
    check(run, earlier)?;
    run.create().map_err(Failure::failed)?;
    let lock = lock(run, command, style)?;
    // Another run may have written into it before it was locked.
    check_contents(run, earlier)?;
    if earlier.force {
        run.discard().map_err(Failure::failed)?;
    }
    run.begin(earlier.resume).map_err(Failure::failed)?;
    Ok(lock)
}

/// Locks a folder that exists: nobody else writes into it as long as the value exists. Removes what a killed process left.
pub(crate) fn lock(run: &RunFolder, command: &str, style: Style) -> Result<FolderLock, Failure> {
    let lock = lock_any(run.root(), command, style)?;
    run.remove_leftovers().map_err(Failure::failed)?;
    Ok(lock)
}

/// Locks a folder that exists, of any content.
pub(crate) fn lock_any(folder: &Path, command: &str, style: Style) -> Result<FolderLock, Failure> {
    let lock = FolderLock::take(folder, command).map_err(unlockable)?;
    if let Some(notice) = lock.notice() {
        note(&notice.to_string(), style);
    }
    Ok(lock)
}

fn unlockable(error: LockError) -> Failure {
    match error {
        LockError::File(error) => Failure::failed(error),
        error => Failure::bad_input(error),
    }
}

/// Reads a capture.
pub(crate) fn load_capture(folder: &Path) -> Result<Capture, Failure> {
    load_capture_with(folder, &CaptureOptions::default())
}

/// Reads a capture. Where its states do not overlap because the poses or depths of one are wrong, the error says what is wrong
/// with them.
pub(crate) fn load_capture_with(folder: &Path, options: &CaptureOptions) -> Result<Capture, Failure> {
    artgs_io::load_capture_with(folder, options).map_err(|error| {
        let apart = CaptureOptions { apart: true, ..*options };
        let is_apart = matches!(error, CaptureError::NoOverlap(_));
        let capture = is_apart.then(|| artgs_io::load_capture_with(folder, &apart).ok()).flatten();
        let cause = capture.and_then(|capture| agreement::refusal(&capture));
        cause.map_or_else(|| Failure::bad_input(error), Failure::bad)
    })
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
    } else if run.root().is_file() {
        format!("{shown}: is a file; give the folder that artgs reconstruct wrote")
    } else if !run.root().is_dir() {
        format!("{shown}: no such folder; give the folder that artgs reconstruct wrote")
    } else if run.stage("").is_dir() {
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
    const STYLE: Style = Style { json: false, quiet: true, silent: false };

    fn prepare(run: &RunFolder, earlier: Earlier) -> Result<FolderLock, Failure> {
        super::prepare(run, earlier, "artgs reconstruct", STYLE)
    }

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
        artgs_io::write_atomic(&run.found_parts(), b"{}").unwrap();
        let failure = prepare(&run, FRESH).unwrap_err();
        assert!(failure.to_string().contains("--resume") && failure.exit_code() == 2, "{failure}");
        prepare(&run, RESUME).unwrap();
        assert!(run.stage("").is_dir());
        prepare(&run, FORCE).unwrap();
        assert!(!run.stage("").exists());
        prepare(&run, FRESH).unwrap();
    }

    #[test]
    fn a_folder_in_use_is_refused_with_all_flags() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path().join("out"));
        let lock = prepare(&run, FRESH).unwrap();
        artgs_io::write_atomic(&run.found_parts(), b"{}").unwrap();
        for earlier in [FRESH, RESUME, FORCE] {
            let failure = prepare(&run, earlier).unwrap_err();
            let text = failure.to_string();
            assert!(failure.exit_code() == 2 && text.contains("in use by process") && text.contains("wait"), "{text}");
        }
        assert!(run.has_found_parts());
        drop(lock);
        prepare(&run, RESUME).unwrap();
    }
}
