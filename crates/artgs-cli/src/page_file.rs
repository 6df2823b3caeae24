//! Where the page of a report goes.

use std::path::{Path, PathBuf};

/// Name of the page in a folder.
const PAGE: &str = "report.html";

/// The file of the page.
pub(crate) fn page_file(out: Option<&Path>, base: &Path) -> PathBuf {
    let is_page = |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("html"));
    match out {
        None => base.join(PAGE),
        Some(out) if is_page(out) && !out.is_dir() => out.into(),
        Some(folder) => folder.join(PAGE),
    }
}
