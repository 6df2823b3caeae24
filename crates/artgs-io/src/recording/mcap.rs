//! MCAP files with images of ROS 1 or ROS 2. Poses come from a separate file.

use super::binary::{Bytes, Ends};
use super::container::{Block, Container, Location, Packing, Topic, Visit, damaged, open, read_block};
use super::format::begins_with;
use super::index::Index;
use super::{RecordingError, RecordingOptions, ros};
use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// Kinds of records.
const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;
const DATA_END: u8 = 15;

/// Largest beginning of a chunk: times, sizes and the name of its compression.
const CHUNK_HEAD: u64 = 256;

pub(super) fn matches(path: &Path) -> bool {
    file(path).is_some()
}

/// The file itself, or the only MCAP file of a folder.
fn file(path: &Path) -> Option<PathBuf> {
    if path.is_dir() {
        let mut files = super::files::names(path).into_iter().filter(|n| n.ends_with(".mcap")).map(|n| path.join(n));
        return files.next().filter(|p| files.next().is_none() && begins_with(p, MAGIC));
    }
    begins_with(path, MAGIC).then(|| path.into())
}

pub(super) fn index(path: &Path, options: &RecordingOptions) -> Result<Index, RecordingError> {
    let Some(file) = file(path) else {
        return Err(RecordingError::incomplete(path, "is no MCAP file; give the .mcap file"));
    };
    ros::index(Arc::new(Mcap(file)), options)
}

struct Mcap(PathBuf);

/// Names of message types and channels by their numbers.
#[derive(Default)]
struct Known {
    kinds: BTreeMap<u16, String>,
    topics: BTreeMap<u16, Topic>,
}

impl Container for Mcap {
    fn path(&self) -> &Path {
        &self.0
    }

    fn scan(&self, visit: &mut Visit) -> Result<(), RecordingError> {
        let mut file = open(&self.0)?;
        let length = file.metadata().map_or(0, |m| m.len());
        let (mut at, mut known) = (MAGIC.len() as u64, Known::default());
        loop {
            let ends = || damaged(&self.0, "the file ends inside a record");
            let mut head = [0; 9];
            file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(&mut head)).map_err(|_| ends())?;
            let [kind, size @ ..] = head;
            let block = Block { offset: at + 9, length: u64::from_le_bytes(size), packing: Packing::None };
            at = block.offset.checked_add(block.length).filter(|end| *end <= length).ok_or_else(ends)?;
            match kind {
                DATA_END => return Ok(()),
                CHUNK => {
                    let beginning = Block { length: block.length.min(CHUNK_HEAD), ..block };
                    let head = read_block(&self.0, &mut file, &beginning)?;
                    let inside = chunk(&head, block).map_err(|_| damaged(&self.0, "a chunk is incomplete"))?;
                    let inside = inside.ok_or_else(|| damaged(&self.0, "the compression of a chunk is unknown"))?;
                    let data = read_block(&self.0, &mut file, &inside)?;
                    let complete = records(&data, inside, &mut known, visit);
                    complete.map_err(|_| damaged(&self.0, "a chunk is incomplete"))?;
                }
                SCHEMA | CHANNEL | MESSAGE => {
                    let data = read_block(&self.0, &mut file, &block)?;
                    let complete = known.record(kind, &data, block, 0, visit);
                    complete.map_err(|_| damaged(&self.0, "a record is incomplete"))?;
                }
                _ => {}
            }
        }
    }
}

/// The packed records of a chunk; none if the compression is unknown.
fn chunk(head: &[u8], block: Block) -> Result<Option<Block>, Ends> {
    let mut bytes = Bytes::new(head);
    // Times of the first and last message, unpacked size, checksum.
    bytes.take(8 + 8 + 8 + 4)?;
    let name = bytes.text()?;
    let length = bytes.u64()?;
    let begin = bytes.position() as u64;
    if begin.checked_add(length).is_none_or(|end| end > block.length) {
        return Err(Ends);
    }
    Ok(Packing::of_name(&name).map(|packing| Block { offset: block.offset + begin, length, packing }))
}

fn records(data: &[u8], block: Block, known: &mut Known, visit: &mut Visit) -> Result<(), Ends> {
    let mut bytes = Bytes::new(data);
    while !bytes.is_empty() {
        let kind = bytes.u8()?;
        let length = bytes.count(1)?;
        let begin = bytes.position();
        known.record(kind, bytes.take(length)?, block, begin, visit)?;
    }
    Ok(())
}

impl Known {
    /// A record with its content, which is at `begin` of the unpacked block.
    fn record(&mut self, kind: u8, data: &[u8], block: Block, begin: usize, visit: &mut Visit) -> Result<(), Ends> {
        let mut bytes = Bytes::new(data);
        match kind {
            SCHEMA => {
                let (id, name) = (bytes.u16()?, bytes.text()?);
                self.kinds.insert(id, name.replace("/msg/", "/"));
            }
            CHANNEL => {
                let (id, schema, name, encoding) = (bytes.u16()?, bytes.u16()?, bytes.text()?, bytes.text()?);
                let kind = match encoding.as_str() {
                    "ros1" | "cdr" => self.kinds.get(&schema).cloned().unwrap_or_default(),
                    // Messages of other encodings cannot be read.
                    _ => String::new(),
                };
                self.topics.insert(id, Topic { name, kind, cdr: encoding == "cdr" });
            }
            MESSAGE => {
                let id = bytes.u16()?;
                bytes.u32()?;
                let time = bytes.u64()? as f64 * 1e-9;
                bytes.u64()?;
                if let Some(topic) = self.topics.get(&id) {
                    let (at, end) = (bytes.position(), data.len());
                    visit(topic, time, Location { block, begin: begin + at, end: begin + end }, &data[at..]);
                }
            }
            _ => {}
        }
        Ok(())
    }
}
