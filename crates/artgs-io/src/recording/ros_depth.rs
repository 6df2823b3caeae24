//! Depth in ROS messages: raw images, and those of `compressed_depth_image_transport` (PNG or RVL).

use super::RecordingError;
use super::binary::{Bytes, Ends};
use super::depth::Measured;
use super::depth_file::{self, measured};
use super::ros::{ImageHead, rows, short};
use crate::image_io::{DepthImage, depth_of_png};
use artgs_core::DepthMap;
use std::path::Path;

/// A raw image: floats in metres, or counts with `per_unit` of them per metre. `place` names it in messages.
pub(super) fn raw(place: &Path, head: &ImageHead, pixels: &[u8], per_unit: f32) -> Result<Measured, RecordingError> {
    let (width, height) = (head.width, head.height);
    if head.encoding == "32FC1" {
        let rows = rows(pixels, head, 4).ok_or_else(|| short(place))?;
        let value = |b: &[u8; 4]| if head.big_endian { f32::from_be_bytes(*b) } else { f32::from_le_bytes(*b) };
        let depths: Vec<f32> = rows.flat_map(|r| r.as_chunks::<4>().0.iter().map(value)).collect();
        return Ok(Measured::new(place, width, height, DepthMap::nearest(&depths), 1.0));
    }
    let rows = rows(pixels, head, 2).ok_or_else(|| short(place))?;
    let value = |b: &[u8; 2]| if head.big_endian { u16::from_be_bytes(*b) } else { u16::from_le_bytes(*b) };
    let counts = rows.flat_map(|r| r.as_chunks::<2>().0.iter().map(value)).collect();
    Ok(Measured::new(place, width, height, DepthMap::new(counts, per_unit), per_unit))
}

/// Bytes before the image: what it is, and two parameters of the quantisation.
const HEAD: usize = 12;

/// The data of a compressed depth image; `format` is such as `16UC1; compressedDepth png`.
pub(super) fn compressed(place: &Path, format: &str, data: &[u8], per_unit: f32) -> Result<Measured, RecordingError> {
    let (head, image) = data.split_at_checked(HEAD).ok_or_else(|| short(place))?;
    let counts = if image.starts_with(b"\x89PNG") {
        depth_of_png(place, image)?
    } else if image.starts_with(&[0xff, 0xd8, 0xff]) {
        return Err(RecordingError::malformed(place, depth_file::JPEG));
    } else if format.to_ascii_lowercase().contains("rvl") {
        let damaged = |_| RecordingError::malformed(place, "damaged RVL data; copy or record it again");
        decode_rvl(image).map_err(damaged)?
    } else {
        let reason = format!(
            "the compression of depth `{}` is not read; record it as PNG or RVL, or without compression",
            format.trim()
        );
        return Err(RecordingError::malformed(place, reason));
    };
    if !format.trim_start().starts_with("32FC1") {
        return Ok(measured(place, counts, per_unit, false));
    }
    // Floats are stored as the inverse of the depth: a / (count - b).
    let parameter = |at: usize| f32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    let (a, b) = (parameter(4), parameter(8));
    let depth = |count: &u16| {
        let depth = a / (f32::from(*count) - b);
        if *count > 0 && depth.is_finite() && depth > 0.0 { depth } else { 0.0 }
    };
    let depths: Vec<f32> = counts.counts.iter().map(depth).collect();
    Ok(Measured::new(place, counts.width, counts.height, DepthMap::nearest(&depths), 1.0))
}

/// Most pixels of an image: its header must not choose how much memory is reserved.
const MOST: usize = 1 << 27;

/// RVL (Wilson 2017) after columns and rows: runs of zeros and differences of the others, in groups of 3 bits.
fn decode_rvl(data: &[u8]) -> Result<DepthImage, Ends> {
    let mut bytes = Bytes::new(data);
    let (width, height) = (bytes.u32()?, bytes.u32()?);
    let pixels = (width as usize).checked_mul(height as usize).filter(|n| *n > 0 && *n <= MOST).ok_or(Ends)?;
    let mut nibbles = Nibbles { bytes, word: 0, left: 0 };
    let mut counts: Vec<u16> = Vec::new();
    let mut last = 0_i64;
    while counts.len() < pixels {
        let zeros = nibbles.number()?;
        let values = nibbles.number()?;
        let total = zeros.checked_add(values).filter(|n| *n > 0 && *n <= pixels - counts.len()).ok_or(Ends)?;
        counts.resize(counts.len() + zeros, 0);
        for _ in zeros..total {
            let folded = nibbles.number()? as i64;
            last += (folded >> 1) ^ -(folded & 1);
            counts.push(u16::try_from(last).map_err(|_| Ends)?);
        }
    }
    Ok(DepthImage { width, height, counts })
}

/// Groups of 4 bits, the highest of a little-endian word of 32 bits first.
struct Nibbles<'a> {
    bytes: Bytes<'a>,
    word: u32,
    left: u32,
}

impl Nibbles<'_> {
    /// A number in groups of 3 bits, the lowest first; a fourth bit says that another follows.
    fn number(&mut self) -> Result<usize, Ends> {
        let (mut number, mut shift) = (0_usize, 0);
        loop {
            if self.left == 0 {
                (self.word, self.left) = (self.bytes.u32()?, 8);
            }
            let nibble = self.word >> 28;
            (self.word, self.left) = (self.word << 4, self.left - 1);
            number |= ((nibble & 7) as usize) << shift;
            shift += 3;
            if nibble & 8 == 0 {
                return Ok(number);
            }
            if shift > 30 {
                return Err(Ends);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image_io::write_depth;

    /// The encoder of the paper.
    fn encode_rvl(width: u32, height: u32, counts: &[u16]) -> Vec<u8> {
        let mut nibbles = Vec::new();
        let mut put = |mut number: usize| loop {
            let rest = number >> 3;
            nibbles.push((number & 7) as u32 | if rest > 0 { 8 } else { 0 });
            number = rest;
            if rest == 0 {
                break;
            }
        };
        let (mut at, mut last) = (0, 0_i64);
        while at < counts.len() {
            let zeros = counts[at..].iter().take_while(|c| **c == 0).count();
            let values = counts[at + zeros..].iter().take_while(|c| **c > 0).count();
            put(zeros);
            put(values);
            for count in &counts[at + zeros..at + zeros + values] {
                let delta = i64::from(*count) - last;
                put(((delta << 1) ^ (delta >> 63)) as usize);
                last = i64::from(*count);
            }
            at += zeros + values;
        }
        let mut data = [width.to_le_bytes(), height.to_le_bytes()].concat();
        for word in nibbles.chunks(8) {
            let word = word.iter().enumerate().fold(0_u32, |w, (i, n)| w | n << (28 - 4 * i));
            data.extend(word.to_le_bytes());
        }
        data
    }

    const COUNTS: [u16; 12] = [0, 0, 700, 701, 699, 0, 1200, 65535, 1, 0, 0, 4000];

    fn png() -> Vec<u8> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.png");
        write_depth(&path, 4, 3, &DepthMap::new(COUNTS.to_vec(), 1000.0)).unwrap();
        std::fs::read(path).unwrap()
    }

    #[test]
    fn rvl_and_png_give_the_same_depth() {
        for (format, image) in
            [("16UC1; compressedDepth rvl", encode_rvl(4, 3, &COUNTS)), ("16UC1; compressedDepth", png())]
        {
            let data = [vec![0; HEAD], image].concat();
            let depth = compressed(Path::new("d"), format, &data, 1000.0).unwrap();
            assert_eq!((depth.width, depth.height, depth.map.counts()), (4, 3, &COUNTS[..]), "{format}");
        }
    }

    #[test]
    fn inverse_depth_of_floats_is_undone() {
        let (a, b) = (2000.0_f32, -100.0_f32);
        let data = [&0_u32.to_le_bytes()[..], &a.to_le_bytes(), &b.to_le_bytes(), &png()].concat();
        let depth = compressed(Path::new("d"), "32FC1; compressedDepth png", &data, 1000.0).unwrap();
        assert!((depth.map.at(2) - 2000.0 / 800.0).abs() < 1e-3 && depth.map.at(0) == 0.0);
    }

    #[test]
    fn damaged_and_lossy_data_are_refused() {
        let rvl = encode_rvl(4, 3, &COUNTS);
        for (format, image, part) in [
            ("16UC1; compressedDepth rvl", rvl[..rvl.len() - 4].to_vec(), "RVL"),
            ("16UC1; compressedDepth rvl", [[255; 8].to_vec(), rvl].concat(), "RVL"),
            ("16UC1; compressedDepth rvl", vec![1; 300], "RVL"),
            ("16UC1; compressedDepth", vec![0xff, 0xd8, 0xff, 0xe0], "JPEG"),
            ("16UC1; compressedDepth zstd", vec![1; 30], "zstd"),
        ] {
            let data = [vec![0; HEAD], image].concat();
            let message = compressed(Path::new("/depth"), format, &data, 1000.0).err().unwrap().to_string();
            assert!(message.contains("/depth") && message.contains(part), "{message}");
        }
    }
}
