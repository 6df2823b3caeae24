//! Readers of all formats, mostly independent libraries.

mod glb;
mod mjcf;
mod sdf;
mod simready;
mod splats;
mod urdf;
mod usd;

use crate::model::Model;
use crate::report::FormatFinding;
use artgs_io::asset::is_scene;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// An export file with its finding.
pub(crate) struct Opened {
    pub(crate) finding: FormatFinding,
    /// None if it does not open or contains no model.
    pub(crate) model: Option<Model>,
}

thread_local! {
    /// True while a reader is called on this thread.
    static READING: Cell<bool> = const { Cell::new(false) };
}

/// True on a thread that reads an export: a panic there is a finding, and no error of the program.
pub fn is_reading() -> bool {
    READING.get()
}

type Reader = fn(&Path, &mut FormatFinding) -> Result<Option<Model>, String>;

/// Folder of `exports/`, ending of a file in it, name of the format, library, and how to read it.
const READERS: [(&str, &str, &str, &str, Reader); 11] = [
    ("urdf", "urdf", "urdf", "urdf-rs", urdf::read),
    ("mjcf", "xml", "mjcf", "mjcf-rs", mjcf::read),
    ("usd", "usda", "usda", "openusd", usd::read),
    ("usd", "usdc", "usdc", "openusd", usd::read),
    ("usdz", "usdz", "usdz", "openusd", usd::read),
    ("glb", "glb", "glb", "gltf", glb::read),
    ("sdf", "sdf", "sdf", "roxmltree", sdf::read),
    ("partnet", "urdf", "partnet", "urdf-rs", urdf::read_partnet),
    ("splats", "ply", "ply", "artgs", splats::read_ply),
    ("splats", "spz", "spz", "artgs", splats::read_spz),
    ("simready", "usda", "simready", "openusd", simready::read),
];

/// Reads every file below `exports/` that has a reader. A folder without any such file is a finding with a problem.
pub(crate) fn open_all(exports: &Path) -> Vec<Opened> {
    let mut out: Vec<Opened> = Vec::new();
    for (folder, ending, format, library, reader) in READERS {
        let dir = exports.join(folder);
        let files = |ending: &str| if format == "simready" { simready::files(&dir) } else { files(&dir, ending) };
        out.extend(files(ending).iter().map(|path| {
            let name = path.strip_prefix(&dir).map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            open(path, finding(folder, &name, format, library), reader)
        }));
        let first = READERS.iter().find(|r| r.0 == folder).is_some_and(|r| r.2 == format);
        let bare = READERS.iter().filter(|r| r.0 == folder).all(|r| files(r.1).is_empty());
        if first && bare && dir.is_dir() {
            let mut finding = finding(folder, "", format, library);
            finding.problems.push(format!("the folder has no .{ending} file; export again"));
            out.push(Opened { finding, model: None });
        }
    }
    out
}

fn finding(folder: &str, name: &str, format: &str, library: &str) -> FormatFinding {
    let file = format!("exports/{folder}/{name}");
    FormatFinding { format: format.into(), file, reader: library.into(), ..FormatFinding::default() }
}

fn open(path: &Path, mut finding: FormatFinding, reader: Reader) -> Opened {
    // `openusd` indexes out of bounds on some broken crate files; a damaged export must not end the check.
    READING.set(true);
    let read = catch_unwind(AssertUnwindSafe(|| reader(path, &mut finding)));
    READING.set(false);
    let model = match read.unwrap_or_else(|_| Err("the reader crashed; the file is damaged".into())) {
        Ok(model) => model,
        Err(reason) => {
            finding.problems.push(format!("does not open: {reason}"));
            None
        }
    };
    if let Some(model) = &model {
        finding.links = model.links.iter().filter(|l| l.is_body()).count();
        finding.joints = model.links.iter().filter(|l| l.motion.is_some()).count();
        finding.meshes = model.links.iter().map(|l| l.visuals.len()).sum();
        finding.hulls = model.links.iter().map(|l| l.hulls.len()).sum();
        finding.problems.extend(model.faults());
    }
    Opened { finding, model }
}

/// Files with an extension, sorted; without the scene that shows another one.
fn files(dir: &Path, ending: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(dir).into_iter().flatten().flatten().map(|e| e.path());
    let mut out: Vec<PathBuf> = entries.filter(|p| p.is_file() && p.extension().is_some_and(|e| e == ending)).collect();
    out.sort();
    if out.len() > 1 {
        out.retain(|path| !is_scene(path));
    }
    out
}

/// The folder that a file lies in.
fn folder(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new("."))
}

/// Exactly `N` numbers separated by blanks.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let values: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    values.ok().and_then(|v| v.try_into().ok()).ok_or_else(|| format!("{text:?} is not {N} numbers"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_that_panics_is_a_problem_of_the_file() {
        fn trips(path: &Path, _: &mut FormatFinding) -> Result<Option<Model>, String> {
            let table: [u8; 2] = [0, 1];
            Ok((table[path.as_os_str().len()] > 9).then(Model::default))
        }
        let opened = open(Path::new("broken.usdc"), finding("usd", "broken.usdc", "usdc", "openusd"), trips);
        assert!(opened.model.is_none());
        assert_eq!(opened.finding.problems, ["does not open: the reader crashed; the file is damaged"]);
    }

    #[test]
    fn numbers_are_counted() {
        assert_eq!(numbers::<2>(" 1  -2.5 "), Ok([1.0, -2.5]));
        assert!(numbers::<2>("1").is_err() && numbers::<1>("x").is_err());
    }
}
