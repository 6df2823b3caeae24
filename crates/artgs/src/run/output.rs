//! The folder of a run: never mixed with files of something else or, without being asked, with an earlier run.

use super::found_parts;
use artgs_io::folder_lock::{LockError, LockNotice};
use artgs_io::{Contents, FileError, FolderLock, RunFolder, read_corrections};
use std::path::{Path, PathBuf};

/// What to do about an earlier run in the folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Earlier {
    /// Refuse the folder.
    Refuse,
    /// Take the stages that it saved.
    Resume,
    /// Remove what it wrote.
    Discard,
}

/// Why a folder cannot be that of a run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// It is a file.
    #[error("{} is a file; give a folder", .0.display())]
    IsFile(PathBuf),
    /// It has other files.
    #[error("{} holds files that artgs did not write; give an empty folder", .0.display())]
    Foreign(PathBuf),
    /// It has an earlier run.
    #[error("{} holds an earlier run; resume or discard it, or give another folder", .0.display())]
    Earlier(PathBuf),
    /// The images are in what would be discarded.
    #[error("{} is inside {}, which discarding the earlier run removes; give another folder", photos.display(), stages.display())]
    Photos {
        /// The folder of the images.
        photos: PathBuf,
        /// What would be removed.
        stages: PathBuf,
    },
    /// Its `corrections.json` cannot be applied.
    #[error("{0}")]
    Corrections(String),
    /// Another process uses it, or it cannot be locked.
    #[error(transparent)]
    Lock(#[from] LockError),
    /// It cannot be listed.
    #[error(transparent)]
    Listed(FileError),
    /// It cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

impl OutputError {
    /// True if the user has to name another folder, or say what to do with this one.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, Self::File(_) | Self::Lock(LockError::File(_)))
    }
}

/// The folder of a run, locked: nobody else writes into it as long as the value exists.
#[derive(Debug)]
pub struct Output {
    folder: RunFolder,
    resume: bool,
    lock: FolderLock,
}

impl Output {
    /// Refuses a folder that another process writes into, and any other unless it is missing, empty, an output folder without
    /// results, or something is to be done about the earlier run; also one whose earlier run holds the images in the folder `photos` and
    /// is to be discarded, or has corrections that cannot be applied. Changes nothing.
    pub fn check(folder: &RunFolder, earlier: Earlier, photos: Option<&Path>) -> Result<(), OutputError> {
        FolderLock::require_free(folder.root())?;
        let stages = folder.stage("");
        let inside = |photos: &Path| Some(photos.canonicalize().ok()?.starts_with(stages.canonicalize().ok()?));
        if let Some(photos) = photos.filter(|photos| earlier == Earlier::Discard && inside(photos) == Some(true)) {
            return Err(OutputError::Photos { photos: photos.into(), stages });
        }
        check_contents(folder, earlier)?;
        if earlier == Earlier::Resume { check_corrections(folder) } else { Ok(()) }
    }

    /// Makes a folder ready for a run and locks it, after the same checks; what a later run would take for its own is removed if the
    /// earlier run is discarded. `owner` is what others read who find it locked.
    pub fn open(folder: RunFolder, earlier: Earlier, photos: Option<&Path>, owner: &str) -> Result<Self, OutputError> {
        Self::check(&folder, earlier, photos)?;
        folder.create()?;
        let lock = lock(&folder, owner)?;
        // Another run may have written into it before it was locked.
        check_contents(&folder, earlier)?;
        if earlier == Earlier::Discard {
            folder.discard()?;
        }
        let resume = earlier == Earlier::Resume;
        folder.begin(resume)?;
        Ok(Self { folder, resume, lock })
    }

    /// The folder.
    pub fn folder(&self) -> &RunFolder {
        &self.folder
    }

    /// True if the run takes stages of an earlier one.
    pub fn resumes(&self) -> bool {
        self.resume
    }

    /// What was odd about the lock of an earlier process, if anything was.
    pub fn notice(&self) -> Option<&LockNotice> {
        self.lock.notice()
    }

    /// The lock alone.
    pub fn into_lock(self) -> FolderLock {
        self.lock
    }
}

/// Refuses corrections that cannot be applied, before anything is read or computed.
fn check_corrections(folder: &RunFolder) -> Result<(), OutputError> {
    let refused = |reason: String| OutputError::Corrections(format!("{reason}; correct the file or remove it"));
    let corrections = read_corrections(folder.root()).map_err(|error| refused(error.to_string()))?;
    let Some((corrections, found)) = corrections.zip(found_parts(folder)) else { return Ok(()) };
    let wrong = |reason: String| refused(format!("{}: {reason}", folder.corrections().display()));
    corrections.check_parts(found.parts.len()).map_err(wrong)
}

/// Locks a folder that exists, and removes what a killed process left there.
pub fn lock(folder: &RunFolder, command: &str) -> Result<FolderLock, OutputError> {
    let lock = FolderLock::take(folder.root(), command)?;
    folder.remove_leftovers()?;
    Ok(lock)
}

fn check_contents(folder: &RunFolder, earlier: Earlier) -> Result<(), OutputError> {
    let root = || folder.root().to_path_buf();
    match folder.contents().map_err(OutputError::Listed)? {
        Contents::File => Err(OutputError::IsFile(root())),
        Contents::Foreign => Err(OutputError::Foreign(root())),
        Contents::Results if earlier == Earlier::Refuse => Err(OutputError::Earlier(root())),
        Contents::Nothing | Contents::Started | Contents::Results => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn open(folder: &RunFolder, earlier: Earlier) -> Result<Output, OutputError> {
        Output::open(folder.clone(), earlier, None, "artgs reconstruct")
    }

    const ALL: [Earlier; 3] = [Earlier::Refuse, Earlier::Resume, Earlier::Discard];

    #[test]
    fn missing_and_empty_folders_are_taken() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path().join("a/b"));
        open(&run, Earlier::Refuse).unwrap();
        open(&run, Earlier::Refuse).unwrap();
        assert!(run.root().is_dir());
    }

    #[test]
    fn foreign_files_are_never_touched() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path());
        fs::write(root.path().join("thesis.tex"), "x").unwrap();
        fs::create_dir(run.stage("")).unwrap();
        for earlier in ALL {
            let error = open(&run, earlier).unwrap_err();
            assert!(error.is_bad_input() && error.to_string().contains("did not write"), "{error}");
            let file = RunFolder::new(root.path().join("thesis.tex"));
            assert!(open(&file, earlier).unwrap_err().is_bad_input());
        }
        assert!(run.stage("").is_dir());
    }

    #[test]
    fn an_earlier_run_is_resumed_or_discarded_only_on_request() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path());
        fs::write(run.events(), "").unwrap();
        open(&run, Earlier::Refuse).unwrap();
        artgs_io::write_atomic(&run.found_parts(), b"{}").unwrap();
        let error = open(&run, Earlier::Refuse).unwrap_err();
        assert!(matches!(error, OutputError::Earlier(_)) && error.is_bad_input(), "{error}");
        assert!(open(&run, Earlier::Resume).unwrap().resumes());
        assert!(run.stage("").is_dir());
        open(&run, Earlier::Discard).unwrap();
        assert!(!run.stage("").exists());
        open(&run, Earlier::Refuse).unwrap();
    }

    #[test]
    fn images_in_what_is_discarded_are_not_removed() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path());
        artgs_io::write_atomic(&run.aligned().join("transforms_train_start.json"), b"{}").unwrap();
        let check = |earlier| Output::check(&run, earlier, Some(&run.aligned()));
        assert!(matches!(check(Earlier::Discard), Err(OutputError::Photos { .. })));
        let opened = Output::open(run.clone(), Earlier::Discard, Some(&run.aligned()), "a test");
        assert!(matches!(opened, Err(OutputError::Photos { .. })) && run.aligned().is_dir());
        check(Earlier::Resume).unwrap();
    }

    #[test]
    fn a_folder_in_use_is_refused_in_all_cases() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path().join("out"));
        let output = open(&run, Earlier::Refuse).unwrap();
        artgs_io::write_atomic(&run.found_parts(), b"{}").unwrap();
        for earlier in ALL {
            let error = open(&run, earlier).unwrap_err();
            let text = error.to_string();
            assert!(error.is_bad_input() && text.contains("in use by process") && text.contains("wait"), "{text}");
        }
        assert!(run.has_found_parts());
        drop(output);
        open(&run, Earlier::Resume).unwrap();
    }
}
