//! ROS 1 bags (version 2.0), as RealSense devices record them. Poses come from a separate file.

use super::binary::{Bytes, Ends};
use super::container::{Block, Container, Location, Packing, Topic, Visit, damaged, open, read_block};
use super::format::begins_with;
use super::index::Index;
use super::{RecordingError, RecordingOptions, ros};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

/// Kinds of records.
const MESSAGE: u8 = 2;
const CHUNK: u8 = 5;
const CONNECTION: u8 = 7;

/// Largest record header, bytes.
const HEADER: u32 = 1 << 20;

pub(super) fn matches(path: &Path) -> bool {
    bag(path).is_some()
}

/// The file itself, or the only bag of a folder.
fn bag(path: &Path) -> Option<PathBuf> {
    if path.is_dir() {
        let mut bags = super::files::names(path).into_iter().filter(|n| n.ends_with(".bag")).map(|n| path.join(n));
        return bags.next().filter(|p| bags.next().is_none() && begins_with(p, MAGIC));
    }
    begins_with(path, MAGIC).then(|| path.into())
}

pub(super) fn index(path: &Path, options: &RecordingOptions) -> Result<Index, RecordingError> {
    let Some(bag) = bag(path) else {
        return Err(RecordingError::incomplete(path, "is no bag of ROS 1, version 2.0; convert it with `rosbag fix`"));
    };
    ros::index(Arc::new(Bag(bag)), options)
}

struct Bag(PathBuf);

/// Fields of a record's header.
struct Header<'a>(Vec<(&'a [u8], &'a [u8])>);

impl<'a> Header<'a> {
    fn parse(data: &'a [u8]) -> Result<Self, Ends> {
        let mut bytes = Bytes::new(data);
        let mut fields = Vec::new();
        while !bytes.is_empty() {
            let field = bytes.block()?;
            let split = field.iter().position(|b| *b == b'=').ok_or(Ends)?;
            fields.push((&field[..split], &field[split + 1..]));
        }
        Ok(Self(fields))
    }

    fn get(&self, name: &str) -> Result<&'a [u8], Ends> {
        self.0.iter().find(|(n, _)| *n == name.as_bytes()).map(|(_, v)| *v).ok_or(Ends)
    }

    fn text(&self, name: &str) -> Result<String, Ends> {
        Ok(String::from_utf8_lossy(self.get(name)?).into_owned())
    }

    fn number(&self, name: &str) -> Result<u32, Ends> {
        Bytes::new(self.get(name)?).u32()
    }

    fn kind(&self) -> Result<u8, Ends> {
        Bytes::new(self.get("op")?).u8()
    }
}

type Topics = BTreeMap<u32, Topic>;

impl Container for Bag {
    fn path(&self) -> &Path {
        &self.0
    }

    fn scan(&self, visit: &mut Visit) -> Result<(), RecordingError> {
        let mut file = open(&self.0)?;
        let length = file.metadata().map_or(0, |m| m.len());
        let (mut at, mut topics) = (MAGIC.len() as u64, Topics::new());
        while at < length {
            let ends = || damaged(&self.0, "the file ends inside a record");
            let header = head(&mut file, at).ok_or_else(ends)?;
            let begin = at + 8 + header.len() as u64;
            let size = head_size(&mut file, begin - 4).ok_or_else(ends)?;
            at = begin + u64::from(size);
            if at > length {
                return Err(ends());
            }
            let wrong = |_| damaged(&self.0, "a record has no valid header");
            let header = Header::parse(&header).map_err(wrong)?;
            let mut block = Block { offset: begin, length: u64::from(size), packing: Packing::None };
            match header.kind().map_err(wrong)? {
                CHUNK => {
                    let name = header.text("compression").map_err(wrong)?;
                    let unknown = || damaged(&self.0, &format!("the compression `{name}` is unknown"));
                    block.packing = Packing::of_name(&name).ok_or_else(unknown)?;
                    let data = read_block(&self.0, &mut file, &block)?;
                    records(&data, block, &mut topics, visit).map_err(|_| damaged(&self.0, "a chunk is incomplete"))?;
                }
                kind @ (CONNECTION | MESSAGE) => {
                    let data = read_block(&self.0, &mut file, &block)?;
                    let location = Location { block, begin: 0, end: data.len() };
                    record(kind, &header, &data, location, &mut topics, visit).map_err(wrong)?;
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// The header of the record at `at`.
fn head(file: &mut File, at: u64) -> Option<Vec<u8>> {
    let size = head_size(file, at).filter(|s| *s <= HEADER)?;
    let mut header = vec![0; size as usize];
    file.read_exact(&mut header).ok()?;
    Some(header)
}

fn head_size(file: &mut File, at: u64) -> Option<u32> {
    let mut size = [0; 4];
    file.seek(SeekFrom::Start(at)).ok()?;
    file.read_exact(&mut size).ok()?;
    Some(u32::from_le_bytes(size))
}

/// The records of an unpacked chunk.
fn records(data: &[u8], block: Block, topics: &mut Topics, visit: &mut Visit) -> Result<(), Ends> {
    let mut bytes = Bytes::new(data);
    while !bytes.is_empty() {
        let header = Header::parse(bytes.block()?)?;
        let content = bytes.block()?;
        let end = bytes.position();
        let location = Location { block, begin: end - content.len(), end };
        record(header.kind()?, &header, content, location, topics, visit)?;
    }
    Ok(())
}

fn record(
    kind: u8,
    header: &Header,
    data: &[u8],
    location: Location,
    topics: &mut Topics,
    visit: &mut Visit,
) -> Result<(), Ends> {
    match kind {
        CONNECTION => {
            let kind = Header::parse(data)?.text("type")?;
            topics.insert(header.number("conn")?, Topic { name: header.text("topic")?, kind, cdr: false });
        }
        MESSAGE => {
            let mut time = Bytes::new(header.get("time")?);
            let time = f64::from(time.u32()?) + 1e-9 * f64::from(time.u32()?);
            if let Some(topic) = topics.get(&header.number("conn")?) {
                visit(topic, time, location, data);
            }
        }
        _ => {}
    }
    Ok(())
}
