//! PNG images: 8-bit colour and 16-bit depth.

use crate::error::read_bytes;
use crate::{FileError, write_atomic};
use image::{DynamicImage, ExtendedColorType, ImageEncoder, ImageFormat, codecs::png::PngEncoder};
use std::path::Path;

/// A decoded colour image.
#[derive(Clone, Debug, PartialEq)]
pub struct RgbaImage {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Straight RGBA, row-major; opaque where the file has no alpha.
    pub pixels: Vec<[u8; 4]>,
    /// True if the file has an alpha channel.
    pub has_alpha: bool,
    /// True if the file has 16 bits per channel, rounded here to 8.
    pub was_16_bit: bool,
}

/// A decoded depth image.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Depth in scene units, row-major, 0 = none.
    pub depth: Vec<f32>,
}

fn decode(path: &Path) -> Result<DynamicImage, FileError> {
    let bytes = read_bytes(path)?;
    image::load_from_memory_with_format(&bytes, ImageFormat::Png)
        .map_err(|e| FileError::malformed(path, format!("not a whole, readable PNG ({e}); write it again")))
}

/// Reads a PNG of any colour type as straight 8-bit RGBA.
pub fn read_rgba(path: &Path) -> Result<RgbaImage, FileError> {
    let image = decode(path)?;
    let color = image.color();
    let (has_alpha, was_16_bit) = (color.has_alpha(), color.bytes_per_pixel() / color.channel_count() > 1);
    let image = image.into_rgba8();
    let (width, height) = image.dimensions();
    let pixels = image.into_raw().as_chunks::<4>().0.to_vec();
    Ok(RgbaImage { width, height, pixels, has_alpha, was_16_bit })
}

/// Reads a 16-bit one-channel PNG; depth is the pixel's value divided by `scale`. Any other kind of PNG is an error.
pub fn read_depth(path: &Path, scale: f64) -> Result<DepthImage, FileError> {
    let image = decode(path)?;
    let DynamicImage::ImageLuma16(image) = image else {
        return Err(FileError::malformed(
            path,
            format!(
                "depth must be a 16-bit one-channel PNG, this one is {:?}; \
                 write round(depth * depth_scale) as 16-bit greyscale",
                image.color()
            ),
        ));
    };
    let (width, height) = image.dimensions();
    let depth = image.into_raw().into_iter().map(|v| (f64::from(v) / scale) as f32).collect();
    Ok(DepthImage { width, height, depth })
}

fn encode(path: &Path, width: u32, height: u32, bytes: &[u8], color: ExtendedColorType) -> Result<(), FileError> {
    let expected = u64::from(width) * u64::from(height) * u64::from(color.bits_per_pixel() / 8);
    if bytes.len() as u64 != expected || expected == 0 {
        return Err(FileError::malformed(
            path,
            format!("{} bytes of pixels do not make {width}x{height}", bytes.len()),
        ));
    }
    let mut png = Vec::new();
    PngEncoder::new(&mut png)
        .write_image(bytes, width, height, color)
        .map_err(|e| FileError::malformed(path, format!("cannot be encoded: {e}")))?;
    write_atomic(path, &png)
}

/// Writes an 8-bit RGB PNG, row-major.
pub fn write_rgb(path: &Path, width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<(), FileError> {
    encode(path, width, height, pixels.as_flattened(), ExtendedColorType::Rgb8)
}

/// Writes an 8-bit RGBA PNG (straight alpha), row-major.
pub fn write_rgba(path: &Path, width: u32, height: u32, pixels: &[[u8; 4]]) -> Result<(), FileError> {
    encode(path, width, height, pixels.as_flattened(), ExtendedColorType::Rgba8)
}

/// Writes an 8-bit greyscale PNG, row-major: labels, one number per pixel.
pub fn write_gray(path: &Path, width: u32, height: u32, pixels: &[u8]) -> Result<(), FileError> {
    encode(path, width, height, pixels, ExtendedColorType::L8)
}

/// Writes a 16-bit depth PNG: `round(depth * scale)`. What does not fit 16 bits, or is not finite, becomes 0 (none).
pub fn write_depth(path: &Path, width: u32, height: u32, depth: &[f32], scale: f64) -> Result<(), FileError> {
    let value = |d: &f32| {
        let v = (f64::from(*d) * scale).round();
        if (0.0..=65535.0).contains(&v) { v as u16 } else { 0 }
    };
    let bytes: Vec<u8> = depth.iter().flat_map(|d| value(d).to_ne_bytes()).collect();
    encode(path, width, height, &bytes, ExtendedColorType::L16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_and_depth_come_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.png");
        let rgba = [[1, 2, 3, 4], [250, 0, 9, 0]];
        write_rgba(&path, 2, 1, &rgba).unwrap();
        let back = read_rgba(&path).unwrap();
        assert_eq!((back.width, back.height, back.pixels.as_slice(), back.has_alpha), (2, 1, rgba.as_slice(), true));

        write_rgb(&path, 1, 2, &[[9, 8, 7], [6, 5, 4]]).unwrap();
        let back = read_rgba(&path).unwrap();
        assert_eq!((back.pixels, back.has_alpha), (vec![[9, 8, 7, 255], [6, 5, 4, 255]], false));

        write_gray(&path, 2, 1, &[0, 7]).unwrap();
        assert_eq!(read_rgba(&path).unwrap().pixels, [[0, 0, 0, 255], [7, 7, 7, 255]]);

        write_depth(&path, 3, 1, &[1.2344, 0.0, 70.0], 1000.0).unwrap();
        assert_eq!(read_depth(&path, 1000.0).unwrap().depth, [1.234, 0.0, 0.0]);
    }

    #[test]
    fn eight_bit_depth_and_wrong_sizes_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.png");
        image::GrayImage::new(2, 2).save(&path).unwrap();
        let message = read_depth(&path, 1000.0).unwrap_err().to_string();
        assert!(message.contains("d.png") && message.contains("16-bit"), "{message}");
        assert!(write_rgb(&path, 2, 2, &[[0; 3]; 3]).is_err());
    }

    #[test]
    fn sixteen_bit_colour_is_rounded() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("w.png");
        let wide =
            image::ImageBuffer::<image::Rgba<u16>, _>::from_raw(1, 1, vec![65535u16, 0, 257 * 7, 65535]).unwrap();
        wide.save(&path).unwrap();
        let back = read_rgba(&path).unwrap();
        assert_eq!((back.pixels, back.was_16_bit), (vec![[255, 0, 7, 255]], true));
    }
}
