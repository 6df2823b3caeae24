//! How the program was started.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// How the program was started.
struct Started {
    program: PathBuf,
    words: Vec<OsString>,
}

static STARTED: OnceLock<Started> = OnceLock::new();

/// Notes it, once in a process; returns the words of the command line.
pub(crate) fn note(program: &Path, words: Vec<OsString>) -> &'static [OsString] {
    &STARTED.get_or_init(|| Started { program: program.into(), words }).words
}

/// The program that is running.
pub(crate) fn program() -> Option<&'static Path> {
    STARTED.get().map(|started| started.program.as_path())
}

/// The command as a shell reads it back.
#[cfg(feature = "bench")]
pub(crate) fn line() -> String {
    let words = STARTED.get().into_iter().flat_map(|started| started.words.iter().skip(1));
    let words = words.map(|word| quoted(&word.to_string_lossy()));
    std::iter::once("artgs".to_string()).chain(words).collect::<Vec<_>>().join(" ")
}

/// A word as a shell reads it back.
#[cfg(feature = "bench")]
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.into() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

#[cfg(all(test, feature = "bench"))]
mod tests {
    use super::*;

    #[test]
    fn words_come_back_from_a_shell() {
        assert_eq!(["a/b-c.d=e", "a b", "", "it's"].map(quoted), ["a/b-c.d=e", "'a b'", "''", "'it'\\''s'"]);
    }
}
