//! Small pictures inside a page.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::imageops::{self, FilterType as Resampling};
use image::{ExtendedColorType, ImageEncoder, RgbImage};
use std::path::Path;

/// Widest embedded half of a preview, and widest embedded picture, pixels.
const WIDTH: u32 = 450;
const WHOLE_WIDTH: u32 = 680;

/// The left half of a run's preview (photograph, rendering and parts of one view, both states), small, as a `data:` URL;
/// none if there is no readable preview.
pub(crate) fn preview_url(preview: &Path) -> Option<String> {
    let whole = image::open(preview).ok()?.to_rgb8();
    let half = imageops::crop_imm(&whole, 0, 0, whole.width() / 2, whole.height()).to_image();
    png_url(&shrunk(half, WIDTH))
}

/// A picture, small, as a `data:` URL; none if it cannot be read.
pub(crate) fn picture_url(picture: &Path) -> Option<String> {
    png_url(&shrunk(image::open(picture).ok()?.to_rgb8(), WHOLE_WIDTH))
}

fn shrunk(picture: RgbImage, width: u32) -> RgbImage {
    if picture.width() <= width {
        return picture;
    }
    let height = (u64::from(picture.height()) * u64::from(width) / u64::from(picture.width())).max(1);
    imageops::resize(&picture, width, height as u32, Resampling::Triangle)
}

fn png_url(picture: &RgbImage) -> Option<String> {
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive);
    encoder.write_image(picture.as_raw(), picture.width(), picture.height(), ExtendedColorType::Rgb8).ok()?;
    Some(format!("data:image/png;base64,{}", base64(&bytes)))
}

/// RFC 4648, with padding.
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().enumerate().fold(0_u32, |w, (i, b)| w | u32::from(*b) << (16 - 8 * i));
        for i in 0..4 {
            let digit = ALPHABET[(word >> (18 - 6 * i) & 63) as usize] as char;
            out.push(if i <= chunk.len() { digit } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_as_in_the_rfc() {
        let cases = [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")];
        for (plain, encoded) in cases {
            assert_eq!(base64(plain.as_bytes()), encoded);
        }
    }

    #[test]
    fn previews_are_halved_and_shrunk() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("preview.png");
        RgbImage::new(2400, 400).save(&path).unwrap();
        assert!(preview_url(&path).unwrap().starts_with("data:image/png;base64,iVBOR"));
        assert_eq!(shrunk(RgbImage::new(1200, 400), WIDTH).dimensions(), (450, 150));
        assert_eq!(shrunk(RgbImage::new(60, 40), WIDTH).dimensions(), (60, 40));
        assert!(picture_url(&path).unwrap().starts_with("data:image/png;base64,iVBOR"));
        let none = dir.path().join("none.png");
        assert_eq!((preview_url(&none), picture_url(&none)), (None, None));
    }
}
