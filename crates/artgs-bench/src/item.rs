//! Objects to reconstruct: captures in folders, or procedural objects whose views are rendered first.

use crate::paper::PaperObject;
use artgs_io::FileError;
use artgs_io::ground_truth::read_true_joints;
use std::fmt;
use std::path::{Path, PathBuf};

/// Renders the capture of an object into a folder, `gt` included; the error says why it cannot.
pub type Renderer = Box<dyn Fn(&Path) -> Result<(), String> + Send + Sync>;

/// Where a capture comes from.
pub enum Source {
    /// A capture with its ground truth under `gt`.
    Folder(PathBuf),
    /// An object whose views are rendered.
    Procedural {
        /// All settings that affect the pictures; they are rendered again only if this text changes.
        settings: String,
        /// Renders the pictures.
        write: Renderer,
    },
}

impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Folder(path) => f.debug_tuple("Folder").field(path).finish(),
            Self::Procedural { settings, .. } => f.debug_tuple("Procedural").field(settings).finish(),
        }
    }
}

/// An object of a bench.
#[derive(Debug)]
pub struct Item {
    /// Name, also of its folder: letters, digits, `.`, `_` and `-`.
    pub name: String,
    /// Where its capture comes from.
    pub source: Source,
    /// True number of parts, the static one included; given to the method, as in the paper, unless it is to find it.
    pub parts: Option<usize>,
    /// Object of the paper that it is or that it replaces.
    pub stands_for: Option<&'static PaperObject>,
    /// True if it is that object, so that numbers are comparable.
    pub same_object: bool,
    /// What degrades the capture, for plots: a number or a word.
    pub noise: Option<String>,
}

/// Why a folder holds nothing to reconstruct and score.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ItemError {
    /// Neither a capture with ground truth nor a folder of such captures.
    #[error("{0} is neither a capture with ground truth (`gt/trans.json`) nor a folder of such captures")]
    NoCapture(String),
    /// A name that cannot be a folder of the output.
    #[error("`{0}`: the name of an object may hold letters, digits, `.`, `_` and `-` only; rename the folder")]
    Name(String),
    /// Two objects of one name.
    #[error("two objects are called `{0}`; rename one of the folders")]
    Twice(String),
    /// The ground truth could not be read.
    #[error(transparent)]
    Truth(#[from] FileError),
    /// A folder could not be listed.
    #[error("{path}: {source}")]
    List {
        /// The folder.
        path: String,
        /// Why.
        source: std::io::Error,
    },
}

const TRUTH: &str = "gt/trans.json";

/// The captures of a folder: the folder itself if it has ground truth, else its subfolders with ground truth, by name.
pub fn items_of_folder(folder: &Path) -> Result<Vec<Item>, ItemError> {
    let list = |source| ItemError::List { path: folder.display().to_string(), source };
    if folder.join(TRUTH).is_file() {
        return Ok(vec![item_of_capture(folder)?]);
    }
    let mut captures = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(list)? {
        let path = entry.map_err(list)?.path();
        if path.join(TRUTH).is_file() {
            captures.push(path);
        }
    }
    if captures.is_empty() {
        return Err(ItemError::NoCapture(folder.display().to_string()));
    }
    captures.sort();
    captures.iter().map(|path| item_of_capture(path)).collect()
}

fn item_of_capture(folder: &Path) -> Result<Item, ItemError> {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    let name = whole.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let joints = read_true_joints(&folder.join("gt"))?.len();
    Ok(Item {
        name,
        source: Source::Folder(whole),
        parts: Some(joints + 1),
        stands_for: None,
        same_object: false,
        noise: None,
    })
}

/// Refuses names that cannot be folder names, and duplicate names.
pub(crate) fn check_names(items: &[Item]) -> Result<(), ItemError> {
    for (index, item) in items.iter().enumerate() {
        check_name(&item.name)?;
        if items[..index].iter().any(|other| other.name == item.name) {
            return Err(ItemError::Twice(item.name.clone()));
        }
    }
    Ok(())
}

/// Refuses names that are not valid folder names on every system.
pub(crate) fn check_name(name: &str) -> Result<(), ItemError> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    let good = !name.is_empty() && !name.starts_with('.') && name.chars().all(allowed);
    if good { Ok(()) } else { Err(ItemError::Name(name.into())) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::write_truth;

    #[test]
    fn captures_are_found_in_order_with_their_number_of_parts() {
        let root = tempfile::tempdir().unwrap();
        for (name, joints) in [("b", 2), ("a", 1)] {
            write_truth(&root.path().join(name).join("gt"), joints);
        }
        std::fs::create_dir(root.path().join("other")).unwrap();
        let items = items_of_folder(root.path()).unwrap();
        let found: Vec<_> = items.iter().map(|i| (i.name.as_str(), i.parts)).collect();
        assert_eq!(found, [("a", Some(2)), ("b", Some(3))]);
        let one = items_of_folder(&root.path().join("b")).unwrap();
        assert_eq!(one.len(), 1);
        let none = items_of_folder(&root.path().join("other")).unwrap_err();
        assert!(none.to_string().contains("gt/trans.json"), "{none}");
    }

    #[test]
    fn names_must_be_plain_and_distinct() {
        let item = |name: &str| Item {
            name: name.into(),
            source: Source::Folder("x".into()),
            parts: None,
            stands_for: None,
            same_object: false,
            noise: None,
        };
        check_names(&[item("a"), item("b-1.0_c")]).unwrap();
        assert!(matches!(check_names(&[item("a"), item("a")]), Err(ItemError::Twice(_))));
        for name in ["", "..", "a/b", "a b", "ä"] {
            assert!(matches!(check_names(&[item(name)]), Err(ItemError::Name(_))), "{name}");
        }
    }
}
