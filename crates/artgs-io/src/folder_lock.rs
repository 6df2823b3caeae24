//! Locks of output folders: one process at a time writes into a folder.
//!
//! The operating system holds the lock and releases it when the process ends, however it ends. A second small file names
//! the owner: what it left behind says that an earlier process was killed.

use crate::{FileError, write_atomic};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// The locked file; empty.
pub(crate) const LOCK_FILE: &str = ".artgs.lock";
/// Says who locked it.
pub(crate) const OWNER_FILE: &str = ".artgs.owner.json";

/// A folder that no other process writes into as long as this value exists.
#[derive(Debug)]
pub struct FolderLock {
    folder: PathBuf,
    /// Held open, because closing it releases the lock.
    file: File,
    notice: Option<LockNotice>,
}

/// Who holds, or held, a lock.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LockOwner {
    /// Process.
    pub pid: u32,
    /// Name of the computer.
    pub host: String,
    /// What it does, such as `artgs export`.
    pub command: String,
    /// When it took the lock, seconds since 1970.
    pub since: u64,
}

/// Something to mention about a lock that was taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LockNotice {
    /// An earlier process was ended before it released the lock.
    TakenOver(LockOwner),
    /// The file system has no locks, for this reason: another process would not be noticed.
    Unsupported(String),
}

/// Why a folder cannot be locked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LockError {
    /// Another process writes into it.
    #[error(
        "{}: in use by {}; wait until it ends, stop it, or use another folder",
        folder.display(),
        owner.as_ref().map_or("another process".into(), ToString::to_string)
    )]
    InUse {
        /// The folder.
        folder: PathBuf,
        /// Who; none if that cannot be read.
        owner: Option<LockOwner>,
    },
    /// The folder cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

impl FolderLock {
    /// Locks a folder that exists. `command` says to others what is done.
    pub fn take(folder: &Path, command: &str) -> Result<Self, LockError> {
        Self::take_by(folder, command, File::try_lock)
    }

    fn take_by(
        folder: &Path,
        command: &str,
        try_lock: impl Fn(&File) -> Result<(), TryLockError>,
    ) -> Result<Self, LockError> {
        let path = folder.join(LOCK_FILE);
        let fail = |source| FileError::Write { path: path.clone(), source };
        let mut attempts = 0;
        let (file, unsupported) = loop {
            let file = OpenOptions::new().create(true).truncate(false).write(true).open(&path).map_err(fail)?;
            let unsupported = match try_lock(&file) {
                Ok(()) => None,
                Err(TryLockError::Error(reason)) => Some(reason.to_string()),
                Err(TryLockError::WouldBlock) if attempts == ATTEMPTS => return Err(in_use(folder)),
                Err(TryLockError::WouldBlock) => {
                    attempts += 1;
                    std::thread::sleep(PAUSE);
                    continue;
                }
            };
            // An owner that ends removes its file: a lock on a removed file excludes nobody.
            if is_file_at(&file, &path) {
                break (file, unsupported);
            }
        };
        let earlier = owner(folder);
        let notice = unsupported.map(LockNotice::Unsupported).or(earlier.map(LockNotice::TakenOver));
        let text = serde_json::to_string(&LockOwner::this_process(command)).unwrap_or_default();
        write_atomic(&folder.join(OWNER_FILE), text.as_bytes())?;
        Ok(Self { folder: folder.into(), file, notice })
    }

    /// Refuses a folder that another process has locked; writes nothing.
    pub fn require_free(folder: &Path) -> Result<(), LockError> {
        let Ok(file) = File::open(folder.join(LOCK_FILE)) else { return Ok(()) };
        for attempt in 0..=ATTEMPTS {
            match file.try_lock_shared() {
                Err(TryLockError::WouldBlock) if attempt < ATTEMPTS => std::thread::sleep(PAUSE),
                Err(TryLockError::WouldBlock) => return Err(in_use(folder)),
                _ => break,
            }
        }
        Ok(())
    }

    /// What to mention about it.
    pub fn notice(&self) -> Option<&LockNotice> {
        self.notice.as_ref()
    }
}

/// Locks that are held for a moment, to save a file or to look for a lock, refuse nobody.
const ATTEMPTS: usize = 10;
const PAUSE: Duration = Duration::from_millis(20);

impl Drop for FolderLock {
    fn drop(&mut self) {
        // Files that remain do no harm.
        let _ = fs::remove_file(self.folder.join(OWNER_FILE));
        // Elsewhere an open file cannot be removed, or its place cannot be checked.
        if cfg!(unix) {
            let _ = fs::remove_file(self.folder.join(LOCK_FILE));
        }
        let _ = self.file.unlock();
    }
}

impl LockOwner {
    fn this_process(command: &str) -> Self {
        Self { pid: std::process::id(), host: host(), command: command.into(), since: now() }
    }
}

impl fmt::Display for LockOwner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let age = now().saturating_sub(self.since);
        let age = match age {
            0..120 => format!("{age} s"),
            120..7200 => format!("{} min", age / 60),
            _ => format!("{} h", age / 3600),
        };
        write!(f, "process {} on {} ({}, for {age})", self.pid, self.host, self.command)
    }
}

impl fmt::Display for LockNotice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TakenOver(LockOwner { pid, host, command, .. }) => {
                write!(f, "process {pid} on {host} ({command}) was ended before it was done; its lock is taken over")
            }
            Self::Unsupported(reason) => {
                write!(f, "the output folder cannot be locked ({reason}): do not start a second run in it")
            }
        }
    }
}

fn in_use(folder: &Path) -> LockError {
    LockError::InUse { folder: folder.into(), owner: owner(folder) }
}

fn owner(folder: &Path) -> Option<LockOwner> {
    serde_json::from_slice(&fs::read(folder.join(OWNER_FILE)).ok()?).ok()
}

fn now() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs())
}

/// Name of this computer.
fn host() -> String {
    let files = ["/proc/sys/kernel/hostname", "/etc/hostname"].into_iter().filter_map(|f| fs::read_to_string(f).ok());
    let variables = ["COMPUTERNAME", "HOSTNAME"].into_iter().filter_map(|name| std::env::var(name).ok());
    let name = files.chain(variables).map(|name| name.trim().to_string()).find(|name| !name.is_empty());
    name.unwrap_or_else(|| "this computer".into())
}

#[cfg(unix)]
fn is_file_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), fs::metadata(path)) {
        (Ok(open), Ok(named)) => (open.dev(), open.ino()) == (named.dev(), named.ino()),
        _ => false,
    }
}

#[cfg(not(unix))]
fn is_file_at(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    #[test]
    fn a_second_owner_is_refused_until_the_first_ends() {
        let dir = tempfile::tempdir().unwrap();
        FolderLock::require_free(dir.path()).unwrap();
        let lock = FolderLock::take(dir.path(), "artgs reconstruct").unwrap();
        assert_eq!(lock.notice(), None);
        let process = format!("process {} on {} (artgs reconstruct, for ", std::process::id(), host());
        for refused in [FolderLock::take(dir.path(), "x").map(drop), FolderLock::require_free(dir.path())] {
            let message = refused.unwrap_err().to_string();
            assert!(message.contains(&process) && message.contains("wait until it ends"), "{message}");
        }
        drop(lock);
        FolderLock::require_free(dir.path()).unwrap();
        drop(FolderLock::take(dir.path(), "y").unwrap());
        assert!(!cfg!(unix) || fs::read_dir(dir.path()).unwrap().next().is_none());
    }

    #[test]
    fn files_of_a_killed_owner_do_not_refuse() {
        let dir = tempfile::tempdir().unwrap();
        let killed = LockOwner { pid: 1, host: "far".into(), command: "artgs export".into(), since: now() };
        fs::write(dir.path().join(LOCK_FILE), "").unwrap();
        fs::write(dir.path().join(OWNER_FILE), serde_json::to_string(&killed).unwrap()).unwrap();
        FolderLock::require_free(dir.path()).unwrap();
        let lock = FolderLock::take(dir.path(), "artgs view").unwrap();
        assert_eq!(lock.notice(), Some(&LockNotice::TakenOver(killed)));
        assert!(lock.notice().unwrap().to_string().contains("process 1 on far (artgs export)"));
    }

    #[test]
    fn one_of_many_that_start_and_end_together_has_the_lock() {
        let dir = tempfile::tempdir().unwrap();
        let held = std::sync::atomic::AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    for _ in 0..50 {
                        let Ok(lock) = FolderLock::take(dir.path(), "x") else { continue };
                        assert_eq!(held.fetch_add(1, std::sync::atomic::Ordering::SeqCst), 0);
                        held.fetch_sub(1, std::sync::atomic::Ordering::SeqCst);
                        drop(lock);
                    }
                });
            }
        });
    }

    #[test]
    fn a_file_system_without_locks_is_mentioned_and_used() {
        let dir = tempfile::tempdir().unwrap();
        let none = |_: &File| Err(TryLockError::Error(io::ErrorKind::Unsupported.into()));
        let lock = FolderLock::take_by(dir.path(), "x", none).unwrap();
        assert!(lock.notice().unwrap().to_string().contains("cannot be locked"));
        assert!(matches!(FolderLock::take(&dir.path().join("none"), "x"), Err(LockError::File(_))));
    }
}
