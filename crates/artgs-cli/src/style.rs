//! How results are shown.

/// How results are shown.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Style {
    /// JSON, one object per line, and nothing else on standard output.
    pub(crate) json: bool,
    /// No progress and no summary.
    pub(crate) quiet: bool,
    /// No warnings either: an observer in this process gets them.
    pub(crate) silent: bool,
}
