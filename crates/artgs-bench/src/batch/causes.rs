//! Failures grouped by their cause: reasons without what differs from capture to capture.

use super::row::Row;
use serde::Serialize;
use std::collections::BTreeMap;

/// Ids that a group names.
const EXAMPLES: usize = 5;
/// Longest text of a cause, characters.
const LONGEST: usize = 300;
/// What stands for a path.
const PATH: &str = "PATH";
/// Punctuation around words.
const AROUND: &[char] = &['(', ')', '[', ']', '{', '}', '"', '\'', '`', ',', ';', ':', '.', '!', '?'];

/// Whether the same command may succeed later.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Retry {
    /// For every capture of the group.
    Yes,
    /// For none: captures or options have to be changed.
    No,
    /// For some.
    Some,
}

/// Failures of one cause.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cause {
    /// The reason without paths, numbers, quoted texts and the id.
    pub cause: String,
    /// Number of captures.
    pub count: usize,
    /// Whether the same command may succeed later.
    pub retry: Retry,
    /// The first ids in the order of the table.
    pub ids: Vec<String>,
    /// Reason of the first.
    pub reason: String,
}

/// Groups of failures, the largest first.
pub(crate) fn causes(rows: &[Row]) -> Vec<Cause> {
    let mut groups: BTreeMap<String, Vec<&Row>> = BTreeMap::new();
    for row in rows.iter().filter(|row| !row.done) {
        groups.entry(cause(&row.reason, &row.id)).or_default().push(row);
    }
    let group = |(cause, rows): (String, Vec<&Row>)| Cause {
        cause,
        count: rows.len(),
        retry: match rows.iter().filter(|row| row.retry).count() {
            0 => Retry::No,
            n if n == rows.len() => Retry::Yes,
            _ => Retry::Some,
        },
        ids: rows.iter().take(EXAMPLES).map(|row| row.id.clone()).collect(),
        reason: rows.first().map(|row| row.reason.clone()).unwrap_or_default(),
    };
    let mut causes: Vec<Cause> = groups.into_iter().map(group).collect();
    // Stable: equal counts stay in the order of their texts.
    causes.sort_by_key(|cause| std::cmp::Reverse(cause.count));
    causes
}

/// A reason in which paths are `PATH`, numbers `N`, quoted texts `"…"`, and the id of the capture `ID`. Messages of artgs begin with the
/// path of what is wrong and a colon.
fn cause(reason: &str, id: &str) -> String {
    let text = without_quoted(reason);
    let words: Vec<Word> = text.split_whitespace().enumerate().map(|(i, word)| Word::new(word, i == 0, id)).collect();
    // A path with blanks at the begin ends with the first colon.
    let colon = words.iter().position(|word| word.after.starts_with(':')).unwrap_or(0);
    let is_path = |word: Option<&Word>| word.is_some_and(|word| word.shown == PATH);
    let from = if is_path(words.first()) && is_path(words.get(colon)) { colon } else { 0 };
    let words: Vec<String> =
        words[from..].iter().map(|Word { before, shown, after }| format!("{before}{shown}{after}")).collect();
    let out = words.join(" ");
    match out.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &out[..end]),
        None if out.is_empty() => "no reason given".into(),
        None => out,
    }
}

/// A word without what differs, and the punctuation around it.
struct Word<'a> {
    before: &'a str,
    shown: String,
    after: &'a str,
}

impl<'a> Word<'a> {
    fn new(word: &'a str, first: bool, id: &str) -> Self {
        let inner = word.trim_matches(AROUND);
        let at = word.find(inner).unwrap_or(0);
        let (before, after) = (&word[..at], &word[at + inner.len()..]);
        let begins = first && after.starts_with(':') && !is_error_name(inner);
        let shown = match inner {
            "" => String::new(),
            _ if inner == id => "ID".into(),
            _ if begins || is_path(inner) => PATH.into(),
            _ => without_numbers(inner),
        };
        Self { before, shown, after }
    }
}

fn is_error_name(word: &str) -> bool {
    word.ends_with("Error") || word.ends_with("Exception")
}

fn is_path(word: &str) -> bool {
    const FILES: [&str; 12] =
        ["json", "jsonl", "toml", "png", "jpg", "jpeg", "ply", "csv", "bag", "mcap", "zip", "tar"];
    let ending = word.rsplit_once('.').filter(|(name, _)| !name.is_empty()).map(|(_, ending)| ending.to_lowercase());
    word.contains(['/', '\\']) || ending.is_some_and(|ending| FILES.contains(&ending.as_str()))
}

/// Texts in double quotes, and in single quotes that are no apostrophes, are replaced.
fn without_quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find(['"', '\'']) {
        let quote = if rest[at..].starts_with('"') { '"' } else { '\'' };
        let apostrophe = rest[..at].chars().next_back().is_some_and(char::is_alphanumeric);
        let end = rest[at + 1..].find(quote).filter(|_| !apostrophe);
        let Some(end) = end else {
            out += &rest[..=at];
            rest = &rest[at + 1..];
            continue;
        };
        out += &rest[..at];
        out += "\"…\"";
        rest = &rest[at + 1 + end + 1..];
    }
    out + rest
}

/// Runs of digits, with signs, points and exponents, and hexadecimal names are `N`.
fn without_numbers(word: &str) -> String {
    let hexadecimal = word.len() >= 8 && word.chars().all(|c| c.is_ascii_hexdigit());
    if hexadecimal && word.contains(|c: char| c.is_ascii_digit()) {
        return "N".into();
    }
    let mut out = String::new();
    let characters: Vec<char> = word.chars().collect();
    let digit = |i: usize| characters.get(i).is_some_and(char::is_ascii_digit);
    let mut i = 0;
    while i < characters.len() {
        let c = characters[i];
        let sign = matches!(c, '-' | '+') && i == 0;
        if digit(i) || (sign && digit(i + 1)) {
            i += 1;
            loop {
                let joins = matches!(characters.get(i), Some('.' | ','));
                let exponent = matches!(characters.get(i), Some('e' | 'E'));
                let signed = matches!(characters.get(i + 1), Some('-' | '+')) && digit(i + 2);
                match () {
                    () if digit(i) => i += 1,
                    () if (joins || exponent) && digit(i + 1) => i += 2,
                    () if exponent && signed => i += 3,
                    () => break,
                }
            }
            out.push('N');
        } else {
            out.push(c);
            i += 1;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn failed(id: &str, reason: &str, retry: bool) -> Row {
        Row { id: id.into(), reason: reason.into(), retry, ..Row::default() }
    }

    #[test]
    fn what_differs_between_captures_is_left_out() {
        for (reason, expected) in [
            ("/data/a big cup/x: no such directory; give it", "PATH: no such directory; give it"),
            ("captures/k7: no such directory; give the folder", "PATH: no such directory; give the folder"),
            ("absent: no such directory", "PATH: no such directory"),
            ("x/y.json: line 3: `w` is -1.5e-3, expected 16", "PATH: line N: `w` is N, expected N"),
            ("the run ended with signal: 9 (SIGKILL)", "the run ended with signal: N (SIGKILL)"),
            ("FileNotFoundError: [Errno 2] gone: '/a b/c'", "FileNotFoundError: [Errno N] gone: \"…\""),
            ("no such file: s3://lab/a-17/t.json", "no such file: PATH"),
            ("capture k7 has 12 of 40 images (30.5 %)", "capture ID has N of N images (N %)"),
            ("the worker was lost: node 0f3a99b1c2 at 10.0.0.7:6379", "the worker was lost: node N at N:N"),
            ("the object's depth isn't there", "the object's depth isn't there"),
            ("replica.json\n  is missing", "PATH is missing"),
            ("", "no reason given"),
        ] {
            let found = cause(reason, "k7");
            assert!(found.starts_with(expected), "{found}");
        }
        assert!(cause(&"word ".repeat(200), "").chars().count() <= LONGEST + 1);
    }

    #[test]
    fn equal_causes_are_one_group() {
        let rows = [
            failed("a", "caps/a: no such directory", false),
            failed("b", "the run ended with signal: 9", true),
            Row { id: "ok".into(), done: true, ..Row::default() },
            failed("c", "elsewhere: no such directory", false),
            failed("d", "the run ended with signal: 15", false),
            failed("e", "caps/deep/e: no such directory", false),
        ];
        let found = causes(&rows);
        let brief: Vec<(&str, usize, Retry)> = found.iter().map(|c| (c.cause.as_str(), c.count, c.retry)).collect();
        let expected = [("PATH: no such directory", 3, Retry::No), ("the run ended with signal: N", 2, Retry::Some)];
        assert_eq!(brief, expected);
        assert_eq!((found[0].ids.join(" "), found[0].reason.as_str()), ("a c e".into(), "caps/a: no such directory"));
    }
}
