//! Text that does not command a terminal.

use std::borrow::Cow;

/// A text without codes that a terminal would obey, as names of files may hold them: control characters, except line breaks
/// and tabs, and marks that change the direction of writing are written as `\u001b`. JSON reads that as the same character.
pub(crate) fn printable(text: &str) -> Cow<'_, str> {
    let is_code = |c: char| {
        (c.is_control() && c != '\n' && c != '\t') || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if !text.contains(is_code) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_code(c) { out.push_str(&format!("\\u{:04x}", u32::from(c))) } else { out.push(c) }
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    #[test]
    fn terminal_codes_are_written_as_text() {
        assert_eq!(printable("a b\tc\nd"), "a b\tc\nd");
        assert_eq!(printable("x\u{1b}[2J\u{7f}\u{9b}y\u{202e}z\r"), "x\\u001b[2J\\u007f\\u009by\\u202ez\\u000d");
        let json = json!({ "name": "a\u{9b}b" }).to_string();
        let read: Value = serde_json::from_str(&printable(&json)).unwrap();
        assert_eq!(read["name"], "a\u{9b}b");
    }
}
