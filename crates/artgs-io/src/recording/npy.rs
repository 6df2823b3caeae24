//! NumPy arrays as depth images.

use super::RecordingError;
use super::depth::Measured;
use super::depth_file::Scale;
use artgs_core::DepthMap;
use std::path::Path;

/// A two-dimensional array of unsigned 16-bit counts or floats.
pub(super) fn decode_npy(path: &Path, bytes: &[u8], scale: Scale) -> Result<Measured, RecordingError> {
    let decoded = decode(bytes, scale).map_err(|reason| RecordingError::malformed(path, reason))?;
    let (width, height, map, per_unit) = decoded;
    Ok(Measured::new(path, width, height, map, per_unit))
}

/// Width, height, depths, and stored numbers per scene unit.
fn decode(bytes: &[u8], scale: Scale) -> Result<(u32, u32, DepthMap, f32), String> {
    let broken = || "not a complete NumPy array; write it again".to_string();
    let head = bytes.strip_prefix(b"\x93NUMPY").ok_or_else(broken)?;
    let (length, rest) = match head {
        [1, _, a, b, rest @ ..] => (usize::from(u16::from_le_bytes([*a, *b])), rest),
        [2 | 3, _, a, b, c, d, rest @ ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, rest),
        _ => return Err(broken()),
    };
    let (header, data) = rest.split_at_checked(length).ok_or_else(broken)?;
    let header = String::from_utf8_lossy(header);
    let shape =
        header.split_once("'shape':").and_then(|(_, s)| s.split_once('(')?.1.split_once(')')).map_or("", |s| s.0);
    let shape: Vec<u32> = shape.split(',').filter_map(|w| w.trim().parse().ok()).collect();
    // A third dimension of 1 is a channel.
    let (&[height, width] | &[height, width, 1]) = shape.as_slice() else {
        return Err(format!("has the shape {shape:?}, expected rows and columns"));
    };
    if header.contains("'fortran_order': True") {
        return Err("is stored column by column; write it row by row".into());
    }
    let pixels = u64::from(width) * u64::from(height);
    let complete = |size: u64| if data.len() as u64 == pixels * size { Ok(()) } else { Err(broken()) };
    let scaled = |depths: Vec<f32>| DepthMap::nearest(&depths);
    let per_unit = if header.contains("'<u2'") { scale.integer } else { scale.float };
    let map = if header.contains("'<u2'") {
        complete(2)?;
        DepthMap::new(data.as_chunks::<2>().0.iter().map(|b| u16::from_le_bytes(*b)).collect(), per_unit)
    } else if header.contains("'<f4'") {
        complete(4)?;
        scaled(data.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b) / per_unit).collect())
    } else if header.contains("'<f8'") {
        complete(8)?;
        scaled(data.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b) as f32 / per_unit).collect())
    } else {
        return Err("has an unknown type; write 16-bit unsigned counts or 32-bit floats".into());
    };
    Ok((width, height, map, per_unit))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn counts_and_floats() {
        let (w, h, map, _) = decode(&array("<u2", "(1, 2)", &[232, 3, 0, 0]), Scale::MILLIMETRES).unwrap();
        assert_eq!((w, h, map.at(0), map.at(1)), (2, 1, 1.0, 0.0));
        let (_, _, map, _) = decode(&array("<f4", "(1, 1, 1)", &2.5_f32.to_le_bytes()), Scale::same(1.0)).unwrap();
        assert!((map.at(0) - 2.5).abs() < 1e-4);
    }

    #[test]
    fn damaged_arrays_are_refused() {
        for bytes in [array("<f4", "(2, 2)", &[0; 12]), b"\x93NUMPY\x01\x00\xff\xff".to_vec(), b"PNG".to_vec()] {
            assert!(decode(&bytes, Scale::same(1.0)).unwrap_err().contains("not a complete NumPy array"));
        }
        assert!(decode(&array("|S1", "(1, 1)", &[0]), Scale::same(1.0)).unwrap_err().contains("unknown type"));
        assert!(decode(&array("<u2", "(4,)", &[0; 8]), Scale::same(1.0)).unwrap_err().contains("shape"));
    }
}
