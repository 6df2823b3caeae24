//! Mutations of valid files.

/// A generator of random numbers (SplitMix64): the same case gives the same numbers everywhere.
pub(crate) struct Random(u64);

impl Random {
    /// The numbers of one case.
    pub(crate) fn new(target: &str, case: u64) -> Self {
        let hash =
            target.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
        Self(hash ^ case.wrapping_mul(0x2545_f491_4f6c_dd1d))
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `end`, which is above 0.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    pub(crate) fn of<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len())]
    }
}

/// Numbers as text that readers handle badly.
const NUMBERS: [&str; 24] = [
    "0",
    "-0",
    "-1",
    "1",
    "0.5",
    "1e999",
    "-1e999",
    "1e300",
    "1e-300",
    "1e38",
    "1e40",
    "NaN",
    "nan",
    "inf",
    "null",
    "\"1\"",
    "[]",
    "{}",
    "true",
    "255",
    "65536",
    "2147483648",
    "4294967296",
    "18446744073709551616",
];

/// Words of all text formats.
const WORDS: [&str; 40] = [
    "frames",
    "transform_matrix",
    "file_path",
    "depth_path",
    "fl_x",
    "camera_angle_x",
    "w",
    "h",
    "cx",
    "depth_scale",
    "K",
    "poses",
    "format",
    "version",
    "parts",
    "joint",
    "axis",
    "origin",
    "limits",
    "parent",
    "meshes",
    "trans_info",
    "centres",
    "joints",
    "action",
    "plane",
    "points",
    "element vertex",
    "element face",
    "property list uchar int",
    "property float",
    "binary_big_endian",
    "ascii",
    "end_header",
    "../",
    "\u{1b}[2J",
    "\0",
    "\u{feff}",
    "single",
    "steps",
];

/// Bytes of numbers of 1, 2, 4 and 8 bytes that readers handle badly.
const BYTES: [&[u8]; 16] = [
    &[0],
    &[0xff],
    &[0x7f],
    &[0x80],
    &[0, 0],
    &[0xff, 0xff],
    &[0, 0x80],
    &[0, 0, 0, 0],
    &[0xff; 4],
    &[0xff, 0xff, 0xff, 0x7f],
    &[0, 0, 0, 0x80],
    // A billion, NaN and infinity.
    &[0, 0xca, 0x9a, 0x3b],
    &[0, 0, 0xc0, 0x7f],
    &[0, 0, 0x80, 0x7f],
    &[0xff; 8],
    &[0, 0, 0, 0, 0, 0, 0xf8, 0x7f],
];

/// A file after one to four changes. `other` is another file of the seed, for splices.
pub(crate) fn mutated(seed: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..1 + random.below(4) {
        change(&mut bytes, other, random);
    }
    bytes
}

fn change(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    if bytes.is_empty() {
        bytes.extend(other.iter().take(64));
        return;
    }
    let at = random.below(bytes.len());
    let length = 1 + random.below(64.min(bytes.len() - at));
    match random.below(14) {
        0 | 1 => bytes[at] ^= 1 << random.below(8),
        2 => bytes[at] = random.next() as u8,
        3 | 4 => {
            let value = random.of(&BYTES);
            let end = (at + value.len()).min(bytes.len());
            bytes[at..end].copy_from_slice(&value[..end - at]);
        }
        5 => bytes.truncate(at),
        6 => drop(bytes.drain(at..at + length)),
        7 => {
            let copy = bytes[at..at + length].to_vec();
            let to = random.below(bytes.len());
            bytes.splice(to..to, copy);
        }
        8 => bytes[at..at + length].fill(*random.of(&[0, 0xff, b' ', b'0'])),
        9 if !other.is_empty() => {
            let from = random.below(other.len());
            bytes.truncate(at);
            bytes.extend(&other[from..]);
        }
        10..=12 => number(bytes, at, random),
        _ => {
            let word = random.of(&WORDS);
            let end = if random.below(2) == 0 { at } else { (at + word.len()).min(bytes.len()) };
            bytes.splice(at..end, word.bytes());
        }
    }
}

/// Replaces the number, written as text, at or after a place; nothing if there is none.
fn number(bytes: &mut Vec<u8>, at: usize, random: &mut Random) {
    let is_part = |b: &u8| b.is_ascii_digit() || b"+-.eE".contains(b);
    let Some(begin) = bytes[at..].iter().position(u8::is_ascii_digit).map(|i| at + i) else { return };
    let begin = bytes[..begin].iter().rposition(|b| !is_part(b)).map_or(0, |i| i + 1);
    let end = bytes[begin..].iter().position(|b| !is_part(b)).map_or(bytes.len(), |i| begin + i);
    bytes.splice(begin..end, random.of(&NUMBERS).bytes());
}
