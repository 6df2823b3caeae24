//! Depth images in OpenEXR: one channel, half or single floats, scene units.

use super::RecordingError;
use super::depth::Measured;
use crate::write_atomic;
use artgs_core::DepthMap;
use exr::meta::MetaData;
use exr::prelude::*;
use std::io::Cursor;
use std::path::Path;

/// Names of a channel with depth, the usual one first; else the first channel is read.
const CHANNELS: [&str; 4] = ["R", "Z", "Y", "depth"];
/// Most samples of all channels and layers, 512 MiB in single floats. The decoder reserves what the header states, which a
/// damaged file must not choose.
const MOST_SAMPLES: usize = 1 << 27;

/// Decodes an image; `path` names it in messages.
pub(super) fn decode(path: &Path, bytes: &[u8]) -> std::result::Result<Measured, RecordingError> {
    let broken = |e: &dyn std::fmt::Display| {
        RecordingError::malformed(path, format!("not a complete, readable EXR image ({e}); export the recording again"))
    };
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|e| broken(&e))?;
    if stated_samples(&meta).is_none_or(|samples| samples > MOST_SAMPLES) {
        return Err(broken(&"its header states more than 134 million samples"));
    }
    if meta.headers.iter().any(|header| is_lossy(&header.compression)) {
        return Err(broken(&"its compression loses depth; store it with ZIP, PIZ or without compression"));
    }
    let reader = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let image = reader.non_parallel().from_buffered(Cursor::new(bytes)).map_err(|e| broken(&e))?;
    let channels = &image.layer_data.channel_data.list;
    let named = |name: &&str| channels.iter().find(|c| c.name.eq_case_insensitive(name));
    let channel = CHANNELS.iter().find_map(named).or(channels.first());
    let channel = channel.ok_or_else(|| broken(&"no channel"))?;
    let size = image.layer_data.size;
    let depths: Vec<f32> = channel.sample_data.values_as_f32().collect();
    if depths.len() != size.area() || depths.is_empty() {
        return Err(broken(&"the channel has another size than the image"));
    }
    Ok(Measured::new(path, size.x() as u32, size.y() as u32, DepthMap::nearest(&depths), 1.0))
}

/// True for compressions for pictures, which lose digits of half floats. Their decoder also fails on damaged data.
fn is_lossy(compression: &Compression) -> bool {
    !matches!(
        compression,
        Compression::Uncompressed
            | Compression::RLE
            | Compression::ZIP1
            | Compression::ZIP16
            | Compression::PIZ
            | Compression::PXR24
    )
}

/// Samples of all channels of all layers according to the headers; `None` if the number overflows.
fn stated_samples(meta: &MetaData) -> Option<usize> {
    meta.headers.iter().try_fold(0usize, |sum, header| {
        let pixels = header.layer_size.x().checked_mul(header.layer_size.y())?;
        sum.checked_add(pixels.checked_mul(header.channels.list.len())?)
    })
}

/// Writes half floats in one channel "R", as Record3D does.
pub(super) fn write(path: &Path, width: u32, height: u32, depths: &[f32]) -> std::result::Result<(), RecordingError> {
    let failed = |e: &dyn std::fmt::Display| RecordingError::malformed(path, format!("cannot be encoded: {e}"));
    let samples = FlatSamples::F16(depths.iter().map(|d| f16::from_f32(*d)).collect());
    let channels = AnyChannels::sort(SmallVec::from_iter([AnyChannel::new("R", samples)]));
    let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::default() };
    let layer = Layer::new((width as usize, height as usize), LayerAttributes::named("depth"), encoding, channels);
    let mut bytes = Cursor::new(Vec::new());
    let image = Image::from_layer(layer);
    image.write().non_parallel().to_buffered(&mut bytes).map_err(|e| failed(&e))?;
    Ok(write_atomic(path, bytes.get_ref())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_floats_come_back_and_incomplete_files_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.exr");
        let depths: Vec<f32> = (0..40 * 30).map(|i| if i % 7 == 0 { 0.0 } else { 0.5 + i as f32 * 1e-3 }).collect();
        super::write(&path, 40, 30, &depths).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let back = decode(&path, &bytes).unwrap();
        assert_eq!((back.width, back.height), (40, 30));
        assert!(depths.iter().zip(back.map.iter()).all(|(a, b)| (a - b).abs() <= a * 6e-4));
        let message = decode(&path, &bytes[..bytes.len() / 2]).unwrap_err().to_string();
        assert!(message.contains("d.exr") && message.contains("not a complete"), "{message}");
    }

    #[test]
    fn compressions_that_lose_depth_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.exr");
        super::write(&path, 40, 30, &[1.0; 40 * 30]).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        let name = b"compression\0compression\0";
        let at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
        // B44 and B44A in the file format.
        for lossy in [6, 7] {
            bytes[at] = lossy;
            let message = decode(&path, &bytes).unwrap_err().to_string();
            assert!(message.contains("d.exr") && message.contains("compression"), "{message}");
        }
    }

    #[test]
    fn a_header_that_states_a_huge_image_is_refused_before_memory_is_reserved() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.exr");
        super::write(&path, 40, 30, &[1.0; 40 * 30]).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        let name = b"dataWindow\0box2i\0";
        let start = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
        let far = 16_000_000i32.to_le_bytes();
        bytes[start + 8..start + 12].copy_from_slice(&far);
        bytes[start + 12..start + 16].copy_from_slice(&far);
        let message = decode(&path, &bytes).unwrap_err().to_string();
        assert!(message.contains("d.exr") && message.contains("EXR"), "{message}");
    }
}
