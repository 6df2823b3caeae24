//! Output folders: never mixes a run with other people's files or, unasked, with an earlier run.

use crate::args::Earlier;
use crate::failure::Failure;
use anyhow::Context;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Parts that a run has found.
const FOUND: &str = "stages/parts.json";

/// Events of the runs in a folder; also what tells an output folder from any other.
pub(crate) const EVENTS: &str = "events.jsonl";
const REPLICA: &str = "replica.json";
const STAGES: &str = "stages";
/// Names the folder of the photos.
const PHOTOS: &str = "stages/capture_folder.txt";

/// Refuses `out` unless it is missing, empty, an output folder without results, or comes with `--resume` or `--force`.
/// Touches nothing.
pub(crate) fn check(out: &Path, earlier: Earlier) -> Result<(), Failure> {
    let shown = out.display();
    let mut empty = true;
    match fs::read_dir(out) {
        Ok(mut entries) => empty = entries.next().is_none(),
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        Err(error) if error.kind() == ErrorKind::NotADirectory => {
            return Err(Failure::bad(format!("{shown} is a file; give a folder to -o")));
        }
        Err(error) => return Err(Failure::bad(format!("{shown}: {error}"))),
    }
    let holds = |name: &str| out.join(name).exists();
    if !empty && !holds(EVENTS) && !holds(REPLICA) {
        return Err(Failure::bad(format!("{shown} holds files that artgs did not write; give an empty folder to -o")));
    }
    if !earlier.force && !earlier.resume && (holds(STAGES) || holds(REPLICA)) {
        return Err(Failure::bad(format!(
            "{shown} holds an earlier run; add --resume to go on with it, or --force to discard it"
        )));
    }
    Ok(())
}

/// Makes `out` ready for a run; `--force` removes what a later `--resume` would mistake for its own.
pub(crate) fn prepare(out: &Path, earlier: Earlier) -> Result<(), Failure> {
    check(out, earlier)?;
    if earlier.force {
        discard(out)?;
    }
    fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    Ok(())
}

/// Leaves word in an output folder of where the photos are, for exports.
pub(crate) fn note_capture(out: &Path, capture: &Path) -> Result<(), Failure> {
    let place = fs::canonicalize(capture).with_context(|| format!("cannot find {}", capture.display()))?;
    let text = format!("{}\n", place.display());
    artgs_io::write_atomic(&out.join(PHOTOS), text.as_bytes()).map_err(anyhow::Error::from)?;
    Ok(())
}

/// Where the photos of a run were.
pub(crate) fn capture_of(out: &Path) -> Option<PathBuf> {
    let text = fs::read_to_string(out.join(PHOTOS)).ok()?;
    Some(PathBuf::from(text.trim_end_matches('\n')))
}

/// True if a run in the folder has found parts.
pub(crate) fn has_parts(out: &Path) -> bool {
    out.join(FOUND).is_file()
}

/// Refuses a folder without a replica, and says what to do about it.
pub(crate) fn holds_replica(out: &Path) -> Result<(), Failure> {
    let shown = out.display();
    if out.join(REPLICA).is_file() {
        Ok(())
    } else if !out.is_dir() {
        Err(Failure::bad(format!("{shown}: no such folder")))
    } else if has_parts(out) {
        let how = format!("artgs reconstruct CAPTURE -o {shown} --resume goes on");
        Err(Failure::bad(format!("{shown}: its run stopped before there was a replica; {how}")))
    } else {
        Err(Failure::bad(format!("{shown}: there is no {REPLICA} here; artgs reconstruct makes one")))
    }
}

/// Removes what a run writes, by name; anything else in the folder stays.
fn discard(out: &Path) -> Result<(), Failure> {
    const FOLDERS: [&str; 4] = [STAGES, "meshes", "splats", crate::export::EXPORTS];
    const FILES: [&str; 6] = [REPLICA, EVENTS, "replica.urdf", "metrics.json", "preview.png", "config.toml"];
    let folders = FOLDERS.iter().map(|name| fs::remove_dir_all(out.join(name)));
    let files = FILES.iter().map(|name| fs::remove_file(out.join(name)));
    for result in folders.chain(files) {
        match result {
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            other => other.with_context(|| format!("cannot discard the earlier run in {}", out.display()))?,
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRESH: Earlier = Earlier { resume: false, force: false };
    const RESUME: Earlier = Earlier { resume: true, force: false };
    const FORCE: Earlier = Earlier { resume: false, force: true };

    #[test]
    fn missing_and_empty_folders_are_taken() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("a/b");
        prepare(&out, FRESH).unwrap();
        prepare(&out, FRESH).unwrap();
        assert!(out.is_dir());
    }

    #[test]
    fn foreign_files_are_never_touched() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("thesis.tex"), "x").unwrap();
        fs::create_dir(root.path().join(STAGES)).unwrap();
        for earlier in [FRESH, RESUME, FORCE] {
            let failure = prepare(root.path(), earlier).unwrap_err();
            assert_eq!(failure.exit_code(), 2);
            assert!(failure.to_string().contains("did not write"), "{failure}");
            assert_eq!(prepare(&root.path().join("thesis.tex"), earlier).unwrap_err().exit_code(), 2);
        }
        assert!(root.path().join(STAGES).is_dir());
    }

    #[test]
    fn an_earlier_run_is_resumed_or_discarded_only_on_request() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path();
        fs::write(out.join(EVENTS), "").unwrap();
        prepare(out, FRESH).unwrap();
        fs::create_dir(out.join(STAGES)).unwrap();
        let failure = prepare(out, FRESH).unwrap_err();
        assert!(failure.to_string().contains("--resume") && failure.exit_code() == 2, "{failure}");
        prepare(out, RESUME).unwrap();
        assert!(out.join(STAGES).is_dir());
        prepare(out, FORCE).unwrap();
        assert!(!out.join(STAGES).exists());
        prepare(out, FRESH).unwrap();
    }
}
