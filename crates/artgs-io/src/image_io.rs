//! PNG images: 8-bit colour and 16-bit depth.

use crate::error::read_bytes;
use crate::{FileError, write_atomic};
use artgs_core::DepthMap;
use image::codecs::png::{PngDecoder, PngEncoder};
use image::{ColorType, DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageError};
use std::io::Cursor;
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
    /// Counts of the file, row-major, 0 = none.
    pub counts: Vec<u16>,
}

fn open(path: &Path, bytes: &[u8]) -> Result<impl ImageDecoder, FileError> {
    if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        return Err(FileError::malformed(
            path,
            "is a JPEG, here only a PNG can be used; convert it, renaming is not enough",
        ));
    }
    let decoder = PngDecoder::new(Cursor::new(bytes)).map_err(|e| unreadable(path, &e))?;
    if decoder.total_bytes() > LARGEST {
        let (width, height) = decoder.dimensions();
        let reason = format!("the header states {width}x{height} pixels, which need more than 1 GiB; reduce the size");
        return Err(FileError::malformed(path, reason));
    }
    Ok(decoder)
}

/// Largest size of a decoded image, bytes: a header with a larger size is damaged or malicious.
pub(crate) const LARGEST: u64 = 1 << 30;

fn unreadable(path: &Path, error: &ImageError) -> FileError {
    FileError::malformed(path, format!("not a complete, readable PNG ({error}); write it again"))
}

/// Reads a PNG of any colour type as straight 8-bit RGBA.
pub fn read_rgba(path: &Path) -> Result<RgbaImage, FileError> {
    rgba_of_png(path, &read_bytes(path)?)
}

/// Decodes a PNG of any colour type as straight 8-bit RGBA; `path` names it in messages.
pub(crate) fn rgba_of_png(path: &Path, bytes: &[u8]) -> Result<RgbaImage, FileError> {
    let decoder = open(path, bytes)?;
    let ((width, height), color) = (decoder.dimensions(), decoder.color_type());
    let (has_alpha, was_16_bit) = (color.has_alpha(), color.bytes_per_pixel() / color.channel_count() > 1);
    let pixels = if color == ColorType::Rgba8 {
        // Decoded without a copy: copies of hundreds of images fragment the memory.
        let mut pixels = vec![[0; 4]; width as usize * height as usize];
        decoder.read_image(pixels.as_flattened_mut()).map_err(|e| unreadable(path, &e))?;
        pixels
    } else {
        let image = DynamicImage::from_decoder(decoder).map_err(|e| unreadable(path, &e))?;
        image.into_rgba8().into_raw().as_chunks::<4>().0.to_vec()
    };
    Ok(RgbaImage { width, height, pixels, has_alpha, was_16_bit })
}

/// Reads a 16-bit one-channel PNG. Any other kind of PNG is an error.
pub fn read_depth(path: &Path) -> Result<DepthImage, FileError> {
    depth_of_png(path, &read_bytes(path)?)
}

/// Decodes a 16-bit one-channel PNG; `path` names it in messages.
pub(crate) fn depth_of_png(path: &Path, bytes: &[u8]) -> Result<DepthImage, FileError> {
    let decoder = open(path, bytes)?;
    let color = decoder.color_type();
    if color != ColorType::L16 {
        let cause = if color.bytes_per_pixel() == color.channel_count() {
            "a picture with 256 levels, from which distances cannot be recovered; export the depth images themselves as 16-bit \
             distances, or remove them"
        } else {
            "which has several channels; write the distances to one channel"
        };
        let reason = format!("depth must be a 16-bit one-channel PNG, this one is {color:?}, {cause}");
        return Err(FileError::malformed(path, reason));
    }
    let (width, height) = decoder.dimensions();
    let mut counts = vec![0_u16; width as usize * height as usize];
    decoder.read_image(bytemuck::cast_slice_mut(&mut counts)).map_err(|e| unreadable(path, &e))?;
    Ok(DepthImage { width, height, counts })
}

fn encode(path: &Path, width: u32, height: u32, bytes: &[u8], color: ExtendedColorType) -> Result<(), FileError> {
    write_atomic(path, &png(path, width, height, bytes, color)?)
}

fn png(path: &Path, width: u32, height: u32, bytes: &[u8], color: ExtendedColorType) -> Result<Vec<u8>, FileError> {
    let expected = u64::from(width) * u64::from(height) * u64::from(color.bits_per_pixel() / 8);
    if bytes.len() as u64 != expected || expected == 0 {
        return Err(FileError::malformed(
            path,
            format!("{} bytes of pixels do not match {width}x{height}", bytes.len()),
        ));
    }
    let mut png = Vec::new();
    PngEncoder::new(&mut png)
        .write_image(bytes, width, height, color)
        .map_err(|e| FileError::malformed(path, format!("cannot be encoded: {e}")))?;
    Ok(png)
}

/// The bytes of an 8-bit RGB PNG, row-major, for the file `path`.
pub(crate) fn rgb_png(path: &Path, width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<Vec<u8>, FileError> {
    png(path, width, height, pixels.as_flattened(), ExtendedColorType::Rgb8)
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

/// Writes the counts of a depth map as a 16-bit PNG.
pub fn write_depth(path: &Path, width: u32, height: u32, depth: &DepthMap) -> Result<(), FileError> {
    let bytes: Vec<u8> = depth.counts().iter().flat_map(|count| count.to_ne_bytes()).collect();
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

        write_depth(&path, 3, 1, &DepthMap::new(vec![1234, 0, 65535], 1000.0)).unwrap();
        assert_eq!(read_depth(&path).unwrap().counts, [1234, 0, 65535]);
    }

    #[test]
    fn eight_bit_depth_and_wrong_sizes_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.png");
        image::GrayImage::new(2, 2).save(&path).unwrap();
        let message = read_depth(&path).unwrap_err().to_string();
        assert!(message.contains("d.png") && message.contains("16-bit"), "{message}");
        assert!(write_rgb(&path, 2, 2, &[[0; 3]; 3]).is_err());
    }

    #[test]
    fn a_header_with_a_huge_size_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("huge.png");
        write_rgb(&path, 1, 1, &[[1; 3]]).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
        // The checksum of the header chunk must match its new content.
        let mut crc = u32::MAX;
        for byte in &bytes[12..29] {
            crc ^= u32::from(*byte);
            (0..8).for_each(|_| crc = if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 });
        }
        bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
        std::fs::write(&path, &bytes).unwrap();
        let message = read_rgba(&path).unwrap_err().to_string();
        assert!(message.contains("huge.png") && message.contains("65536x65536"), "{message}");
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
