//! Depth images as files: found by their names, read by their content.

use super::RecordingError;
use super::depth::Measured;
use super::files::names;
use super::{exr_depth, npy};
use crate::error::read_bytes;
use crate::image_io::{DepthImage, depth_of_png};
use artgs_core::DepthMap;
use std::path::{Path, PathBuf};

/// Suffixes of depth images: those that can be read first, then those of which reading says why they cannot.
const SUFFIXES: [&str; 13] =
    ["png", "pgm", "npy", "exr", "PNG", "tiff", "tif", "pfm", "npz", "bin", "raw", "jpg", "jpeg"];

/// Stored numbers per scene unit, of a file that does not state them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    /// Of whole numbers.
    pub(super) integer: f32,
    /// Of floats.
    pub(super) float: f32,
}

impl Scale {
    pub(super) const MILLIMETRES: Self = Self::same(1000.0);

    pub(super) const fn same(per_unit: f32) -> Self {
        Self { integer: per_unit, float: per_unit }
    }
}

/// The depth image with one of these names without their suffix.
pub(super) fn find(dir: &Path, stems: &[&str]) -> Option<PathBuf> {
    let named = |stem: &&str| SUFFIXES.iter().map(|s| dir.join(format!("{stem}.{s}"))).find(|p| p.is_file());
    stems.iter().find_map(named)
}

/// Reads a 16-bit PNG or PGM, a NumPy array, or an EXR, which has scene units. 65535 counts are a hole if `full_is_hole`.
pub(super) fn read(path: &Path, scale: Scale, full_is_hole: bool) -> Result<Measured, RecordingError> {
    let bytes = read_bytes(path)?;
    let image = match bytes.as_slice() {
        [0x93, b'N', b'U', b'M', ..] => return npy::decode_npy(path, &bytes, scale),
        [0x76, 0x2f, 0x31, 0x01, ..] => return exr_depth::decode(path, &bytes),
        [b'P', b'5', ..] => depth_of_pgm(&bytes).map_err(|reason| RecordingError::malformed(path, reason))?,
        _ => match foreign(path, &bytes) {
            Some(reason) => return Err(RecordingError::malformed(path, reason)),
            None => depth_of_png(path, &bytes)?,
        },
    };
    Ok(measured(path, image, scale.integer, full_is_hole))
}

/// Depth of decoded counts.
pub(super) fn measured(path: &Path, image: DepthImage, per_unit: f32, full_is_hole: bool) -> Measured {
    let DepthImage { width, height, mut counts } = image;
    if full_is_hole {
        counts.iter_mut().filter(|c| **c == u16::MAX).for_each(|c| *c = 0);
    }
    Measured::new(path, width, height, DepthMap::new(counts, per_unit), per_unit)
}

/// Why a file of another kind cannot be read.
fn foreign(path: &Path, bytes: &[u8]) -> Option<String> {
    if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        return Some(JPEG.into());
    }
    if bytes.starts_with(b"II*\0") || bytes.starts_with(b"MM\0*") {
        return Some("is a TIFF, which is not read; convert the depth images to 16-bit one-channel PNG".into());
    }
    let suffix = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    (suffix != "png" && !bytes.starts_with(b"\x89PNG")).then(|| {
        format!("depth images of the kind `.{suffix}` are not read; convert them to 16-bit one-channel PNG, or NumPy arrays `.npy`")
    })
}

/// Said of a JPEG where depth is expected.
pub(super) const JPEG: &str = "is a JPEG: a picture with 256 levels whose compression changes them is no depth; record or export the \
                               depth images without loss (16-bit PNG)";

/// A PGM with 16 bits per pixel, big-endian.
fn depth_of_pgm(bytes: &[u8]) -> Result<DepthImage, String> {
    let broken = || "not a complete PGM image; copy or export it again".to_string();
    let (mut at, mut head) = (2, [0_usize; 3]);
    for value in &mut head {
        loop {
            match bytes.get(at).ok_or_else(broken)? {
                b'#' => at += bytes[at..].iter().position(|b| *b == b'\n').ok_or_else(broken)?,
                b if b.is_ascii_whitespace() => at += 1,
                _ => break,
            }
        }
        let digits = bytes[at..].iter().take_while(|b| b.is_ascii_digit()).count();
        let text = std::str::from_utf8(&bytes[at..at + digits]).map_err(|_| broken())?;
        *value = text.parse().map_err(|_| broken())?;
        at += digits;
    }
    let [width, height, most] = head;
    if most < 256 {
        return Err(
            "is a PGM of 8 bits per pixel, a picture with 256 levels; export depth with 16 bits per pixel".into()
        );
    }
    let data = bytes.get(at + 1..).ok_or_else(broken)?;
    let length = width.checked_mul(height).and_then(|n| n.checked_mul(2)).filter(|n| *n > 0 && *n <= data.len());
    let data = &data[..length.ok_or_else(broken)?];
    let counts = data.as_chunks::<2>().0.iter().map(|b| u16::from_be_bytes(*b)).collect();
    Ok(DepthImage { width: width as u32, height: height as u32, counts })
}

/// Files that look like depth images, in the folder and the folders in it, as paths relative to it.
pub(super) fn lookalikes(dir: &Path) -> Vec<String> {
    const LOSSLESS: [&str; 9] = ["png", "pgm", "npy", "exr", "tiff", "tif", "pfm", "npz", "raw"];
    let is_image = |name: &str| {
        let suffix = name.rsplit_once('.').map_or("", |(_, s)| s).to_ascii_lowercase();
        LOSSLESS.contains(&suffix.as_str())
    };
    let says_depth = |name: &str| name.to_ascii_lowercase().contains("depth");
    let mut found = Vec::new();
    for name in names(dir) {
        let inside = names(&dir.join(&name));
        let inside = inside.into_iter().filter(|n| is_image(n) && (says_depth(n) || says_depth(&name)));
        found.extend(inside.map(|n| format!("{name}/{n}")));
        if is_image(&name) && says_depth(&name) {
            found.push(name);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        (dir, path)
    }

    #[test]
    fn pgm_is_read_with_comments_and_refused_with_8_bits() {
        let (_dir, path) = written("d.pgm", b"P5\n# made by a sensor\n2 1\n65535\n\x03\xe8\xff\xff");
        let depth = read(&path, Scale::MILLIMETRES, true).unwrap();
        assert_eq!((depth.width, depth.height, depth.map.counts()), (2, 1, &[1000, 0][..]));
        let (_dir, path) = written("d.pgm", b"P5 2 1 255\n\x03\xe8");
        assert!(read(&path, Scale::MILLIMETRES, true).unwrap_err().to_string().contains("8 bits"));
        let (_dir, path) = written("d.pgm", b"P5 2 900000000000 65535\n\x03\xe8");
        assert!(read(&path, Scale::MILLIMETRES, true).unwrap_err().to_string().contains("not a complete PGM"));
    }

    #[test]
    fn pictures_are_refused_with_their_kind() {
        for (name, bytes, part) in [
            ("d.png", &b"\xff\xd8\xff\xe0"[..], "is a JPEG"),
            ("d.png", b"II*\0abc", "is a TIFF"),
            ("d.bin", b"abcd", "`.bin` are not read"),
            ("d.png", b"abcd", "not a complete, readable PNG"),
        ] {
            let (_dir, path) = written(name, bytes);
            let message = read(&path, Scale::MILLIMETRES, false).unwrap_err().to_string();
            assert!(message.contains(name) && message.contains(part), "{message}");
        }
    }

    #[test]
    fn the_readable_file_is_found_first() {
        let (dir, path) = written("7.jpg", b"");
        assert_eq!(find(dir.path(), &["7"]), Some(path));
        std::fs::write(dir.path().join("7.npy"), b"").unwrap();
        assert_eq!(find(dir.path(), &["8", "7"]), Some(dir.path().join("7.npy")));
        assert_eq!(find(dir.path(), &["8"]), None);
    }
}
