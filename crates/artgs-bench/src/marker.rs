//! The file that marks a folder as the output of a benchmark, and says what the benchmark is of.

use crate::bench::BenchError;
use artgs_io::run_folder::load_json;
use artgs_io::{FolderLock, write_atomic};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::path::Path;

/// Name of the file.
pub(crate) const MARKER: &str = "bench.json";

/// What a benchmark is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Kind {
    /// Objects of suites, and captures in folders.
    Suites,
    /// Random objects.
    Population,
}

impl Kind {
    /// What a folder of the other kind holds, for messages.
    fn other(self) -> &'static str {
        match self {
            Self::Suites => "a bench of the population",
            Self::Population => "a bench of suites or captures",
        }
    }
}

/// The field of the file that is read.
#[derive(Debug, Default, Deserialize)]
struct Marker {
    #[serde(default)]
    kind: Option<Kind>,
}

/// True if a benchmark of this kind wrote the folder. Earlier versions wrote no kind: then a folder with `rows` is one of a population, and
/// one without `rows`, or with `runs`, one of suites.
pub(crate) fn is_of(folder: &Path, kind: Kind) -> bool {
    let marker = folder.join(MARKER);
    if !marker.is_file() {
        return false;
    }
    // A marker that was damaged says nothing about the kind.
    let found = load_json::<Marker>(&marker).ok().flatten().unwrap_or_default().kind;
    let has = |name: &str| folder.join(name).is_dir();
    match (found, kind) {
        (Some(found), _) => found == kind,
        (None, Kind::Population) => has("rows"),
        (None, Kind::Suites) => !has("rows") || has("runs"),
    }
}

/// Marks the folder as the output of a benchmark and locks it; refuses a folder with other files, or of the other kind.
pub(crate) fn claim(out: &Path, kind: Kind) -> Result<FolderLock, BenchError> {
    let shown = || out.display().to_string();
    if out.exists() && !out.is_dir() {
        return Err(BenchError::IsFile(shown()));
    }
    let marker = out.join(MARKER);
    let empty = std::fs::read_dir(out).map(|mut entries| entries.next().is_none()).unwrap_or(!out.exists());
    if !empty && !marker.is_file() {
        return Err(BenchError::ForeignFolder(shown()));
    }
    if !empty && !is_of(out, kind) {
        return Err(BenchError::OtherKind { folder: shown(), holds: kind.other() });
    }
    FolderLock::require_free(out)?;
    let content = json!({ "program": "artgs bench", "version": env!("CARGO_PKG_VERSION"), "kind": kind });
    write_atomic(&marker, format!("{content:#}\n").as_bytes())?;
    Ok(FolderLock::take(out, "artgs bench")?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(out: &Path, kind: Kind) -> String {
        let error = claim(out, kind).unwrap_err();
        assert!(error.is_bad_input(), "{error}");
        error.to_string()
    }

    #[test]
    fn a_folder_of_one_kind_is_refused_to_the_other() {
        for (kind, other, words) in [
            (Kind::Suites, Kind::Population, "holds a bench of suites or captures; give another folder to -o"),
            (Kind::Population, Kind::Suites, "holds a bench of the population; give another folder to -o"),
        ] {
            let out = tempfile::tempdir().unwrap();
            drop(claim(out.path(), kind).unwrap());
            let said = refusal(out.path(), other);
            assert!(said.contains(words), "{said}");
            drop(claim(out.path(), kind).unwrap());
            assert!(is_of(out.path(), kind) && !is_of(out.path(), other));
        }
    }

    #[test]
    fn folders_of_earlier_versions_are_continued() {
        for (folders, suites, population) in [
            (&[][..], true, false),
            (&["runs"], true, false),
            (&["rows"], false, true),
            (&["rows", "runs"], true, true),
        ] {
            let out = tempfile::tempdir().unwrap();
            let old = json!({ "program": "artgs bench", "version": "0.1.0" }).to_string();
            std::fs::write(out.path().join(MARKER), old).unwrap();
            folders.iter().for_each(|name| std::fs::create_dir(out.path().join(name)).unwrap());
            let found = (is_of(out.path(), Kind::Suites), is_of(out.path(), Kind::Population));
            assert_eq!(found, (suites, population), "{folders:?}");
        }
        let foreign = tempfile::tempdir().unwrap();
        assert!(!is_of(foreign.path(), Kind::Suites), "without a marker");
    }

    #[test]
    fn a_file_is_no_folder() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("out");
        std::fs::write(&file, "").unwrap();
        let said = refusal(&file, Kind::Suites);
        assert!(said.ends_with("out is a file; give a folder to -o"), "{said}");
    }
}
