//! The built page from `dist/`.

/// HTML of the page.
pub(crate) const HTML: &str = include_str!("../dist/index.html");
/// Script of the page with all its dependencies.
pub(crate) static SCRIPT: &str = include_str!("../dist/viewer.js");
/// Style of the page.
pub(crate) static STYLE: &str = include_str!("../dist/viewer.css");

/// Content security policy: the page may load only itself. Workers of the splat sorter are blobs, its code is a data URL,
/// files of an exported page are blobs.
pub(crate) const POLICY: &str = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval' blob: data:; \
    worker-src blob: data:; connect-src 'self' blob: data:; img-src 'self' blob: data:; \
    style-src 'self' 'unsafe-inline'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
