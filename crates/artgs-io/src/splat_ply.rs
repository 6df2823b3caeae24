//! 3D Gaussians as PLY in the layout of 3DGS tools and viewers: raw parameters, `f_rest` channel-major.
//! The additional property `part` is the part of each Gaussian; viewers ignore it.

use crate::error::read_bytes;
use crate::ply::{Element, read_ply};
use crate::{FileError, write_atomic};
use artgs_core::Splats;
use std::fmt::Write;
use std::path::Path;

/// Writes Gaussians in binary little endian. `parts`, if given, holds one part per Gaussian. `frame` says in a comment
/// which frame and state the centres are in, for example `world, canonical state`.
pub fn write_splat_ply(path: &Path, splats: &Splats, parts: Option<&[u16]>, frame: &str) -> Result<(), FileError> {
    let n = splats.len();
    let lengths = [splats.rotations.len(), splats.log_scales.len(), splats.logit_opacities.len()];
    if lengths != [n; 3] || splats.sh.len() != n * splats.sh_stride() || parts.is_some_and(|p| p.len() != n) {
        return Err(FileError::malformed(path, format!("{n} Gaussians with arrays of other lengths")));
    }
    let wide = parts.is_some_and(|p| p.iter().any(|v| *v > 255));
    let rest = splats.sh_stride() / 3 - 1;
    let mut out = header(n, 3 * rest, frame, parts.map(|_| wide)).into_bytes();
    for i in 0..n {
        let sh = &splats.sh[i * splats.sh_stride()..][..splats.sh_stride()];
        let mut put = |v: f32| out.extend(v.to_le_bytes());
        splats.means[i].into_iter().chain([0.0; 3]).chain(sh[..3].iter().copied()).for_each(&mut put);
        (0..3).flat_map(|c| (1..=rest).map(move |k| sh[3 * k + c])).for_each(&mut put);
        put(splats.logit_opacities[i]);
        splats.log_scales[i].into_iter().chain(splats.rotations[i]).for_each(&mut put);
        match parts {
            Some(p) if wide => out.extend(p[i].to_le_bytes()),
            Some(p) => out.push(p[i] as u8),
            None => {}
        }
    }
    write_atomic(path, &out)
}

/// `part` is none without parts, else true for 16 bits.
fn header(n: usize, rest: usize, frame: &str, part: Option<bool>) -> String {
    let frame: String = frame.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\ncomment artgs {}, frame: {frame}\nelement vertex {n}\n",
        env!("CARGO_PKG_VERSION")
    );
    for name in float_names(rest) {
        let _ = writeln!(out, "property float {name}");
    }
    if let Some(wide) = part {
        let _ = writeln!(out, "property {} part", if wide { "ushort" } else { "uchar" });
    }
    out + "end_header\n"
}

fn float_names(rest: usize) -> impl Iterator<Item = String> {
    let fixed = |names: &'static [&'static str]| names.iter().map(|s| String::from(*s));
    fixed(&["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"])
        .chain((0..rest).map(|i| format!("f_rest_{i}")))
        .chain(fixed(&["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]))
}

/// Reads Gaussians and, if the file has the property, the part of each. Normals and unknown properties are skipped.
/// Harmonics must be of degree 0 to 3, numbers finite.
pub fn read_splat_ply(path: &Path) -> Result<(Splats, Option<Vec<u16>>), FileError> {
    let bytes = read_bytes(path)?;
    read_ply(&bytes).and_then(|elements| splats(&elements)).map_err(|reason| FileError::malformed(path, reason))
}

fn splats(elements: &[Element]) -> Result<(Splats, Option<Vec<u16>>), String> {
    let vertex = elements.iter().find(|e| e.name == "vertex").ok_or("no element `vertex`")?;
    let n = vertex.count;
    let rest = vertex.columns.iter().filter(|c| c.name.starts_with("f_rest_")).count();
    let sh_degree = match rest {
        0 => 0,
        9 => 1,
        24 => 2,
        45 => 3,
        _ => return Err(format!("{rest} properties `f_rest_*`; harmonics of degree 0 to 3 have 0, 9, 24 or 45")),
    };
    let mut out = Splats { sh: vec![0.0; n * (3 + rest)], ..Splats::empty(sh_degree) };
    out.means = rows(vertex, ["x", "y", "z"])?;
    out.rotations = rows(vertex, ["rot_0", "rot_1", "rot_2", "rot_3"])?;
    out.log_scales = rows(vertex, ["scale_0", "scale_1", "scale_2"])?;
    out.logit_opacities = rows(vertex, ["opacity"])?.into_iter().map(|[v]| v).collect();
    let (stride, bands) = (3 + rest, rest / 3);
    for c in 0..3 {
        let names = std::iter::once((0, format!("f_dc_{c}")));
        for (k, name) in names.chain((0..bands).map(|k| (k + 1, format!("f_rest_{}", c * bands + k)))) {
            for (i, [v]) in rows(vertex, [&name])?.into_iter().enumerate() {
                out.sh[i * stride + 3 * k + c] = v;
            }
        }
    }
    let parts = vertex.scalar("part").map(|c| c.values.iter().map(|v| *v as u16).collect());
    Ok((out, parts))
}

fn rows<const N: usize>(vertex: &Element, names: [&str; N]) -> Result<Vec<[f32; N]>, String> {
    let mut out = vec![[0.0; N]; vertex.count];
    for (c, name) in names.into_iter().enumerate() {
        for (row, (to, from)) in out.iter_mut().zip(vertex.require(name)?).enumerate() {
            to[c] = *from as f32;
            if !to[c].is_finite() {
                return Err(format!("element `vertex`, row {row}: property `{name}` is {from}"));
            }
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(sh_degree: usize, n: usize) -> Splats {
        let mut s = Splats::empty(sh_degree);
        for i in 0..n {
            let f = i as f32;
            s.means.push([f, 0.5 - f, 2.0]);
            s.rotations.push([1.0, 0.1 * f, -0.2, 0.3]);
            s.log_scales.push([-3.0, -4.0 - f, -5.0]);
            s.logit_opacities.push(0.25 * f - 1.0);
        }
        s.sh = (0..n * s.sh_stride()).map(|i| i as f32 * 0.125).collect();
        s
    }

    #[test]
    fn round_trip_of_every_degree_with_narrow_wide_and_no_parts() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.ply");
        for degree in 0..=3 {
            for parts in [None, Some(vec![0, 7, 255]), Some(vec![3, 256, 65535])] {
                let splats = sample(degree, 3);
                write_splat_ply(&path, &splats, parts.as_deref(), "world\nstart").unwrap();
                assert_eq!(read_splat_ply(&path).unwrap(), (splats, parts));
            }
        }
    }

    #[test]
    fn rest_coefficients_are_channel_major() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.ply");
        let splats = sample(1, 1);
        write_splat_ply(&path, &splats, None, "world").unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let elements = read_ply(&bytes).unwrap();
        // Red of the three first-degree coefficients comes first: sh[1][0], sh[2][0], sh[3][0].
        for (name, index) in [("f_dc_1", 1), ("f_rest_0", 3), ("f_rest_1", 6), ("f_rest_2", 9), ("f_rest_3", 4)] {
            assert_eq!(elements[0].require(name).unwrap()[0] as f32, splats.sh[index], "{name}");
        }
        let names: Vec<&str> = elements[0].columns.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names.len(), 17 + 9);
        assert_eq!((names[3], names[8], names[18], names[25]), ("nx", "f_dc_2", "opacity", "rot_3"));
    }

    #[test]
    fn missing_properties_odd_degrees_and_nan_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.ply");
        write_splat_ply(&path, &sample(1, 1), None, "world").unwrap();
        let good = std::fs::read(&path).unwrap();
        let edited = |from: &str, to: &str| {
            let end = good.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
            let header = String::from_utf8(good[..end].to_vec()).unwrap().replace(from, to);
            std::fs::write(&path, [header.as_bytes(), &good[end..]].concat()).unwrap();
            read_splat_ply(&path).unwrap_err().to_string()
        };
        assert!(edited("float rot_3", "float rut_3").contains("`rot_3`"));
        assert!(edited("f_rest_8", "other").contains("8 properties"));
        let mut splats = sample(0, 2);
        splats.means[1][2] = f32::NAN;
        write_splat_ply(&path, &splats, None, "world").unwrap();
        let message = read_splat_ply(&path).unwrap_err().to_string();
        assert!(message.contains("row 1") && message.contains("`z`"), "{message}");
    }
}
