//! Size and hash of files, by which files are recognised that were altered after they were written.

use crate::{FileError, RunFolder, read_replica};
use artgs_core::State;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::hash::Hasher;
use std::io::Read;
use std::path::{Path, PathBuf};
use twox_hash::XxHash3_64;

/// Size and hash of a file. The hash finds damage, it is no protection against forgery.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileDigest {
    /// Size.
    pub bytes: u64,
    /// XXH3, 64 bits, hexadecimal.
    pub xxh3: String,
}

impl FileDigest {
    /// That of a file.
    pub fn of(path: &Path) -> Result<Self, FileError> {
        let mut hash = XxHash3_64::new();
        let bytes = add(path, &mut hash)?;
        Ok(Self { bytes, xxh3: format!("{:016x}", hash.finish()) })
    }
}

/// Hash of a text, and of the names and contents of all files below some files and folders, hexadecimal. The folders above the given
/// ones do not count, nor does the order in which a folder lists its files.
pub fn tree_digest(text: &str, roots: &[PathBuf]) -> Result<String, FileError> {
    let mut hash = XxHash3_64::new();
    hash.write(text.as_bytes());
    for root in roots {
        let mut files = Vec::new();
        list(root, root, &mut files)?;
        files.sort();
        for (name, file) in files {
            let bytes = add(&file, &mut hash)?;
            hash.write(format!("\0{name}\0{bytes}\0").as_bytes());
        }
        hash.write(b"\0\0");
    }
    Ok(format!("{:016x}", hash.finish()))
}

/// Names of files relative to `root`, with their paths.
fn list(root: &Path, path: &Path, files: &mut Vec<(String, PathBuf)>) -> Result<(), FileError> {
    if !path.is_dir() {
        let name = path.strip_prefix(root).unwrap_or(path).components();
        let name = name.map(|part| part.as_os_str().to_string_lossy().into_owned()).collect::<Vec<_>>().join("/");
        files.push((name, path.into()));
        return Ok(());
    }
    let fail = |source| FileError::Read { path: path.into(), source };
    for entry in std::fs::read_dir(path).map_err(fail)? {
        list(root, &entry.map_err(fail)?.path(), files)?;
    }
    Ok(())
}

/// Adds the content of a file to a hash; returns its size.
fn add(path: &Path, hash: &mut XxHash3_64) -> Result<u64, FileError> {
    let fail = |source| FileError::Read { path: path.into(), source };
    let mut file = File::open(path).map_err(fail)?;
    let mut piece = vec![0; 1 << 16];
    let mut bytes = 0;
    loop {
        let count = file.read(&mut piece).map_err(fail)?;
        if count == 0 {
            return Ok(bytes);
        }
        hash.write(&piece[..count]);
        bytes += count as u64;
    }
}

impl RunFolder {
    /// Hash of everything that exports are made from, hexadecimal: `replica.json`, meshes and Gaussians of the parts. None
    /// if there is no valid replica.
    pub fn replica_digest(&self) -> Result<Option<String>, FileError> {
        let Ok(replica) = read_replica(self.root()) else { return Ok(None) };
        let meshes = State::ALL.into_iter().flat_map(|state| replica.parts.iter().map(move |p| &p.meshes[state]));
        let splats = (0..replica.parts.len()).map(|part| self.part_splats(part)).filter(|path| path.is_file());
        let meshes: Vec<PathBuf> = meshes.map(|mesh| self.root().join(mesh)).collect();
        let mut hash = XxHash3_64::new();
        for path in std::iter::once(self.replica()).chain(meshes).chain(splats) {
            let bytes = add(&path, &mut hash)?;
            hash.write(&bytes.to_le_bytes());
        }
        Ok(Some(format!("{:016x}", hash.finish())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn the_digest_of_a_tree_depends_on_names_and_contents_alone() {
        let make = |names: &[&str], text: &str| {
            let dir = tempfile::tempdir().unwrap();
            for name in names {
                crate::write_atomic(&dir.path().join(name), text.as_bytes()).unwrap();
            }
            tree_digest("options", &[dir.path().into()]).unwrap()
        };
        assert_eq!(make(&["a", "b/c"], "x"), make(&["b/c", "a"], "x"));
        assert_ne!(make(&["a", "b/c"], "x"), make(&["a", "b/d"], "x"));
        assert_ne!(make(&["a", "b/c"], "x"), make(&["a", "b/c"], "y"));
        let file = tempfile::NamedTempFile::new().unwrap();
        let of = |text: &str| tree_digest(text, &[file.path().into()]).unwrap();
        assert_ne!(of("a"), of("b"));
        assert!(tree_digest("", &["absent".into()]).is_err());
    }

    #[test]
    fn a_digest_changes_with_every_byte() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.bin");
        let mut bytes = vec![7; 200_000];
        fs::write(&path, &bytes).unwrap();
        let first = FileDigest::of(&path).unwrap();
        assert_eq!((first.bytes, first.xxh3.len()), (200_000, 16));
        assert_eq!(FileDigest::of(&path).unwrap(), first);
        for at in [0, 99_999, 199_999] {
            bytes[at] ^= 1;
            fs::write(&path, &bytes).unwrap();
            assert_ne!(FileDigest::of(&path).unwrap(), first);
            bytes[at] ^= 1;
        }
        fs::write(&path, "").unwrap();
        assert_eq!(FileDigest::of(&path).unwrap().bytes, 0);
        assert!(FileDigest::of(dir.path()).is_err() && FileDigest::of(&dir.path().join("b")).is_err());
    }
}
