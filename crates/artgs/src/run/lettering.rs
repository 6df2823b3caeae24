//! Capital letters and digits of five by seven pixels, for labels in pictures.

/// Rows of a letter or digit from the top, the leftmost pixel in bit 4; none for other characters.
fn glyph(letter: char) -> Option<[u8; 7]> {
    Some(match letter {
        '0' => [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110],
        '1' => [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        '2' => [0b01110, 0b10001, 0b00001, 0b00110, 0b01000, 0b10000, 0b11111],
        '3' => [0b11110, 0b00001, 0b00001, 0b01110, 0b00001, 0b00001, 0b11110],
        '4' => [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010],
        '5' => [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110],
        '6' => [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110],
        '7' => [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000],
        '8' => [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110],
        '9' => [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100],
        'A' => [0b01110, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001],
        'D' => [0b11110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b11110],
        'E' => [0b11111, 0b10000, 0b10000, 0b11110, 0b10000, 0b10000, 0b11111],
        'H' => [0b10001, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001],
        'N' => [0b10001, 0b11001, 0b11001, 0b10101, 0b10011, 0b10011, 0b10001],
        'O' => [0b01110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110],
        'P' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10000, 0b10000, 0b10000],
        'R' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10100, 0b10010, 0b10001],
        'S' => [0b01111, 0b10000, 0b10000, 0b01110, 0b00001, 0b00001, 0b11110],
        'T' => [0b11111, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100],
        _ => return None,
    })
}

/// Pixels `(x, y)` of a text whose top left corner is (0, 0); other letters stay blank.
pub(super) fn lettered(text: &str) -> Vec<(usize, usize)> {
    let mut out = Vec::new();
    for (place, letter) in text.chars().enumerate() {
        let Some(rows) = glyph(letter) else { continue };
        for (y, row) in rows.into_iter().enumerate() {
            out.extend((0..5).filter(|x| row >> (4 - x) & 1 == 1).map(|x| (6 * place + x, y)));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_stand_side_by_side() {
        let drawn: Vec<String> = (0..7)
            .map(|y| (0..11).map(|x| if lettered("TH").contains(&(x, y)) { '#' } else { '.' }).collect())
            .collect();
        assert_eq!(drawn[0], "#####.#...#");
        assert_eq!(drawn[3], "..#...#####");
        assert!(artgs_core::State::ALL.iter().all(|s| s.name().to_uppercase().chars().all(|c| glyph(c).is_some())));
        assert_eq!(lettered(" ?"), []);
        let digits: Vec<_> = ('0'..='9').map(|c| lettered(&c.to_string())).collect();
        assert!((0..10).all(|i| !digits[i].is_empty() && !digits[..i].contains(&digits[i])));
    }
}
