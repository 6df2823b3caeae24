//! Colour images: decoding of JPEG and PNG, orientation, reduction.

use super::RecordingError;
use crate::error::read_bytes;
use crate::image_io::rgba_of_png;
use crate::reduce::reduced_rgba;
use image::codecs::jpeg::{JpegDecoder, JpegEncoder};
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder};
use std::io::Cursor;
use std::path::Path;

/// A decoded colour image: straight RGBA, row-major.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Color {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) rgba: Vec<[u8; 4]>,
    /// How a viewer would turn the stored pixels (EXIF). Not applied here: poses may belong to the stored pixels.
    pub(super) orientation: Orientation,
}

impl Color {
    pub(super) fn new(width: u32, height: u32, rgba: Vec<[u8; 4]>) -> Self {
        Self { width, height, rgba, orientation: Orientation::NoTransforms }
    }

    /// The image as a viewer shows it.
    pub(super) fn oriented(self) -> Self {
        let Self { width, height, orientation, rgba } = &self;
        let Some(buffer) = image::RgbaImage::from_raw(*width, *height, rgba.as_flattened().to_vec()) else {
            return self;
        };
        let mut image = DynamicImage::ImageRgba8(buffer);
        image.apply_orientation(*orientation);
        let image = image.into_rgba8();
        Self::new(image.width(), image.height(), image.into_raw().as_chunks::<4>().0.to_vec())
    }

    /// The image at a smaller size; every new pixel is the mean of the area that it covers.
    pub(super) fn reduced(&self, width: u32, height: u32) -> Self {
        if (width, height) == (self.width, self.height) {
            return self.clone();
        }
        let rgba = reduced_rgba(&self.rgba, (self.width, self.height), (width, height));
        Self { width, height, rgba, orientation: self.orientation }
    }
}

/// Largest size of a decoded image, bytes.
const LARGEST: u64 = 1 << 30;

/// Reads a JPEG or PNG, recognised by its first bytes.
pub(super) fn read_color(path: &Path) -> Result<Color, RecordingError> {
    decode_color(path, &read_bytes(path)?)
}

/// Width and height in the header of a JPEG or PNG.
pub(super) fn dimensions(path: &Path) -> Result<(u32, u32), RecordingError> {
    let unreadable = |e: &dyn std::fmt::Display| RecordingError::malformed(path, format!("not a readable image ({e})"));
    let reader = image::ImageReader::open(path).and_then(|r| r.with_guessed_format()).map_err(|e| unreadable(&e))?;
    reader.into_dimensions().map_err(|e| unreadable(&e))
}

/// Decodes a JPEG or PNG; `path` names it in messages.
pub(super) fn decode_color(path: &Path, bytes: &[u8]) -> Result<Color, RecordingError> {
    if bytes.starts_with(b"\x89PNG") {
        let image = rgba_of_png(path, bytes)?;
        return Ok(Color::new(image.width, image.height, image.pixels));
    }
    if !bytes.starts_with(&[0xff, 0xd8]) {
        return Err(RecordingError::malformed(
            path,
            "neither a JPEG nor a PNG; export the images in one of these formats",
        ));
    }
    let broken = |reason: &dyn std::fmt::Display| {
        RecordingError::malformed(path, format!("not a complete, readable JPEG ({reason}); copy or export it again"))
    };
    if !ends(bytes) {
        return Err(broken(&"the end marker is missing"));
    }
    let mut decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(|e| broken(&e))?;
    if decoder.total_bytes() > LARGEST {
        return Err(broken(&"more than 1 GiB of pixels"));
    }
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let image = DynamicImage::from_decoder(decoder).map_err(|e| broken(&e))?.into_rgba8();
    let (width, height) = image.dimensions();
    Ok(Color { orientation, ..Color::new(width, height, image.into_raw().as_chunks::<4>().0.to_vec()) })
}

/// True if a JPEG has its end marker after its last scan: the decoder fills missing rows with grey.
fn ends(bytes: &[u8]) -> bool {
    let last = |marker: [u8; 2]| bytes.windows(2).rposition(|w| w == marker);
    matches!((last([0xff, 0xda]), last([0xff, 0xd9])), (Some(scan), Some(end)) if end > scan)
}

/// The bytes of a JPEG without the alpha of the pixels; `path` names it in messages.
pub(super) fn jpeg(path: &Path, width: u32, height: u32, rgba: &[[u8; 4]]) -> Result<Vec<u8>, RecordingError> {
    let rgb: Vec<u8> = rgba.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 95)
        .encode(&rgb, width, height, image::ExtendedColorType::Rgb8)
        .map_err(|e| RecordingError::malformed(path, format!("cannot be encoded: {e}")))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reduced_pixels_are_means_of_areas() {
        let image = Color::new(3, 1, vec![[0, 90, 0, 255], [90, 0, 0, 255], [30, 60, 9, 255]]);
        let half = image.reduced(2, 1);
        assert_eq!(half.rgba, [[30, 60, 0, 255], [50, 40, 6, 255]]);
        assert_eq!(image.reduced(3, 1), image);
        assert_eq!(image.reduced(1, 1).rgba, [[40, 50, 3, 255]]);
    }

    #[test]
    fn incomplete_and_foreign_images_are_refused() {
        let pixels = vec![[120, 60, 30, 255]; 64 * 48];
        let bytes = jpeg(Path::new("a.jpg"), 64, 48, &pixels).unwrap();
        let back = decode_color(Path::new("a.jpg"), &bytes).unwrap();
        assert_eq!((back.width, back.height), (64, 48));
        assert!(back.rgba.iter().all(|p| p[0].abs_diff(120) < 4 && p[3] == 255));
        let message = decode_color(Path::new("a.jpg"), &bytes[..bytes.len() / 2]).unwrap_err().to_string();
        assert!(message.contains("a.jpg") && message.contains("end marker"), "{message}");
        let message = decode_color(Path::new("b.jpg"), b"GIF89a").unwrap_err().to_string();
        assert!(message.contains("b.jpg") && message.contains("JPEG"), "{message}");
    }

    #[test]
    fn orientation_turns_the_image() {
        let mut image = Color::new(2, 1, vec![[1, 0, 0, 255], [2, 0, 0, 255]]);
        image.orientation = Orientation::Rotate90;
        let turned = image.oriented();
        assert_eq!((turned.width, turned.height, turned.rgba), (1, 2, vec![[1, 0, 0, 255], [2, 0, 0, 255]]));
    }
}
