//! Files of the same content that are stored once: formats of an export hold the same meshes and textures.

use crate::FileDigest;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Makes files of the same content hard links to the first of them and returns the bytes that this saves. Every path stays where it
/// is, and a copy of a folder has all of its files. Files on a medium without hard links stay as they are.
pub(crate) fn store_once<'a>(files: impl Iterator<Item = (PathBuf, &'a FileDigest)>) -> u64 {
    let mut first: BTreeMap<(u64, &str), PathBuf> = BTreeMap::new();
    let mut saved = 0;
    for (path, digest) in files.filter(|(_, digest)| digest.bytes > 0) {
        match first.get(&(digest.bytes, digest.xxh3.as_str())) {
            Some(same) if link(same, &path).is_some() => saved += digest.bytes,
            Some(_) => {}
            None => {
                first.insert((digest.bytes, &digest.xxh3), path);
            }
        }
    }
    saved
}

/// Replaces a file by a link to another one if both have the same bytes; none if it was not replaced.
fn link(same: &Path, path: &Path) -> Option<()> {
    // A hash is no proof.
    if fs::read(same).ok()? != fs::read(path).ok()? {
        return None;
    }
    let mut name = path.file_name()?.to_os_string();
    name.push(".link");
    let new = path.with_file_name(name);
    fs::hard_link(same, &new).ok()?;
    // The path names one of two equal files at any time.
    fs::rename(&new, path).inspect_err(|_| drop(fs::remove_file(&new))).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_files_become_one_and_others_stay() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = dir.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, text).unwrap();
            path
        };
        let paths =
            [write("a/x", "mesh"), write("b/x", "mesh"), write("b/y", "hull"), write("c/z", "mesh"), write("e", "")];
        let mut digests = paths.each_ref().map(|path| FileDigest::of(path).unwrap());
        // Two files with the same hash.
        digests[2] = digests[0].clone();
        let files = || paths.iter().cloned().zip(&digests);
        assert_eq!(store_once(files()), 8);
        let texts = paths.each_ref().map(|path| fs::read_to_string(path).unwrap());
        assert_eq!(texts, ["mesh", "mesh", "hull", "mesh", ""]);
        assert_eq!(fs::read_dir(dir.path().join("b")).unwrap().count(), 2);
        #[cfg(unix)]
        {
            use std::os::unix::fs::MetadataExt;
            let links = paths.each_ref().map(|path| fs::metadata(path).unwrap().nlink());
            assert_eq!(links, [3, 3, 1, 3, 1]);
        }
        // A file that is replaced leaves the others as they are.
        crate::write_atomic(&paths[1], b"other").unwrap();
        assert_eq!(fs::read_to_string(&paths[0]).unwrap(), "mesh");
    }
}
