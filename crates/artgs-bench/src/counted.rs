//! Numbers of things in texts.

/// `1 object`, `2 objects`: a number and what it counts, a noun in the singular whose plural ends with `s`.
pub fn counted(count: usize, what: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {what}{plural}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_thing_is_singular() {
        let texts = [0, 1, 2].map(|count| counted(count, "wrong decidable object"));
        assert_eq!(texts, ["0 wrong decidable objects", "1 wrong decidable object", "2 wrong decidable objects"]);
    }
}
