//! Gaussians as SPZ version 3, the compressed format of web viewers: a tenth of the PLY or less.
//!
//! Limitations: lossy. Positions are fixed point with 24 bits (a micrometre for anything below 8 m), standard deviations
//! lie 6 % apart and between e^-10 and e^5.9, opacities and degree-0 colours have 8 bits, degree 1 has 5 bits and higher
//! degrees 4 within [-1, 1); values outside are clamped. Rotations are good to a quarter of a degree. Version 4 (zstd)
//! is not written or read, nor are extensions.
//!
//! Axes: SPZ names its axes right, up, back (RUB), and its own library flips signs when it converts from the right, down,
//! front of PLY. Here x, y, z are stored unchanged: a link frame is right-handed like RUB, and a viewer that adds the file to
//! the node of the link (three.js with Spark) needs the link frame. A viewer of a single file assumes y up and shows the
//! object lying on its back.

use crate::error::read_bytes;
use crate::{FileError, write_atomic};
use artgs_core::Splats;
use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;
use std::io::{Read, Write};
use std::path::Path;

/// `NGSP` in little endian.
const MAGIC: u32 = 0x5053_474e;
/// Bytes before the Gaussians.
const HEADER: usize = 16;
/// Most fractional bits of positions: a micrometre, and metres up to 8 fit beside them.
const FINEST: u32 = 20;
/// Slope of stored colours of degree 0 around one half.
const COLOR_SLOPE: f32 = 0.15;
/// Largest component of a unit quaternion that is not the largest one.
const HALF_ROOT: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// Writes Gaussians as gzipped SPZ, version 3, axes as given. Refuses numbers that are not finite and positions of
/// 8388 km and more.
pub fn write_spz(path: &Path, splats: &Splats) -> Result<(), FileError> {
    let body = pack(splats).map_err(|reason| FileError::malformed(path, reason))?;
    let fail = |source| FileError::Write { path: path.into(), source };
    write_atomic(path, &gzip(&body, Compression::default()).map_err(fail)?)
}

/// The bytes that [`write_spz`] writes, with faster and weaker compression, for Gaussians that are shown once. An `Err` names
/// what the format cannot express.
pub fn spz_bytes(splats: &Splats) -> Result<Vec<u8>, String> {
    gzip(&pack(splats)?, Compression::fast()).map_err(|e| e.to_string())
}

fn gzip(body: &[u8], level: Compression) -> std::io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::with_capacity(body.len() / 2), level);
    encoder.write_all(body)?;
    encoder.finish()
}

/// Reads gzipped SPZ of version 2 or 3, axes as stored.
pub fn read_spz(path: &Path) -> Result<Splats, FileError> {
    let bytes = read_bytes(path)?;
    unpack(&bytes).map_err(|reason| FileError::malformed(path, reason))
}

fn byte(value: f32) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

/// Fractional bits with which the largest coordinate still fits in 24 signed bits.
fn fraction_bits(largest: f32) -> Option<u32> {
    (0..=FINEST).rev().find(|bits| largest * (1u32 << bits) as f32 <= 8_388_606.0)
}

fn pack(s: &Splats) -> Result<Vec<u8>, String> {
    let (n, stride) = (s.len(), s.sh_stride());
    let lengths = [s.rotations.len(), s.log_scales.len(), s.logit_opacities.len()];
    if lengths != [n; 3] || s.sh.len() != n * stride || s.sh_degree > 3 {
        return Err(format!("{n} Gaussians with arrays of other lengths, or a degree above 3"));
    }
    let floats = [s.means.as_flattened(), s.rotations.as_flattened(), s.log_scales.as_flattened()];
    if floats.iter().chain(&[s.logit_opacities.as_slice(), &s.sh]).any(|a| a.iter().any(|v| !v.is_finite())) {
        return Err("a Gaussian has a number that is not finite; remove it before writing".into());
    }
    let count = u32::try_from(n).map_err(|_| format!("{n} Gaussians, more than the format can count"))?;
    let largest = s.means.as_flattened().iter().fold(0f32, |m, v| m.max(v.abs()));
    let bits = fraction_bits(largest).ok_or_else(|| format!("a position of {largest} does not fit in the format"))?;

    let mut out = Vec::with_capacity(HEADER + n * (20 + stride - 3));
    [MAGIC, 3, count].iter().for_each(|v| out.extend(v.to_le_bytes()));
    out.extend([s.sh_degree as u8, bits as u8, 0, 0]);
    for v in s.means.as_flattened() {
        out.extend(&((v * (1u32 << bits) as f32).round() as i32).to_le_bytes()[..3]);
    }
    out.extend(s.logit_opacities.iter().map(|v| byte(255.0 / (1.0 + (-v).exp()))));
    for sh in s.sh.chunks_exact(stride) {
        out.extend(sh[..3].iter().map(|v| byte(v * COLOR_SLOPE * 255.0 + 127.5)));
    }
    out.extend(s.log_scales.as_flattened().iter().map(|v| byte((v + 10.0) * 16.0)));
    s.rotations.iter().for_each(|q| out.extend(smallest_three(*q).to_le_bytes()));
    for sh in s.sh.chunks_exact(stride) {
        out.extend(sh[3..].iter().enumerate().map(|(i, v)| harmonic(*v, if i < 9 { 8 } else { 16 })));
    }
    Ok(out)
}

/// A coefficient in [-1, 1) as the nearest multiple of `bucket`; 0 stays 0.
fn harmonic(value: f32, bucket: i32) -> u8 {
    let fine = (value.clamp(-2.0, 2.0) * 128.0).round() as i32 + 128;
    ((fine + bucket / 2).div_euclid(bucket) * bucket).clamp(0, 255) as u8
}

/// Index of the largest component of (x, y, z, w) in the top two bits, then sign and nine bits of the others.
fn smallest_three([w, x, y, z]: [f32; 4]) -> u32 {
    let q = [x, y, z, w];
    let length = q.iter().map(|v| v * v).sum::<f32>().sqrt();
    if length < 1e-12 {
        return 3 << 30;
    }
    let q = q.map(|v| v / length);
    let largest = (0..4).fold(0, |best, i| if q[i].abs() > q[best].abs() { i } else { best });
    let others = (0..4).filter(|i| *i != largest);
    others.fold(largest as u32, |packed, i| {
        let negative = u32::from((q[i] < 0.0) != (q[largest] < 0.0));
        let size = (511.0 * q[i].abs() / HALF_ROOT).round().min(511.0) as u32;
        packed << 10 | negative << 9 | size
    })
}

/// Inverse of [`smallest_three`], (w, x, y, z).
fn from_smallest_three(packed: u32) -> [f32; 4] {
    let largest = (packed >> 30) as usize;
    let (mut q, mut rest, mut sum) = ([0f32; 4], packed, 0f32);
    for i in (0..4).rev().filter(|i| *i != largest) {
        let size = (rest & 511) as f32 / 511.0 * HALF_ROOT;
        q[i] = if rest >> 9 & 1 == 1 { -size } else { size };
        sum += size * size;
        rest >>= 10;
    }
    q[largest] = (1.0 - sum).max(0.0).sqrt();
    [q[3], q[0], q[1], q[2]]
}

/// Rotation of version 2: x, y, z in a byte each, w not negative.
fn from_first_three(packed: &[u8]) -> [f32; 4] {
    let v = [0, 1, 2].map(|i| f32::from(packed[i]) / 127.5 - 1.0);
    let w = (1.0 - v.iter().map(|v| v * v).sum::<f32>()).max(0.0).sqrt();
    [w, v[0], v[1], v[2]]
}

fn unpack(file: &[u8]) -> Result<Splats, String> {
    let broken = |e: std::io::Error| format!("not a whole gzip stream ({e}); SPZ of version 2 or 3 is expected");
    let mut stream = MultiGzDecoder::new(file);
    let mut header = [0u8; HEADER];
    stream.read_exact(&mut header).map_err(broken)?;
    let word = |i: usize| u32::from_le_bytes([header[i], header[i + 1], header[i + 2], header[i + 3]]);
    let (version, n, degree, bits) = (word(4), word(8) as usize, usize::from(header[12]), u32::from(header[13]));
    if word(0) != MAGIC || !(2..=3).contains(&version) || degree > 3 || bits > 23 {
        let claim = format!("version {version}, degree {degree}, {bits} fractional bits");
        return Err(format!("not SPZ of version 2 or 3 with degree 0 to 3 ({claim}); write it again as version 3"));
    }
    let mut out = Splats::empty(degree);
    let (rotation, rest) = (if version == 3 { 4 } else { 3 }, out.sh_stride() - 3);
    let expected = n as u64 * (9 + 1 + 3 + 3 + rotation as u64 + rest as u64);
    let mut body = Vec::new();
    // A damaged header must not make this read more than it says, nor claim memory before there is content for it.
    stream.take(expected + 1).read_to_end(&mut body).map_err(broken)?;
    if body.len() as u64 != expected {
        return Err(format!(
            "{n} Gaussians take {expected} bytes, the file has {} or more; write it again",
            body.len()
        ));
    }
    let (positions, body) = body.split_at(9 * n);
    let (opacities, body) = body.split_at(n);
    let (colors, body) = body.split_at(3 * n);
    let (scales, body) = body.split_at(3 * n);
    let (rotations, harmonics) = body.split_at(rotation * n);

    let unit = 1.0 / (1u32 << bits) as f32;
    let fixed = |b: &[u8]| (i32::from_le_bytes([0, b[0], b[1], b[2]]) >> 8) as f32 * unit;
    out.means = positions.chunks_exact(9).map(|p| [fixed(&p[0..3]), fixed(&p[3..6]), fixed(&p[6..9])]).collect();
    // 0 and 255 stand for opacities that no logit reaches.
    let logit = |b: u8| f32::from(b).clamp(0.25, 254.75) / 255.0;
    out.logit_opacities = opacities.iter().map(|b| logit(*b)).map(|a| (a / (1.0 - a)).ln()).collect();
    out.log_scales = scales.as_chunks::<3>().0.iter().map(|s| s.map(|b| f32::from(b) / 16.0 - 10.0)).collect();
    out.rotations = match version {
        3 => rotations.as_chunks::<4>().0.iter().map(|b| from_smallest_three(u32::from_le_bytes(*b))).collect(),
        _ => rotations.chunks_exact(3).map(from_first_three).collect(),
    };
    for i in 0..n {
        out.sh.extend(colors[3 * i..][..3].iter().map(|b| (f32::from(*b) / 255.0 - 0.5) / COLOR_SLOPE));
        out.sh.extend(harmonics[rest * i..][..rest].iter().map(|b| (f32::from(*b) - 128.0) / 128.0));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values all over the ranges, no two alike.
    pub(crate) fn sample(degree: usize, n: usize) -> Splats {
        let mut s = Splats::empty(degree);
        let wave = |i: usize, k: f32| (i as f32 * k).sin();
        for i in 0..n {
            s.means.push([wave(i, 0.7), 2.0 * wave(i, 1.1), 0.3 * wave(i, 2.3)]);
            s.rotations.push([2.0 * wave(i, 0.9), wave(i, 1.7), -wave(i, 0.3), wave(i, 3.1) + 0.1]);
            s.log_scales.push([-5.0 + wave(i, 1.3), -6.0 + wave(i, 0.4), -3.5]);
            s.logit_opacities.push(4.0 * wave(i, 0.6));
        }
        s.sh = (0..n * s.sh_stride()).map(|i| 0.9 * wave(i, 0.37)).collect();
        s
    }

    #[test]
    fn round_trip_within_the_steps_of_the_format() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.spz");
        for degree in 0..=3 {
            let splats = sample(degree, 50);
            write_spz(&path, &splats).unwrap();
            let back = read_spz(&path).unwrap();
            assert_eq!((back.len(), back.sh_degree, back.sh.len()), (50, degree, splats.sh.len()));
            let far = |a: &[f32], b: &[f32]| a.iter().zip(b).fold(0f32, |m, (a, b)| m.max((a - b).abs()));
            assert!(far(back.means.as_flattened(), splats.means.as_flattened()) <= 0.51e-6);
            assert!(far(back.log_scales.as_flattened(), splats.log_scales.as_flattened()) <= 0.5 / 16.0 + 1e-5);
            let sigmoid = |v: &[f32]| v.iter().map(|v| 1.0 / (1.0 + (-v).exp())).collect::<Vec<_>>();
            assert!(far(&sigmoid(&back.logit_opacities), &sigmoid(&splats.logit_opacities)) <= 0.5 / 255.0 + 1e-5);
            for (a, b) in back.rotations.iter().zip(&splats.rotations) {
                let length = b.iter().map(|v| v * v).sum::<f32>().sqrt();
                let dot: f32 = a.iter().zip(b).map(|(a, b)| a * b / length).sum();
                assert!(2.0 * dot.abs().min(1.0).acos() < 0.004, "{a:?} {b:?}");
            }
            for (a, b) in back.sh.chunks(back.sh_stride()).zip(splats.sh.chunks(back.sh_stride())) {
                assert!(far(&a[..3], &b[..3]) <= 0.5 / (255.0 * 0.15) + 1e-5);
                assert!(far(&a[3..], &b[3..]) <= 8.5 / 128.0, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn bytes_are_those_of_the_format() {
        let mut s = Splats::empty(1);
        s.means.push([1.0, -0.5, 0.0]);
        s.rotations.push([1.0, 0.0, 0.0, 0.0]);
        s.log_scales.push([-10.0, 0.0, 9.0]);
        s.logit_opacities.push(0.0);
        s.sh = vec![0.0, 1.0, -1.0, 0.5, 0.0, -0.5, 0.0, 0.0, 0.0, 2.0, -2.0, 0.02];
        let bytes = pack(&s).unwrap();
        assert_eq!(bytes[..HEADER], [b'N', b'G', b'S', b'P', 3, 0, 0, 0, 1, 0, 0, 0, 1, 20, 0, 0]);
        assert_eq!(bytes[16..25], [0, 0, 0x10, 0, 0, 0xf8, 0, 0, 0]);
        assert_eq!(bytes[25..32], [128, 128, 166, 89, 0, 160, 255]);
        assert_eq!(bytes[32..36], (3u32 << 30).to_le_bytes());
        assert_eq!(bytes[36..], [192, 128, 64, 128, 128, 128, 255, 0, 128]);
    }

    #[test]
    fn positions_get_the_bits_they_leave_room_for() {
        assert_eq!(fraction_bits(0.0), Some(20));
        assert_eq!(fraction_bits(7.9), Some(20));
        assert_eq!(fraction_bits(8.1), Some(19));
        assert_eq!(fraction_bits(1e6), Some(3));
        assert_eq!(fraction_bits(1e7), None);
    }

    #[test]
    fn version_2_is_read_and_damage_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.spz");
        let gzip = |bytes: &[u8]| {
            let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
            encoder.write_all(bytes).unwrap();
            std::fs::write(&path, encoder.finish().unwrap()).unwrap();
            read_spz(&path).map_err(|e| e.to_string())
        };
        let mut v2 = vec![b'N', b'G', b'S', b'P', 2, 0, 0, 0, 1, 0, 0, 0, 0, 12, 0, 0];
        v2.extend([0, 0x10, 0, 0, 0xf0, 0xff, 0, 0, 0, 128, 255, 128, 0, 160, 160, 160, 255, 128, 128]);
        let splats = gzip(&v2).unwrap();
        assert_eq!((splats.means[0], splats.log_scales[0]), ([1.0, -1.0, 0.0], [0.0; 3]));
        assert!((splats.rotations[0][1] - 1.0).abs() < 1e-6 && (splats.sh[0] - 0.5 / 0.15).abs() < 1e-5);

        assert!(gzip(&v2[..v2.len() - 1]).unwrap_err().contains("take 19 bytes"));
        assert!(gzip(&[v2.as_slice(), &[0]].concat()).is_err());
        v2[4] = 4;
        assert!(gzip(&v2).unwrap_err().contains("version 4"));
        std::fs::write(&path, b"not gzip").unwrap();
        assert!(read_spz(&path).unwrap_err().to_string().contains("s.spz"));
        let mut splats = sample(0, 2);
        splats.means[1][0] = f32::NAN;
        assert!(write_spz(&path, &splats).unwrap_err().to_string().contains("not finite"));
    }
}
