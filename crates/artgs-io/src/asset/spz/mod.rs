//! Gaussians as SPZ, the compressed format of web viewers: a tenth of the PLY or less.
//!
//! Versions: 2 and 3 are one gzip stream, 3 has finer rotations; 4 has a zstd stream per attribute. All three are read and
//! written. Extensions of version 4 are skipped, antialiasing is not recorded.
//!
//! Axes: SPZ fixes right, up, back; 3DGS PLY is right, down, front. Programs that read both turn one by half a turn about x,
//! so does this module: in memory Gaussians have the axes of their PLY, and `LINK.spz` shows what `LINK.ply` shows.
//!
//! Limitations: lossy. Positions are fixed point with 24 bits (a micrometre for anything below 8 m), standard deviations
//! lie 6 % apart and between e^-10 and e^5.9, opacities and degree-0 colours have 8 bits, degree 1 has 5 bits and higher
//! degrees 4 within [-1, 1); values outside are clamped. Rotations are good to a quarter of a degree, in version 2 to one degree.

mod axes;
mod streams;
#[cfg(test)]
mod tests;

use crate::error::read_bytes;
use crate::{FileError, write_atomic};
use artgs_core::Splats;
use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;
use ruzstd::decoding::StreamingDecoder;
use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use std::fmt;
use std::io::{Read, Write};
use std::path::Path;
use std::str::FromStr;
use streams::{ATTRIBUTES, Shape, decode, encode};

/// `NGSP` in little endian.
const MAGIC: u32 = 0x5053_474e;
/// Bytes before the Gaussians of versions 2 and 3.
const HEADER: usize = 16;
/// Bytes before the table of streams of version 4.
const PLAIN_HEADER: usize = 32;

/// Bytes that a byte of a file may stand for, as in gzip: a damaged header must not make this claim more memory.
const MOST_RATIO: u64 = 1032;

/// A version of SPZ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpzVersion {
    /// gzip, rotations with 24 bits: readers from 2024 on.
    V2,
    /// gzip, rotations with 32 bits: readers from September 2025 on.
    #[default]
    V3,
    /// zstd, a stream per attribute: readers from 2026 on.
    V4,
}

impl SpzVersion {
    /// Every version.
    pub const ALL: [Self; 3] = [Self::V2, Self::V3, Self::V4];

    /// Its number, as on the command line and in files.
    pub const fn number(self) -> u32 {
        match self {
            Self::V2 => 2,
            Self::V3 => 3,
            Self::V4 => 4,
        }
    }

    /// The version of this number; none if it is not read or written.
    pub fn of(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|version| version.number() == number)
    }
}

impl fmt::Display for SpzVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.number())
    }
}

impl FromStr for SpzVersion {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = text.parse().ok().and_then(Self::of);
        found.ok_or_else(|| format!("no version of SPZ is `{text}`; 2, 3 and 4 are written"))
    }
}

/// Writes Gaussians whose axes are those of their PLY as SPZ, in the axes of that format. Refuses numbers that are not finite
/// and positions of 8388 km and more.
pub fn write_spz(path: &Path, splats: &Splats, version: SpzVersion) -> Result<(), FileError> {
    let fail = |source| FileError::Write { path: path.into(), source };
    let turned = axes::between_ply_and_spz(splats);
    let (shape, attributes) = encode(&turned, version).map_err(|reason| FileError::malformed(path, reason))?;
    let bytes = match version {
        SpzVersion::V4 => zstd(shape, &attributes),
        _ => gzip(&one_stream(shape, version, &attributes), Compression::default()).map_err(fail)?,
    };
    write_atomic(path, &bytes)
}

/// SPZ of version 3 with the axes as given and faster, weaker compression: for a page that adds the Gaussians to a node whose
/// frame they already have. An `Err` names what the format cannot express.
pub fn spz_bytes(splats: &Splats) -> Result<Vec<u8>, String> {
    let (shape, attributes) = encode(splats, SpzVersion::V3)?;
    gzip(&one_stream(shape, SpzVersion::V3, &attributes), Compression::fast()).map_err(|e| e.to_string())
}

/// Inverse of [`spz_bytes`].
pub fn read_spz_bytes(bytes: &[u8]) -> Result<Splats, String> {
    unpack(bytes)
}

/// Reads SPZ of version 2, 3 or 4 into the axes of a PLY.
pub fn read_spz(path: &Path) -> Result<Splats, FileError> {
    let bytes = read_bytes(path)?;
    let stored = unpack(&bytes).map_err(|reason| FileError::malformed(path, reason))?;
    Ok(axes::between_ply_and_spz(&stored))
}

fn gzip(body: &[u8], level: Compression) -> std::io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::with_capacity(body.len() / 2), level);
    encoder.write_all(body)?;
    encoder.finish()
}

/// Header and attributes of versions 2 and 3.
fn one_stream(shape: Shape, version: SpzVersion, attributes: &[Vec<u8>; ATTRIBUTES]) -> Vec<u8> {
    let mut out = Vec::with_capacity(HEADER + attributes.iter().map(Vec::len).sum::<usize>());
    [MAGIC, version.number(), shape.count].iter().for_each(|v| out.extend(v.to_le_bytes()));
    out.extend([shape.degree, shape.bits, 0, 0]);
    attributes.iter().for_each(|bytes| out.extend(bytes));
    out
}

/// A file of version 4: header, table of sizes, a zstd frame per attribute.
fn zstd(shape: Shape, attributes: &[Vec<u8>; ATTRIBUTES]) -> Vec<u8> {
    let packed = attributes.each_ref().map(|bytes| compress_to_vec(bytes.as_slice(), CompressionLevel::Fastest));
    let mut out = Vec::new();
    [MAGIC, 4, shape.count].iter().for_each(|v| out.extend(v.to_le_bytes()));
    out.extend([shape.degree, shape.bits, 0, ATTRIBUTES as u8]);
    out.extend((PLAIN_HEADER as u32).to_le_bytes());
    out.resize(PLAIN_HEADER, 0);
    for (packed, plain) in packed.iter().zip(attributes) {
        [packed.len() as u64, plain.len() as u64].iter().for_each(|v| out.extend(v.to_le_bytes()));
    }
    packed.iter().for_each(|bytes| out.extend(bytes));
    out
}

/// Any version, axes as stored.
fn unpack(file: &[u8]) -> Result<Splats, String> {
    if file.starts_with(&MAGIC.to_le_bytes()) { unpack_zstd(file) } else { unpack_gzip(file) }
}

/// What the first 16 bytes say, which all versions share.
fn header(bytes: &[u8; HEADER], accepted: [SpzVersion; 2]) -> Result<(SpzVersion, Shape), String> {
    let word = |i: usize| u32::from_le_bytes([bytes[i], bytes[i + 1], bytes[i + 2], bytes[i + 3]]);
    let (version, shape) = (word(4), Shape { count: word(8), degree: bytes[12], bits: bytes[13] });
    match SpzVersion::of(version).filter(|v| accepted.contains(v)) {
        Some(known) if word(0) == MAGIC && shape.degree <= 3 && shape.bits <= 23 => Ok((known, shape)),
        _ => {
            let claim = format!("version {version}, degree {}, {} fractional bits", shape.degree, shape.bits);
            Err(format!("not SPZ of version 2, 3 or 4 with degree 0 to 3 ({claim}); write it again as version 3"))
        }
    }
}

fn unpack_gzip(file: &[u8]) -> Result<Splats, String> {
    let broken = |e: std::io::Error| format!("not a whole gzip stream ({e}); SPZ of version 2, 3 or 4 is expected");
    let mut stream = MultiGzDecoder::new(file);
    let mut first = [0u8; HEADER];
    stream.read_exact(&mut first).map_err(broken)?;
    let (version, shape) = header(&first, [SpzVersion::V2, SpzVersion::V3])?;
    let sizes = shape.sizes(version);
    let expected = sizes.iter().sum::<u64>();
    let mut body = Vec::new();
    // A damaged header must not make this read more than it says, nor claim memory before there is content for it.
    stream.take(expected + 1).read_to_end(&mut body).map_err(broken)?;
    if body.len() as u64 != expected {
        let (n, has) = (shape.count, body.len());
        return Err(format!("{n} Gaussians take {expected} bytes, the file has {has} or more; write it again"));
    }
    let mut rest = body.as_slice();
    let attributes = sizes.map(|size| {
        let (first, others) = rest.split_at(size as usize);
        rest = others;
        first
    });
    Ok(decode(shape, version, attributes))
}

fn unpack_zstd(file: &[u8]) -> Result<Splats, String> {
    let short = || "the file ends in its header; write it again".to_string();
    let (first, _) = file.split_first_chunk::<HEADER>().ok_or_else(short)?;
    let (version, shape) = header(first, [SpzVersion::V4; 2])?;
    let table = file.get(HEADER..HEADER + 4).and_then(|b| b.try_into().ok()).ok_or_else(short)?;
    let table = u32::from_le_bytes(table) as usize;
    if usize::from(first[15]) != ATTRIBUTES || table < PLAIN_HEADER {
        let (n, expected) = (first[15], ATTRIBUTES);
        return Err(format!(
            "{n} streams, their table at byte {table}; {expected} streams are expected; write it again"
        ));
    }
    let sizes: Vec<u64> = file
        .get(table..table.saturating_add(16 * ATTRIBUTES))
        .ok_or_else(short)?
        .as_chunks::<8>()
        .0
        .iter()
        .map(|b| u64::from_le_bytes(*b))
        .collect();
    let expected = shape.sizes(version);
    let whole = expected.iter().sum::<u64>();
    if whole > MOST_RATIO * file.len() as u64 {
        return Err(format!(
            "{} Gaussians take {whole} bytes, more than the file can hold; write it again",
            shape.count
        ));
    }
    let mut rest = &file[table + 16 * ATTRIBUTES..];
    let mut plain: [Vec<u8>; ATTRIBUTES] = Default::default();
    for (i, expected) in expected.into_iter().enumerate() {
        let (packed, others) = usize::try_from(sizes[2 * i])
            .ok()
            .and_then(|size| rest.split_at_checked(size))
            .ok_or("a stream of the file is cut off; write it again")?;
        rest = others;
        plain[i] = unpack_stream(packed, expected).map_err(|e| format!("stream {i}: {e}; write the file again"))?;
    }
    Ok(decode(shape, version, plain.each_ref().map(Vec::as_slice)))
}

/// The content of a zstd frame, which must have this size.
fn unpack_stream(packed: &[u8], expected: u64) -> Result<Vec<u8>, String> {
    let decoder = StreamingDecoder::new(packed).map_err(|e| e.to_string())?;
    let mut out = Vec::new();
    decoder.take(expected + 1).read_to_end(&mut out).map_err(|e| e.to_string())?;
    if out.len() as u64 != expected {
        return Err(format!("{} bytes or more instead of {expected}", out.len()));
    }
    Ok(out)
}
