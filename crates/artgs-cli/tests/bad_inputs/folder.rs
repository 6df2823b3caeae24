//! Changes of the files of a case. Copies share their content with the seed, so a file is replaced and never written into.

use artgs_core::DepthMap;
use artgs_io::image_io::{read_depth, read_rgba, write_depth, write_rgba};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder `IN` of a case.
pub(crate) struct Folder(PathBuf);

impl Folder {
    pub(crate) fn new(root: &Path) -> Self {
        Self(root.into())
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Every file with its length, sorted.
    pub(crate) fn listing(&self) -> Vec<(String, u64)> {
        let mut found = Vec::new();
        let mut folders = vec![self.0.clone()];
        while let Some(folder) = folders.pop() {
            let Ok(entries) = fs::read_dir(&folder) else { continue };
            for entry in entries.map(Result::unwrap) {
                match entry.file_type().unwrap().is_dir() {
                    true => folders.push(entry.path()),
                    false => found.push((entry.path().display().to_string(), entry.metadata().unwrap().len())),
                }
            }
        }
        found.sort();
        found
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// Replaces or makes a file.
    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let _ = fs::remove_file(&path);
        fs::write(path, bytes).unwrap();
    }

    /// Removes a file or folder.
    pub(crate) fn remove(&self, name: &str) {
        let path = self.path(name);
        if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) }.unwrap();
    }

    /// Changes the bytes of a file.
    pub(crate) fn bytes(&self, name: &str, change: impl FnOnce(&mut Vec<u8>)) {
        let mut bytes = self.read(name);
        change(&mut bytes);
        self.write(name, bytes);
    }

    /// Keeps a share of a file.
    pub(crate) fn cut(&self, name: &str, share: f64) {
        self.bytes(name, |b| b.truncate((b.len() as f64 * share) as usize));
    }

    /// Replaces the first occurrence of a text.
    pub(crate) fn text(&self, name: &str, from: &str, to: &str) {
        let text = String::from_utf8(self.read(name)).unwrap();
        assert!(text.contains(from), "{name} has no {from}");
        self.write(name, text.replacen(from, to, 1));
    }

    /// Changes a JSON file.
    pub(crate) fn json(&self, name: &str, change: impl FnOnce(&mut Value)) {
        let mut value: Value = serde_json::from_slice(&self.read(name)).unwrap();
        change(&mut value);
        self.write(name, value.to_string());
    }

    /// Changes a JSON file of which there is one per state; `{}` in the name is the state.
    pub(crate) fn both(&self, name: &str, change: impl Fn(&mut Value)) {
        for state in ["start", "end"] {
            self.json(&name.replace("{}", state), &change);
        }
    }

    /// Changes the colour image of a file.
    pub(crate) fn colour(&self, name: &str, change: impl Fn([u8; 4]) -> [u8; 4]) {
        let mut image = read_rgba(&self.path(name)).unwrap();
        image.pixels.iter_mut().for_each(|p| *p = change(*p));
        self.remove(name);
        write_rgba(&self.path(name), image.width, image.height, &image.pixels).unwrap();
    }

    /// Changes the counts of a depth image.
    pub(crate) fn depth(&self, name: &str, change: impl Fn(u16) -> u16) {
        let image = read_depth(&self.path(name)).unwrap();
        let counts = image.counts.iter().map(|c| change(*c)).collect();
        self.remove(name);
        write_depth(&self.path(name), image.width, image.height, &DepthMap::new(counts, 1.0)).unwrap();
    }

    /// Names of the files in a folder, sorted.
    pub(crate) fn names(&self, folder: &str) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(self.path(folder))
            .unwrap()
            .map(|e| format!("{folder}/{}", e.unwrap().file_name().to_str().unwrap()))
            .collect();
        names.sort();
        names
    }
}

/// An image of one colour as PNG.
pub(crate) fn png(image: &image::DynamicImage) -> Vec<u8> {
    encoded(image, image::ImageFormat::Png)
}

/// An image of one colour as JPEG.
pub(crate) fn jpeg(image: &image::DynamicImage) -> Vec<u8> {
    encoded(&image.to_rgb8().into(), image::ImageFormat::Jpeg)
}

fn encoded(image: &image::DynamicImage, format: image::ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// A PNG whose header states this size and whose content is that of a smaller one.
pub(crate) fn huge_png(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = png(&image::DynamicImage::new_rgba8(4, 4));
    bytes[16..20].copy_from_slice(&width.to_be_bytes());
    bytes[20..24].copy_from_slice(&height.to_be_bytes());
    // The header's checksum must fit, or that is what is wrong.
    let sum = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&sum.to_be_bytes());
    bytes
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |mut sum: u32, byte| {
        sum ^= u32::from(*byte);
        for _ in 0..8 {
            sum = if sum & 1 == 1 { sum >> 1 ^ 0xedb8_8320 } else { sum >> 1 };
        }
        sum
    })
}
