//! Text of files that people or other programs write.

/// Text in UTF-8 without its byte order mark. The error says what to do about UTF-16.
pub fn without_mark(bytes: &[u8]) -> Result<&[u8], &'static str> {
    match bytes {
        [0xef, 0xbb, 0xbf, rest @ ..] => Ok(rest),
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => Err("is text in UTF-16; save it as UTF-8"),
        _ => Ok(bytes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_removed_and_other_encodings_named() {
        assert_eq!(without_mark(b"\xef\xbb\xbf{}"), Ok(&b"{}"[..]));
        assert_eq!(without_mark(b"{}"), Ok(&b"{}"[..]));
        assert_eq!(without_mark(b""), Ok(&b""[..]));
        assert!(without_mark(b"\xff\xfe{\0").is_err() && without_mark(b"\xfe\xff\0{").is_err());
    }
}
