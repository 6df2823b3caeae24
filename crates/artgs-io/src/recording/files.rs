//! Small files of recordings: tables of text and folders.

use super::RecordingError;
use crate::error::read_bytes;
use std::path::Path;

/// A line of a table without its comment.
pub(super) struct Row {
    /// From 1.
    pub(super) line: usize,
    pub(super) text: String,
}

impl Row {
    /// Words between spaces.
    pub(super) fn words(&self) -> impl Iterator<Item = &str> {
        self.text.split_whitespace()
    }

    /// True for the names of columns, as some programs write them without `#`.
    pub(super) fn is_header(&self) -> bool {
        const NAMES: [&str; 6] = ["time", "stamp", "frame", "index", "tx", "id"];
        let first = self.words().next().unwrap_or("").trim_end_matches([',', ';']).to_ascii_lowercase();
        first.starts_with(|c: char| c.is_ascii_alphabetic()) && NAMES.iter().any(|name| first.contains(name))
    }

    /// The words as exactly N finite numbers. The error says what is wrong.
    pub(super) fn numbers<const N: usize>(&self) -> Result<[f64; N], String> {
        finite(self.words(), self.line)
    }
}

/// Exactly N finite numbers.
pub(super) fn finite<'a, const N: usize>(
    words: impl Iterator<Item = &'a str>,
    line: usize,
) -> Result<[f64; N], String> {
    let words: Vec<&str> = words.collect();
    let mut numbers = [0.0; N];
    if words.len() != N {
        return Err(format!("line {line}: {} values, expected {N}; complete or remove the line", words.len()));
    }
    for (number, word) in numbers.iter_mut().zip(&words) {
        let parsed = word.parse::<f64>().ok().filter(|v| v.is_finite());
        *number = parsed
            .ok_or_else(|| format!("line {line}: `{word}` is not a finite number; correct or remove the line"))?;
    }
    Ok(numbers)
}

/// Why a row of a table is left out.
pub(super) enum Odd {
    /// The device did not know its pose: numbers that are not finite, or zeros.
    Lost,
    /// The row does not conform to the format.
    Wrong(String),
}

/// The usable rows of a table.
pub(super) struct Table<T> {
    pub(super) rows: Vec<T>,
    /// One sentence for each kind of rows that are left out, with their number.
    pub(super) notes: Vec<String>,
}

/// Parses the rows of a table and leaves out those that are odd. An error if most of them do not conform to the format.
pub(super) fn table<T>(path: &Path, parse: impl Fn(&Row) -> Result<T, Odd>) -> Result<Table<T>, RecordingError> {
    let all = rows(path)?;
    sift(path, &all[usize::from(all.first().is_some_and(Row::is_header))..], parse)
}

/// The same for rows that were read already.
pub(super) fn sift<T>(
    path: &Path,
    all: &[Row],
    parse: impl Fn(&Row) -> Result<T, Odd>,
) -> Result<Table<T>, RecordingError> {
    let mut table = Table { rows: Vec::with_capacity(all.len()), notes: Vec::new() };
    let (mut lost, mut wrong) = (Vec::new(), Vec::new());
    for row in all {
        match parse(row) {
            Ok(value) => table.rows.push(value),
            Err(Odd::Lost) => lost.push(row.line),
            Err(Odd::Wrong(reason)) => wrong.push(reason),
        }
    }
    if let Some(first) = wrong.first() {
        if 2 * wrong.len() > all.len() {
            return Err(RecordingError::malformed(path, first.as_str()));
        }
        table.notes.push(format!(
            "{} of {} lines cannot be read and are left out, first {first}",
            wrong.len(),
            all.len()
        ));
    }
    if let Some(first) = lost.first() {
        table.notes.push(format!(
            "{} of {} poses are lost (not finite, or all zero) and left out, first in line {first}",
            lost.len(),
            all.len()
        ));
    }
    Ok(table)
}

/// Numbers in text that commas, semicolons or spaces separate; `nan` and `inf` are numbers here.
pub(super) fn loose_numbers(text: &str) -> Option<Vec<f64>> {
    let words = text.split(|c: char| c == ',' || c == ';' || c.is_whitespace()).filter(|w| !w.is_empty());
    words.map(|w| w.parse().ok()).collect()
}

/// Lines of a text file that are neither empty nor comments (`#`).
pub(super) fn rows(path: &Path) -> Result<Vec<Row>, RecordingError> {
    let rows =
        text(path)?.lines().enumerate().map(|(i, l)| Row { line: i + 1, text: l.trim().into() }).collect::<Vec<_>>();
    Ok(rows.into_iter().filter(|r| !r.text.is_empty() && !r.text.starts_with('#')).collect())
}

/// A text file.
pub(super) fn text(path: &Path) -> Result<String, RecordingError> {
    String::from_utf8(read_bytes(path)?)
        .map_err(|_| RecordingError::malformed(path, "not a text file; copy or export it again"))
}

/// Names of the entries of a folder, sorted; empty if it cannot be read.
pub(super) fn names(dir: &Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(dir) else { return Vec::new() };
    let mut names: Vec<String> = entries.filter_map(|e| e.ok()?.file_name().into_string().ok()).collect();
    names.sort();
    names
}

/// `NAME` of `PREFIX NAME SUFFIX`.
pub(super) fn between<'a>(name: &'a str, prefix: &str, suffix: &str) -> Option<&'a str> {
    name.strip_prefix(prefix)?.strip_suffix(suffix)
}

/// The first existing file.
pub(super) fn first_file(dir: &Path, names: &[&str]) -> Option<std::path::PathBuf> {
    names.iter().map(|n| dir.join(n)).find(|p| p.is_file())
}

/// Key that sorts names with numbers by their values: 9 before 10.
pub(crate) fn natural(name: &str) -> String {
    let mut key = String::with_capacity(name.len() + 16);
    let mut digits = String::new();
    for c in name.chars().chain(['\0']) {
        if c.is_ascii_digit() {
            digits.push(c);
            continue;
        }
        if !digits.is_empty() {
            key += &format!("{:0>20}", digits.trim_start_matches('0'));
            digits.clear();
        }
        key.push(c);
    }
    key
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_sort_by_value() {
        let mut names = ["a10.jpg", "a9.jpg", "a010b.jpg", "b1"];
        names.sort_by_cached_key(|n| natural(n));
        assert_eq!(names, ["a9.jpg", "a10.jpg", "a010b.jpg", "b1"]);
    }
}
