//! Repairs errors of `openusd` 0.6 in crate files, so that Pixar's reader accepts them.
//!
//! Lists of children have the type array of tokens instead of vector of tokens; both have the same bytes, so only the types
//! of fields change. Arrays of 4 to 15 integers are compressed, but the format compresses only arrays of 16 or more; they are
//! written again, uncompressed, at the end. So is the section of fields, and the table of contents is updated.

/// Fields whose value is a vector of tokens.
const LISTS: [&str; 2] = ["primChildren", "properties"];

/// High bits of a value's representation.
const TOKEN_ARRAY: u64 = 1 << 15 | 11;
const TOKEN_VECTOR: u64 = 41;
const INT_ARRAY: u64 = 1 << 15 | 3;
const COMPRESSED: u64 = 1 << 13;

/// Low bits of a value's representation: the place of its bytes.
const PLACE: u64 = (1 << 48) - 1;

/// Shortest array of integers that the format compresses.
const SHORTEST: usize = 16;

/// The repaired file; none if it is not a crate file.
pub(super) fn repaired(mut file: Vec<u8>) -> Option<Vec<u8>> {
    let contents = word(&file, 16)?;
    let (tokens_entry, fields_entry) = (entry(&file, contents, "TOKENS")?, entry(&file, contents, "FIELDS")?);
    let tokens = token_texts(file.get(word(&file, tokens_entry + 16)?..)?)?;
    let fields = file.get(word(&file, fields_entry + 16)?..)?;
    let count = word(fields, 0)?;
    let (names, rest) = compressed(fields.get(8..)?)?;
    let names = names.to_vec();
    let indices = integers(&names, count)?;
    let mut values = unpack(compressed(rest)?.0, count.checked_mul(8)?)?;
    for (index, value) in indices.iter().zip(values.as_chunks_mut::<8>().0) {
        let bits = u64::from_le_bytes(*value);
        let is_list = LISTS.contains(&tokens.get(usize::try_from(*index).ok()?)?.as_str());
        let better = match bits >> 48 {
            TOKEN_ARRAY if is_list => TOKEN_VECTOR << 48 | bits & PLACE,
            kind if kind == INT_ARRAY | COMPRESSED => uncompressed(&mut file, bits)?,
            _ => bits,
        };
        *value = better.to_le_bytes();
    }
    let mut section = (count as u64).to_le_bytes().to_vec();
    for block in [names, pack(&values)] {
        section.extend((block.len() as u64).to_le_bytes());
        section.extend(block);
    }
    let place = [file.len() as u64, section.len() as u64].map(u64::to_le_bytes);
    file.get_mut(fields_entry + 16..fields_entry + 32)?.copy_from_slice(place.as_flattened());
    file.extend(section);
    Some(file)
}

/// The representation of a compressed array of integers; an array that is too short is appended uncompressed.
fn uncompressed(file: &mut Vec<u8>, bits: u64) -> Option<u64> {
    let at = usize::try_from(bits & PLACE).ok()?;
    let count = word(file, at)?;
    if count >= SHORTEST {
        return Some(bits);
    }
    let values = integers(compressed(file.get(at + 8..)?)?.0, count)?;
    file.resize(file.len().next_multiple_of(8), 0);
    let place = file.len() as u64;
    file.extend((count as u64).to_le_bytes());
    file.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    Some(INT_ARRAY << 48 | place)
}

fn word(bytes: &[u8], at: usize) -> Option<usize> {
    let eight = bytes.get(at..at.checked_add(8)?)?.try_into().ok()?;
    usize::try_from(u64::from_le_bytes(eight)).ok()
}

/// Offset of the entry of a section in the table of contents: a name of 16 bytes, an offset and a size.
fn entry(file: &[u8], contents: usize, name: &str) -> Option<usize> {
    let mut entries = (0..word(file, contents)?.min(64)).map(|i| contents + 8 + 32 * i);
    entries.find(|at| file.get(*at..at + 16).is_some_and(|n| n.split(|b| *b == 0).next() == Some(name.as_bytes())))
}

/// A block after its length, and the rest.
fn compressed(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    bytes.get(8..)?.split_at_checked(word(bytes, 0)?)
}

/// The content, of at most `size` bytes, of an LZ4 block after the byte that marks a single chunk.
fn unpack(block: &[u8], size: usize) -> Option<Vec<u8>> {
    let (0, content) = block.split_first().map(|(chunks, rest)| (*chunks, rest))? else { return None };
    lz4_flex::block::decompress(content, size).ok()
}

fn pack(content: &[u8]) -> Vec<u8> {
    [vec![0], lz4_flex::block::compress(content)].concat()
}

fn token_texts(section: &[u8]) -> Option<Vec<String>> {
    let text = unpack(compressed(section.get(16..)?)?.0, word(section, 8)?)?;
    Some(text.split(|b| *b == 0).map(|t| String::from_utf8_lossy(t).into_owned()).collect())
}

/// Integers of a block: the most common difference, then two bits per integer with the size of its difference to the previous
/// one, then those differences.
fn integers(block: &[u8], count: usize) -> Option<Vec<i32>> {
    decode(&unpack(block, 4 + count.div_ceil(4) + count.checked_mul(4)?)?, count)
}

fn decode(bytes: &[u8], count: usize) -> Option<Vec<i32>> {
    let (common, rest) = bytes.split_first_chunk::<4>()?;
    let (codes, mut rest) = rest.split_at_checked(count.div_ceil(4))?;
    let (mut value, mut out) = (0i32, Vec::new());
    for i in 0..count {
        let size = [0, 1, 2, 4][usize::from(codes[i / 4] >> (2 * (i % 4)) & 3)];
        let (digits, further) = rest.split_at_checked(size)?;
        rest = further;
        value = value.wrapping_add(match *digits {
            [a] => i32::from(a as i8),
            [a, b] => i32::from(i16::from_le_bytes([a, b])),
            [a, b, c, d] => i32::from_le_bytes([a, b, c, d]),
            _ => i32::from_le_bytes(*common),
        });
        out.push(value);
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_of_every_size() {
        // 1, 2, 3 by the common difference; then +100, -1000, +100000.
        let codes = [0b0100_0000, 0b0000_1110];
        let mut bytes = [1i32.to_le_bytes().as_slice(), &codes, &[100]].concat();
        bytes.extend((-50i16).to_le_bytes());
        bytes.extend(100_000i32.to_le_bytes());
        assert_eq!(decode(&bytes, 6), Some(vec![1, 2, 3, 103, 53, 100_053]));
        assert_eq!(decode(&bytes[..8], 6), None);
    }

    #[test]
    fn what_is_no_crate_file_is_refused() {
        assert_eq!(repaired(vec![0; 8]), None);
        assert_eq!(repaired(vec![255; 500]), None);
        assert_eq!(unpack(&pack(b"some text"), 9).as_deref(), Some(b"some text".as_slice()));
    }
}
