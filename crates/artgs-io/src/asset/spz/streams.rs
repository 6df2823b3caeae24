//! The attributes of Gaussians as the bytes that every version of SPZ stores; only rotations differ between versions.

use super::SpzVersion;
use artgs_core::Splats;

/// Most fractional bits of positions: a micrometre, and metres up to 8 fit beside them.
const FINEST: u32 = 20;
/// Slope of stored colours of degree 0 around one half.
const COLOR_SLOPE: f32 = 0.15;
/// Largest component of a unit quaternion that is not the largest one.
const HALF_ROOT: f32 = std::f32::consts::FRAC_1_SQRT_2;
/// Number of attributes: positions, opacities, colours, scales, rotations, harmonics, in this order.
pub(super) const ATTRIBUTES: usize = 6;

/// What a header says about the attributes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    /// Number of Gaussians.
    pub count: u32,
    /// Degree of the spherical harmonics, 0 to 3.
    pub degree: u8,
    /// Fractional bits of positions.
    pub bits: u8,
}

impl Shape {
    /// Bytes of each attribute.
    pub(super) fn sizes(self, version: SpzVersion) -> [u64; ATTRIBUTES] {
        let rotation = if version == SpzVersion::V2 { 3 } else { 4 };
        let harmonics = 3 * ((u64::from(self.degree) + 1).pow(2) - 1);
        [9, 1, 3, 3, rotation, harmonics].map(|bytes| bytes * u64::from(self.count))
    }
}

fn byte(value: f32) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

/// Fractional bits with which the largest coordinate still fits in 24 signed bits.
fn fraction_bits(largest: f32) -> Option<u32> {
    (0..=FINEST).rev().find(|bits| largest * (1u32 << bits) as f32 <= 8_388_606.0)
}

/// The attributes of Gaussians, axes as given. An `Err` names what the format cannot express.
pub(super) fn encode(s: &Splats, version: SpzVersion) -> Result<(Shape, [Vec<u8>; ATTRIBUTES]), String> {
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

    let fixed = |v: &f32| ((v * (1u32 << bits) as f32).round() as i32).to_le_bytes();
    let color = |v: &f32| byte(v * COLOR_SLOPE * 255.0 + 127.5);
    let rest = |sh: &[f32]| -> Vec<u8> {
        sh[3..].iter().enumerate().map(|(i, v)| harmonic(*v, if i < 9 { 8 } else { 16 })).collect()
    };
    let attributes = [
        s.means.as_flattened().iter().flat_map(|v| fixed(v).into_iter().take(3)).collect(),
        s.logit_opacities.iter().map(|v| byte(255.0 / (1.0 + (-v).exp()))).collect(),
        s.sh.chunks_exact(stride).flat_map(|sh| &sh[..3]).map(color).collect(),
        s.log_scales.as_flattened().iter().map(|v| byte((v + 10.0) * 16.0)).collect(),
        match version {
            SpzVersion::V2 => s.rotations.iter().flat_map(|q| first_three(*q)).collect(),
            _ => s.rotations.iter().flat_map(|q| smallest_three(*q).to_le_bytes()).collect(),
        },
        s.sh.chunks_exact(stride).flat_map(rest).collect(),
    ];
    Ok((Shape { count, degree: s.sh_degree as u8, bits: bits as u8 }, attributes))
}

/// Inverse of [`encode`]; the attributes have the sizes that `shape` says.
pub(super) fn decode(shape: Shape, version: SpzVersion, attributes: [&[u8]; ATTRIBUTES]) -> Splats {
    let [positions, opacities, colors, scales, rotations, harmonics] = attributes;
    let mut out = Splats::empty(usize::from(shape.degree));
    let unit = 1.0 / (1u32 << shape.bits) as f32;
    let fixed = |b: &[u8]| (i32::from_le_bytes([0, b[0], b[1], b[2]]) >> 8) as f32 * unit;
    out.means = positions.chunks_exact(9).map(|p| [fixed(&p[0..3]), fixed(&p[3..6]), fixed(&p[6..9])]).collect();
    // 0 and 255 stand for opacities that no logit reaches.
    let logit = |b: u8| f32::from(b).clamp(0.25, 254.75) / 255.0;
    out.logit_opacities = opacities.iter().map(|b| logit(*b)).map(|a| (a / (1.0 - a)).ln()).collect();
    out.log_scales = scales.as_chunks::<3>().0.iter().map(|s| s.map(|b| f32::from(b) / 16.0 - 10.0)).collect();
    out.rotations = match version {
        SpzVersion::V2 => rotations.chunks_exact(3).map(from_first_three).collect(),
        _ => rotations.as_chunks::<4>().0.iter().map(|b| from_smallest_three(u32::from_le_bytes(*b))).collect(),
    };
    let rest = out.sh_stride() - 3;
    for i in 0..shape.count as usize {
        out.sh.extend(colors[3 * i..][..3].iter().map(|b| (f32::from(*b) / 255.0 - 0.5) / COLOR_SLOPE));
        out.sh.extend(harmonics[rest * i..][..rest].iter().map(|b| (f32::from(*b) - 128.0) / 128.0));
    }
    out
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

/// Rotation of version 2: x, y, z of the unit quaternion with w not negative, a byte each.
fn first_three([w, x, y, z]: [f32; 4]) -> [u8; 3] {
    let length = (w * w + x * x + y * y + z * z).sqrt();
    if length < 1e-12 {
        return [128; 3];
    }
    let half = if w < 0.0 { -127.5 } else { 127.5 };
    [x, y, z].map(|v| byte(v / length * half + 127.5))
}

/// Inverse of [`first_three`], (w, x, y, z).
fn from_first_three(packed: &[u8]) -> [f32; 4] {
    let v = [0, 1, 2].map(|i| f32::from(packed[i]) / 127.5 - 1.0);
    let w = (1.0 - v.iter().map(|v| v * v).sum::<f32>()).max(0.0).sqrt();
    [w, v[0], v[1], v[2]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_those_of_the_format() {
        let mut s = Splats::empty(1);
        s.means.push([1.0, -0.5, 0.0]);
        s.rotations.push([1.0, 0.0, 0.0, 0.0]);
        s.log_scales.push([-10.0, 0.0, 9.0]);
        s.logit_opacities.push(0.0);
        s.sh = vec![0.0, 1.0, -1.0, 0.5, 0.0, -0.5, 0.0, 0.0, 0.0, 2.0, -2.0, 0.02];
        let (shape, attributes) = encode(&s, SpzVersion::V3).unwrap();
        assert_eq!(shape, Shape { count: 1, degree: 1, bits: 20 });
        let [positions, opacities, colors, scales, rotations, harmonics] = attributes;
        assert_eq!(positions, [0, 0, 0x10, 0, 0, 0xf8, 0, 0, 0]);
        assert_eq!((opacities, colors, scales), (vec![128], vec![128, 166, 89], vec![0, 160, 255]));
        assert_eq!(rotations, (3u32 << 30).to_le_bytes());
        assert_eq!(harmonics, [192, 128, 64, 128, 128, 128, 255, 0, 128]);
        assert_eq!(encode(&s, SpzVersion::V2).unwrap().1[4], [128, 128, 128]);
    }

    #[test]
    fn positions_get_the_bits_they_leave_room_for() {
        assert_eq!(fraction_bits(0.0), Some(20));
        assert_eq!(fraction_bits(7.9), Some(20));
        assert_eq!(fraction_bits(8.1), Some(19));
        assert_eq!(fraction_bits(1e6), Some(3));
        assert_eq!(fraction_bits(1e7), None);
    }
}
