//! Exports the page to one file that needs no server.

use crate::bundle::{HTML, POLICY, SCRIPT, STYLE};
use crate::{Page, ViewError};
use artgs_io::{FileError, write_atomic};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write as _;
use std::path::Path;

/// Lines of `dist/index.html` that refer to other files.
const LINK: &str = "<link rel=\"stylesheet\" href=\"viewer.css\">";
const CODE: &str = "<script type=\"module\" src=\"viewer.js\"></script>";

/// Writes a page with embedded style, script, scene and files (gzip, base 64). It can be opened from disk.
pub fn export_page(page: &Page, file: &Path) -> Result<(), ViewError> {
    let mut page = page.clone();
    page.scene.corrections = false;
    page.scene.rerun = None;
    let mut data = element("scene.json", page.scene_json()?.as_bytes(), file)?;
    for (name, source) in &page.files {
        data += &element(name, &source.read()?, file)?;
    }
    // A meta element does not support frame-ancestors; scripts and styles are inline here.
    let policy = POLICY.replace("; frame-ancestors 'none'", "").replace("'self'", "'unsafe-inline'");
    let head = format!("<meta http-equiv=\"Content-Security-Policy\" content=\"{policy}\">\n<style>{STYLE}</style>");
    let code = format!("{data}<script type=\"module\">{SCRIPT}</script>");
    let html = HTML.replacen(LINK, &head, 1).replacen(CODE, &code, 1);
    Ok(write_atomic(file, html.as_bytes())?)
}

/// An inert script element that contains a file.
fn element(name: &str, bytes: &[u8], page: &Path) -> Result<String, FileError> {
    let fail = |source| FileError::Write { path: page.into(), source };
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).map_err(fail)?;
    let packed = STANDARD.encode(encoder.finish().map_err(fail)?);
    Ok(format!("<script type=\"text/plain\" data-file=\"{name}\">{packed}</script>\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_page_has_the_replaced_lines() {
        assert_eq!((HTML.matches(LINK).count(), HTML.matches(CODE).count()), (1, 1));
        assert!(!SCRIPT.contains("</script") && !STYLE.contains("</style"));
        assert!(!SCRIPT.contains("sourceMappingURL"));
    }
}
