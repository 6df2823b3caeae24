//! Containers of recorded messages: what their readers share.

use super::RecordingError;
use crate::FileError;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// A kind of message.
#[derive(Clone, Debug)]
pub(super) struct Topic {
    pub(super) name: String,
    /// Type of the messages, as in ROS 1: `sensor_msgs/Image`.
    pub(super) kind: String,
    /// True if messages are encoded as in ROS 2.
    pub(super) cdr: bool,
}

/// How a block of messages is packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    None,
    Bzip2,
    Lz4,
    Zstd,
}

impl Packing {
    pub(super) fn of_name(name: &str) -> Option<Self> {
        match name {
            "" | "none" => Some(Self::None),
            "bz2" => Some(Self::Bzip2),
            "lz4" => Some(Self::Lz4),
            "zstd" => Some(Self::Zstd),
            _ => None,
        }
    }
}

/// Where a message is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Location {
    /// The block in the file.
    pub(super) block: Block,
    /// The message in the unpacked block.
    pub(super) begin: usize,
    pub(super) end: usize,
}

/// A part of a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    pub(super) offset: u64,
    pub(super) length: u64,
    pub(super) packing: Packing,
}

/// Receives topic, time of recording in seconds, place and content of every message.
pub(super) type Visit<'a> = dyn FnMut(&Topic, f64, Location, &[u8]) + 'a;

/// A file with messages.
pub(super) trait Container: Send + Sync {
    fn path(&self) -> &Path;

    /// Visits every message in the order of the file.
    fn scan(&self, visit: &mut Visit) -> Result<(), RecordingError>;

    /// The content of a message.
    fn fetch(&self, location: &Location) -> Result<Vec<u8>, RecordingError> {
        let mut file = open(self.path())?;
        let data = read_block(self.path(), &mut file, &location.block)?;
        let message = data.get(location.begin..location.end);
        message.map(<[u8]>::to_vec).ok_or_else(|| damaged(self.path(), "a message ends outside its block"))
    }
}

/// Largest block, packed or not, bytes.
const LARGEST: u64 = 1 << 30;

pub(super) fn open(path: &Path) -> Result<File, RecordingError> {
    Ok(File::open(path).map_err(|source| FileError::Read { path: path.into(), source })?)
}

pub(super) fn damaged(path: &Path, what: &str) -> RecordingError {
    RecordingError::malformed(path, format!("damaged or incomplete ({what}); copy or record it again"))
}

/// Reads and unpacks a block.
pub(super) fn read_block(path: &Path, file: &mut File, block: &Block) -> Result<Vec<u8>, RecordingError> {
    if block.length > LARGEST {
        return Err(damaged(path, "a block of more than 1 GiB"));
    }
    let mut packed = Vec::new();
    file.seek(SeekFrom::Start(block.offset)).map_err(|_| damaged(path, "a block is missing"))?;
    file.take(block.length).read_to_end(&mut packed).map_err(|e| damaged(path, &e.to_string()))?;
    if packed.len() as u64 != block.length {
        return Err(damaged(path, "the file ends inside a block"));
    }
    let mut unpacked = Vec::new();
    let packed_data = packed.as_slice();
    let done = match block.packing {
        Packing::None => return Ok(packed),
        Packing::Bzip2 => bzip2_rs::DecoderReader::new(packed_data).take(LARGEST).read_to_end(&mut unpacked),
        Packing::Lz4 => lz4_flex::frame::FrameDecoder::new(packed_data).take(LARGEST).read_to_end(&mut unpacked),
        Packing::Zstd => match ruzstd::decoding::StreamingDecoder::new(packed_data) {
            Ok(decoder) => decoder.take(LARGEST).read_to_end(&mut unpacked),
            Err(e) => return Err(damaged(path, &e.to_string())),
        },
    };
    done.map_err(|e| damaged(path, &format!("a block cannot be unpacked: {e}")))?;
    Ok(unpacked)
}
