//! Round trips, damage, and a reader of its own that follows the text of the specification, one byte at a time.

use super::*;
use std::f32::consts::FRAC_1_SQRT_2;

/// Values all over the ranges, no two alike.
fn sample(degree: usize, n: usize) -> Splats {
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

/// Largest difference of two lists.
fn far(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).fold(0f32, |m, (a, b)| m.max((a - b).abs()))
}

/// The angle between two rotations, radians; neither needs to be a unit quaternion.
fn angle(a: &[f32; 4], b: &[f32; 4]) -> f32 {
    let length = |q: &[f32; 4]| q.iter().map(|v| v * v).sum::<f32>().sqrt();
    let dot: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    2.0 * (dot / (length(a) * length(b))).abs().min(1.0).acos()
}

#[test]
fn round_trip_within_the_steps_of_the_format() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.spz");
    for (degree, version) in (0..=3).flat_map(|degree| SpzVersion::ALL.map(|version| (degree, version))) {
        let splats = sample(degree, 50);
        write_spz(&path, &splats, version).unwrap();
        let back = read_spz(&path).unwrap();
        assert_eq!((back.len(), back.sh_degree, back.sh.len()), (50, degree, splats.sh.len()));
        assert!(far(back.means.as_flattened(), splats.means.as_flattened()) <= 0.51e-6);
        assert!(far(back.log_scales.as_flattened(), splats.log_scales.as_flattened()) <= 0.5 / 16.0 + 1e-5);
        let sigmoid = |v: &[f32]| v.iter().map(|v| 1.0 / (1.0 + (-v).exp())).collect::<Vec<_>>();
        assert!(far(&sigmoid(&back.logit_opacities), &sigmoid(&splats.logit_opacities)) <= 0.5 / 255.0 + 1e-5);
        let turn = if version == SpzVersion::V2 { 0.2 } else { 0.004 };
        for (a, b) in back.rotations.iter().zip(&splats.rotations) {
            assert!(angle(a, b) < turn, "version {version}: {a:?} {b:?}");
        }
        for (a, b) in back.sh.chunks(back.sh_stride()).zip(splats.sh.chunks(back.sh_stride())) {
            assert!(far(&a[..3], &b[..3]) <= 0.5 / (255.0 * 0.15) + 1e-5);
            assert!(far(&a[3..], &b[3..]) <= 8.5 / 128.0, "{a:?} {b:?}");
        }
    }
}

/// One Gaussian as a reader that knows only the specification sees it: axes right, up, back; unit quaternion x, y, z, w.
struct Plain {
    position: [f32; 3],
    rotation: [f32; 4],
    sh: Vec<f32>,
}

/// Gaussian `i` of a file of any version.
fn slow_reader(file: &[u8], i: usize) -> Plain {
    let word = |bytes: &[u8], at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let long = |bytes: &[u8], at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    let gzipped = file[..2] == [0x1f, 0x8b];
    let mut legacy = Vec::new();
    if gzipped {
        MultiGzDecoder::new(file).read_to_end(&mut legacy).unwrap();
    }
    let head = if gzipped { &legacy[..] } else { file };
    assert_eq!(head[..4], *b"NGSP");
    let (version, n, degree, bits) = (word(head, 4), word(head, 8) as usize, head[12], head[13]);
    let harmonics = [0, 9, 24, 45][usize::from(degree)];
    let widths = [9, 1, 3, 3, if version == 2 { 3 } else { 4 }, harmonics];
    let mut attributes: Vec<Vec<u8>> = Vec::new();
    if gzipped {
        let mut at = 16;
        for width in widths {
            attributes.push(legacy[at..at + width * n].to_vec());
            at += width * n;
        }
        assert_eq!(at, legacy.len());
    } else {
        assert_eq!((version, head[15]), (4, 6));
        assert!(file[20..32].iter().all(|b| *b == 0), "reserved");
        let table = word(head, 16) as usize;
        let mut at = table + 6 * 16;
        for (k, width) in widths.iter().enumerate() {
            let (packed, plain) = (long(file, table + 16 * k), long(file, table + 16 * k + 8));
            assert_eq!(plain, width * n);
            let mut out = Vec::new();
            StreamingDecoder::new(&file[at..at + packed]).unwrap().read_to_end(&mut out).unwrap();
            assert_eq!(out.len(), plain);
            attributes.push(out);
            at += packed;
        }
        assert_eq!(at, file.len());
    }
    let coordinate = |k: usize| {
        let b = &attributes[0][9 * i + 3 * k..][..3];
        let unsigned = i32::from(b[0]) | i32::from(b[1]) << 8 | i32::from(b[2]) << 16;
        let signed = if unsigned >= 1 << 23 { unsigned - (1 << 24) } else { unsigned };
        signed as f32 / f32::powi(2.0, i32::from(bits))
    };
    let mut rotation = [0f32; 4];
    if version == 2 {
        for k in 0..3 {
            rotation[k] = f32::from(attributes[4][3 * i + k]) / 127.5 - 1.0;
        }
        rotation[3] = (1.0 - rotation.iter().map(|v| v * v).sum::<f32>()).max(0.0).sqrt();
    } else {
        let packed = word(&attributes[4], 4 * i);
        let largest = (packed >> 30) as usize;
        // Ten bits for each of the others, the last one lowest: nine of size and a sign.
        for (place, k) in (0..4).rev().filter(|k| *k != largest).enumerate() {
            let ten = packed >> (10 * place) & 1023;
            let size = (ten & 511) as f32 / 511.0 * FRAC_1_SQRT_2;
            rotation[k] = if ten & 512 > 0 { -size } else { size };
        }
        rotation[largest] = (1.0 - rotation.iter().map(|v| v * v).sum::<f32>()).max(0.0).sqrt();
    }
    let coefficients = &attributes[5][harmonics * i..][..harmonics];
    Plain {
        position: [coordinate(0), coordinate(1), coordinate(2)],
        rotation,
        sh: coefficients.iter().map(|b| (f32::from(*b) - 128.0) / 128.0).collect(),
    }
}

/// Real spherical harmonics of degrees 1 to 3 without their constants, in the order of 3DGS.
fn harmonics_at([x, y, z]: [f32; 3]) -> [f32; 15] {
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        -y,
        z,
        -x,
        x * y,
        -y * z,
        2.0 * zz - xx - yy,
        -x * z,
        xx - yy,
        -y * (3.0 * xx - yy),
        x * y * z,
        -y * (4.0 * zz - xx - yy),
        z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -x * (4.0 * zz - xx - yy),
        z * (xx - yy),
        -x * (xx - 3.0 * yy),
    ]
}

#[test]
fn a_reader_of_the_specification_sees_the_ply_turned_to_its_axes() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.spz");
    let splats = sample(3, 40);
    // Right, down, front to right, up, back.
    let turned = |[x, y, z]: [f32; 3]| [x, -y, -z];
    for version in SpzVersion::ALL {
        write_spz(&path, &splats, version).unwrap();
        let file = std::fs::read(&path).unwrap();
        for i in 0..splats.len() {
            let seen = slow_reader(&file, i);
            assert!(far(&seen.position, &turned(splats.means[i])) <= 0.51e-6, "version {version}");
            // A turned rotation takes a turned vector to the turned image.
            let rotate = |[w, x, y, z]: [f32; 4], v: [f32; 3]| {
                (glam::Quat::from_xyzw(x, y, z, w).normalize() * glam::Vec3::from(v)).to_array()
            };
            let [x, y, z, w] = seen.rotation;
            for v in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3, -0.2, 0.9]] {
                let (theirs, ours) = (rotate([w, x, y, z], turned(v)), turned(rotate(splats.rotations[i], v)));
                let most = if version == SpzVersion::V2 { 0.2 } else { 0.005 };
                assert!(far(&theirs, &ours) < most, "version {version}: {theirs:?} {ours:?}");
            }
            // Odd in y and z together: the coefficient changes its sign.
            let kept = [0., 0., 1., 0., 1., 1., 0., 1., 0., 1., 0., 0., 1., 0., 1.].map(|kept| 2.0 * kept - 1.0);
            let wanted: Vec<f32> =
                splats.sh[48 * i + 3..][..45].iter().enumerate().map(|(k, v)| v * kept[k / 3]).collect();
            assert!(far(&seen.sh, &wanted) <= 8.5 / 128.0);
        }
    }
}

#[test]
fn half_a_turn_keeps_the_colour_of_every_direction() {
    let splats = sample(3, 12);
    let turned = axes::between_ply_and_spz(&splats);
    assert_eq!(axes::between_ply_and_spz(&turned), splats);
    for (i, v) in [[0.48, 0.6, -0.64], [0.6, -0.8, 0.0], [-0.28, 0.0, 0.96], [0.36, 0.48, 0.8]].into_iter().enumerate()
    {
        let sum = |s: &Splats, v: [f32; 3]| -> f32 {
            harmonics_at(v).iter().enumerate().map(|(k, basis)| basis * s.sh[48 * i + 3 + 3 * k]).sum()
        };
        let (ours, theirs) = (sum(&splats, v), sum(&turned, [v[0], -v[1], -v[2]]));
        assert!((ours - theirs).abs() < 1e-5, "{ours} {theirs}");
    }
}

#[test]
fn pages_get_the_axes_as_given() {
    let splats = sample(1, 5);
    let back = read_spz_bytes(&spz_bytes(&splats).unwrap()).unwrap();
    assert!(far(back.means.as_flattened(), splats.means.as_flattened()) <= 0.51e-6);
}

#[test]
fn version_2_of_others_is_read_and_damage_refused() {
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
    assert_eq!((splats.means[0], splats.log_scales[0]), ([1.0, 1.0, 0.0], [0.0; 3]));
    assert!((splats.rotations[0][1] - 1.0).abs() < 1e-6 && (splats.sh[0] - 0.5 / 0.15).abs() < 1e-5);

    assert!(gzip(&v2[..v2.len() - 1]).unwrap_err().contains("take 19 bytes"));
    assert!(gzip(&[v2.as_slice(), &[0]].concat()).is_err());
    v2[4] = 5;
    assert!(gzip(&v2).unwrap_err().contains("version 5"));
    std::fs::write(&path, b"not gzip").unwrap();
    assert!(read_spz(&path).unwrap_err().to_string().contains("s.spz"));
    let mut splats = sample(0, 2);
    splats.means[1][0] = f32::NAN;
    assert!(write_spz(&path, &splats, SpzVersion::V3).unwrap_err().to_string().contains("not finite"));
}

#[test]
fn damaged_version_4_is_refused_and_extensions_are_skipped() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.spz");
    write_spz(&path, &sample(2, 30), SpzVersion::V4).unwrap();
    let whole = std::fs::read(&path).unwrap();
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        read_spz(&path).map_err(|e| e.to_string())
    };
    for length in [4, 18, 31, 60, 140, whole.len() - 1] {
        let error = read(&whole[..length]).unwrap_err();
        assert!(error.contains("s.spz") && error.contains("write"), "{length}: {error}");
    }
    let mut other = whole.clone();
    other[8] = 31;
    assert!(read(&other).unwrap_err().contains("instead of"));
    other[4] = 9;
    assert!(read(&other).unwrap_err().contains("version 9"));
    // A record of 12 bytes between header and table.
    let mut extended = whole.clone();
    extended.splice(32..32, [0, 1, 2, 3, 4, 0, 0, 0, 9, 9, 9, 9]);
    extended[14] = 2;
    extended[16] += 12;
    assert_eq!(read(&extended).unwrap().len(), 30);
}
