//! The PLY container: header and rows, ASCII or binary of either endianness, read into columns of numbers.

use std::str::SplitWhitespace;

/// Type of a number in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn parse(name: &str) -> Result<Self, String> {
        Ok(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return Err(format!("unknown property type {name:?}")),
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The number in `bytes`, which are little endian and `size` long.
    fn decode(self, bytes: [u8; 8]) -> f64 {
        let b = bytes;
        match self {
            Self::I8 => f64::from(b[0] as i8),
            Self::U8 => f64::from(b[0]),
            Self::I16 => f64::from(i16::from_le_bytes([b[0], b[1]])),
            Self::U16 => f64::from(u16::from_le_bytes([b[0], b[1]])),
            Self::I32 => f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            Self::U32 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            Self::F32 => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            Self::F64 => f64::from_le_bytes(b),
        }
    }
}

/// A property of an element with the values of all rows.
#[derive(Debug)]
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    /// Type of the length in front of each list; none for a scalar.
    length: Option<Kind>,
    /// Values of all rows, lists one after another.
    pub(crate) values: Vec<f64>,
    /// For lists, where row `i` ends in `values`.
    pub(crate) ends: Vec<usize>,
}

impl Column {
    /// Least number of bytes of a row in a binary file.
    fn least_bytes(&self) -> usize {
        self.length.unwrap_or(self.kind).size()
    }
}

/// An element: rows of equal shape.
#[derive(Debug)]
pub(crate) struct Element {
    pub(crate) name: String,
    pub(crate) count: usize,
    pub(crate) columns: Vec<Column>,
}

impl Element {
    /// A scalar property by name.
    pub(crate) fn scalar(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|c| c.name == name && c.length.is_none())
    }

    /// A list property by any of its names.
    pub(crate) fn list(&self, names: &[&str]) -> Option<&Column> {
        self.columns.iter().find(|c| names.contains(&c.name.as_str()) && c.length.is_some())
    }

    /// Values of a scalar property; an error names what is missing.
    pub(crate) fn require(&self, name: &str) -> Result<&[f64], String> {
        let column = self.scalar(name).ok_or_else(|| format!("element `{}` has no property `{name}`", self.name))?;
        Ok(&column.values)
    }
}

/// Reads every element of a PLY file. Errors say what is wrong, not in which file.
pub(crate) fn read_ply(bytes: &[u8]) -> Result<Vec<Element>, String> {
    let (encoding, mut elements, body) = read_header(bytes)?;
    let binary = matches!(encoding, Encoding::Binary { .. });
    let mut rows = match encoding {
        Encoding::Ascii => {
            let text =
                std::str::from_utf8(body).map_err(|_| "an ASCII PLY contains bytes that are not text".to_string())?;
            Rows::Ascii(text.split_whitespace())
        }
        Encoding::Binary { big } => Rows::Binary { bytes: body, big },
    };
    for element in elements.iter_mut().filter(|e| !e.columns.is_empty()) {
        // The header may state any count; memory is reserved only for as many values as the file can contain.
        // A number takes at least a byte and a separator as text.
        let row: usize = element.columns.iter().map(|c| if binary { c.least_bytes() } else { 2 }).sum();
        let capacity = element.count.min(body.len() / row + 1);
        element.columns.iter_mut().for_each(|c| c.values.reserve(capacity));
        for row in 0..element.count {
            for column in &mut element.columns {
                read_cell(&mut rows, column).map_err(|e| format!("element `{}`, row {row}: {e}", element.name))?;
            }
        }
    }
    Ok(elements)
}

fn read_cell(rows: &mut Rows, column: &mut Column) -> Result<(), String> {
    let Some(length) = column.length else {
        column.values.push(rows.next(column.kind)?);
        return Ok(());
    };
    let n = rows.next(length)?;
    if n < 0.0 || n.fract() != 0.0 {
        return Err(format!("list `{}` has length {n}", column.name));
    }
    for _ in 0..n as usize {
        column.values.push(rows.next(column.kind)?);
    }
    column.ends.push(column.values.len());
    Ok(())
}

enum Rows<'a> {
    Ascii(SplitWhitespace<'a>),
    Binary { bytes: &'a [u8], big: bool },
}

impl Rows<'_> {
    fn next(&mut self, kind: Kind) -> Result<f64, String> {
        let early = || "the file ends early".to_string();
        match self {
            Rows::Ascii(words) => {
                let word = words.next().ok_or_else(early)?;
                word.parse().map_err(|_| format!("{word:?} is not a number"))
            }
            Rows::Binary { bytes, big } => {
                let (head, tail) = bytes.split_at_checked(kind.size()).ok_or_else(early)?;
                *bytes = tail;
                let mut le = [0; 8];
                le[..head.len()].copy_from_slice(head);
                if *big {
                    le[..head.len()].reverse();
                }
                Ok(kind.decode(le))
            }
        }
    }
}

#[derive(Clone, Copy)]
enum Encoding {
    Ascii,
    Binary { big: bool },
}

fn read_header(bytes: &[u8]) -> Result<(Encoding, Vec<Element>, &[u8]), String> {
    let mut rest = bytes;
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    for number in 1.. {
        let end = rest.iter().position(|b| *b == b'\n').ok_or("the header has no `end_header`")?;
        let line = String::from_utf8_lossy(&rest[..end]);
        rest = &rest[end + 1..];
        let words: Vec<&str> = line.split_whitespace().collect();
        if number == 1 {
            if words != ["ply"] {
                return Err("not a PLY file (it does not start with `ply`)".into());
            }
            continue;
        }
        let bad = |why: &str| format!("header line {number}, {:?}: {why}", line.trim_end());
        match words.as_slice() {
            ["end_header"] => break,
            [] | ["comment" | "obj_info", ..] => {}
            ["format", name, _] => {
                encoding = Some(match *name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Binary { big: false },
                    "binary_big_endian" => Encoding::Binary { big: true },
                    _ => return Err(bad("unknown format")),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| bad("the count is not a whole number"))?;
                elements.push(Element { name: (*name).into(), count, columns: Vec::new() });
            }
            ["property", shape @ ..] => {
                let element = elements.last_mut().ok_or_else(|| bad("a property precedes all elements"))?;
                element.columns.push(column(shape).map_err(|e| bad(&e))?);
            }
            _ => return Err(bad("not understood")),
        }
    }
    Ok((encoding.ok_or("the header has no `format`")?, elements, rest))
}

fn column(shape: &[&str]) -> Result<Column, String> {
    let (length, kind, name) = match shape {
        ["list", length, kind, name] => (Some(Kind::parse(length)?), Kind::parse(kind)?, *name),
        [kind, name] => (None, Kind::parse(kind)?, *name),
        _ => return Err("expected `property TYPE NAME` or `property list TYPE TYPE NAME`".into()),
    };
    Ok(Column { name: name.into(), kind, length, values: Vec::new(), ends: Vec::new() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ascii_and_both_binaries_agree() {
        let header = |f: &str| {
            format!(
                "ply\r\nformat {f} 1.0\r\ncomment a b\r\nelement v 1\r\nproperty float x\r\nproperty short n\r\n\
                 element f 1\r\nproperty list uchar int i\r\nend_header\r\n"
            )
        };
        let ascii = header("ascii") + "0.5 -3\n2 7 70000\n";
        let mut little = header("binary_little_endian").into_bytes();
        little.extend([&0.5f32.to_le_bytes()[..], &(-3i16).to_le_bytes(), &[2], &7i32.to_le_bytes()].concat());
        little.extend(70000i32.to_le_bytes());
        let mut big = header("binary_big_endian").into_bytes();
        big.extend([&0.5f32.to_be_bytes()[..], &(-3i16).to_be_bytes(), &[2], &7i32.to_be_bytes()].concat());
        big.extend(70000i32.to_be_bytes());
        for bytes in [ascii.as_bytes(), &little, &big] {
            let elements = read_ply(bytes).unwrap();
            assert_eq!(elements[0].require("x").unwrap(), [0.5]);
            assert_eq!(elements[0].require("n").unwrap(), [-3.0]);
            let list = elements[1].list(&["i"]).unwrap();
            assert_eq!((list.values.as_slice(), list.ends.as_slice()), ([7.0, 70000.0].as_slice(), [2].as_slice()));
        }
    }

    #[test]
    fn broken_files_are_errors_not_panics() {
        for (text, word) in [
            ("plx\n", "not a PLY"),
            ("ply\nformat ascii 1.0\n", "end_header"),
            ("ply\nelement v 1\nend_header\n", "format"),
            ("ply\nformat ascii 1.0\nelement v -1\nend_header\n", "line 3"),
            ("ply\nformat ascii 1.0\nproperty float x\nend_header\n", "precedes all elements"),
            ("ply\nformat ascii 1.0\nelement v 1\nproperty quad x\nend_header\n1\n", "quad"),
            ("ply\nformat ascii 1.0\nelement v 2\nproperty float x\nend_header\n1\n", "row 1: the file ends early"),
            ("ply\nformat ascii 1.0\nelement v 1\nproperty float x\nend_header\none\n", "\"one\""),
            ("ply\nformat ascii 1.0\nelement f 1\nproperty list int int i\nend_header\n-2\n", "length -2"),
            ("ply\nformat binary_little_endian 1.0\nelement v 99999999999\nproperty float x\nend_header\n", "row 0"),
        ] {
            let message = read_ply(text.as_bytes()).unwrap_err();
            assert!(message.contains(word), "{text:?}: {message}");
        }
    }
}
