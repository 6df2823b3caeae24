//! Frames in containers of ROS messages: images, camera parameters and transformations, in the encoding of ROS 1 or 2.

use super::binary::{Bytes, Ends};
use super::container::{Container, Location, Topic};
use super::depth::Measured;
use super::index::{Entry, Index, Load};
use super::lens::{Distortion, Lens};
use super::pixels::{Color, decode_color};
use super::ros_depth;
use super::ros_topics::{color_score, depth_score, refusal};
use super::trajectory::{Pose, Trajectory};
use super::tum::NEAR;
use super::warp::DepthCamera;
use super::{RecordingError, RecordingOptions};
use artgs_core::{Intrinsics, Rigid};
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// An image message without its pixels.
#[derive(Clone)]
struct Sighting {
    /// Time stamp of the device, seconds.
    stamp: f64,
    /// Time of recording, seconds.
    recorded: f64,
    encoding: String,
    location: Location,
}

/// A message with camera parameters.
#[derive(Clone)]
struct CameraInfo {
    lens: Lens,
}

/// What a container holds.
#[derive(Default)]
struct Contents {
    images: BTreeMap<String, (Topic, Vec<Sighting>)>,
    cameras: BTreeMap<String, CameraInfo>,
    /// From a common frame to that of the stream.
    transforms: BTreeMap<String, Rigid>,
    /// Metres per count of RealSense depth.
    unit: Option<f32>,
}

/// The values of a message.
fn values<'a>(topic: &Topic, data: &'a [u8]) -> Bytes<'a> {
    // CDR data begins with four bytes that state its kind.
    if topic.cdr { Bytes::aligned(data.get(4..).unwrap_or(&[])) } else { Bytes::new(data) }
}

/// Time stamp of a header.
fn header(topic: &Topic, bytes: &mut Bytes) -> Result<f64, Ends> {
    if !topic.cdr {
        bytes.u32()?;
    }
    let (seconds, nanoseconds) = (bytes.u32()?, bytes.u32()?);
    bytes.text()?;
    Ok(f64::from(seconds) + 1e-9 * f64::from(nanoseconds))
}

/// Image without pixels: stamp, width, height, encoding, big-endian, bytes per row.
pub(super) struct ImageHead {
    stamp: f64,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) encoding: String,
    pub(super) big_endian: bool,
    step: usize,
}

fn image_head(topic: &Topic, bytes: &mut Bytes) -> Result<ImageHead, Ends> {
    let stamp = header(topic, bytes)?;
    let (height, width, encoding) = (bytes.u32()?, bytes.u32()?, bytes.text()?);
    Ok(ImageHead { stamp, width, height, encoding, big_endian: bytes.u8()? != 0, step: bytes.u32()? as usize })
}

impl Contents {
    fn visit(&mut self, topic: &Topic, recorded: f64, location: Location, data: &[u8]) -> Result<(), Ends> {
        let mut bytes = values(topic, data);
        match topic.kind.as_str() {
            "sensor_msgs/Image" => {
                let head = image_head(topic, &mut bytes)?;
                self.add(topic, Sighting { stamp: head.stamp, recorded, encoding: head.encoding, location });
            }
            "sensor_msgs/CompressedImage" => {
                let stamp = header(topic, &mut bytes)?;
                self.add(topic, Sighting { stamp, recorded, encoding: bytes.text()?, location });
            }
            "sensor_msgs/CameraInfo" if !self.cameras.contains_key(&topic.name) => {
                header(topic, &mut bytes)?;
                let info = camera_info(&mut bytes)?;
                self.cameras.insert(topic.name.clone(), info);
            }
            "geometry_msgs/Transform" if topic.name.contains("/tf/") => {
                let [x, y, z, qx, qy, qz, qw] = bytes.f64s()?;
                let rotation = DQuat::from_xyzw(qx, qy, qz, qw);
                let rotation = if rotation.length() > 0.5 { rotation.normalize() } else { DQuat::IDENTITY };
                self.transforms.insert(topic.name.clone(), Rigid { rotation, translation: DVec3::new(x, y, z) });
            }
            "std_msgs/Float32" if topic.name.ends_with("Depth Units/value") => self.unit = Some(bytes.f32()?),
            _ => {}
        }
        Ok(())
    }

    fn add(&mut self, topic: &Topic, sighting: Sighting) {
        self.images.entry(topic.name.clone()).or_insert_with(|| (topic.clone(), Vec::new())).1.push(sighting);
    }

    /// The best topic by `score` (0: unsuitable); of equal ones the one with more images.
    fn choose(&self, score: impl Fn(&Topic, &str) -> usize) -> Option<&(Topic, Vec<Sighting>)> {
        let rank = |(topic, list): &&(Topic, Vec<Sighting>)| {
            let encoding = list.first().map_or("", |s| s.encoding.as_str());
            (score(topic, encoding), list.len())
        };
        self.images.values().max_by_key(rank).filter(|c| rank(c).0 > 0)
    }

    /// Why no topic holds depth that can be read, if some seem to.
    fn unread_depth(&self) -> Option<String> {
        let reason = |(topic, list): &(Topic, Vec<Sighting>)| refusal(topic, &list.first()?.encoding);
        let reasons: Vec<String> = self.images.values().filter_map(reason).collect();
        (!reasons.is_empty()).then(|| reasons.join("; "))
    }

    /// The entry whose name shares the longest beginning with a topic.
    fn nearest<'a, T>(map: &'a BTreeMap<String, T>, topic: &str) -> Option<&'a T> {
        let shared = |name: &str| name.bytes().zip(topic.bytes()).take_while(|(a, b)| a == b).count();
        map.iter().max_by_key(|(name, _)| shared(name)).map(|(_, value)| value)
    }
}

fn camera_info(bytes: &mut Bytes) -> Result<CameraInfo, Ends> {
    let (height, width, model) = (bytes.u32()?, bytes.u32()?, bytes.text()?);
    let count = bytes.u32()?;
    let d = (0..count.min(64)).map(|_| bytes.f64()).collect::<Result<Vec<f64>, _>>()?;
    let k: [f64; 9] = bytes.f64s()?;
    let at = |i: usize| d.get(i).copied().unwrap_or(0.0);
    let distortion = match model.as_str() {
        "plumb_bob" | "rational_polynomial" | "Brown Conrady" => {
            Distortion::radial([at(0), at(1), at(4), at(5), at(6), at(7)], [at(2), at(3)])
        }
        "equidistant" | "Kannala Brandt4" => Distortion::Fisheye([at(0), at(1), at(2), at(3)]),
        _ => Distortion::None,
    };
    let k = Intrinsics { fx: k[0], fy: k[4], cx: k[2] + 0.5, cy: k[5] + 0.5, width, height };
    Ok(CameraInfo { lens: Lens { distortion, ..Lens::pinhole(&k) } })
}

/// Lists frames: colour images with the nearest depth image, and poses of a separate file.
pub(super) fn index(container: Arc<dyn Container>, options: &RecordingOptions) -> Result<Index, RecordingError> {
    let path = container.path().to_path_buf();
    let Some(poses) = &options.poses else {
        let reason = "contains no poses; give --poses FILE with `timestamp tx ty tz qx qy qz qw` per line, for example from a SLAM \
                      system, camera-to-world, OpenCV axes";
        return Err(RecordingError::incomplete(&path, reason));
    };
    let trajectory = Trajectory::read(poses)?;
    let contents = scan(container.as_ref())?;
    let Some((topic, images)) = contents.choose(color_score) else {
        let reason = "contains no colour images (rgb8, bgr8, rgba8, bgra8 or compressed); record the colour stream";
        return Err(RecordingError::incomplete(&path, reason));
    };
    let depth = contents.choose(depth_score);
    if let Some(reasons) = depth.is_none().then(|| contents.unread_depth()).flatten() {
        return Err(RecordingError::incomplete(&path, format!("depth cannot be read: {reasons}")));
    }
    let lens = match (&options.intrinsics, Contents::nearest(&contents.cameras, &topic.name)) {
        (Some(k), _) => Lens::pinhole(k),
        (None, Some(info)) => info.lens,
        (None, None) => return Err(RecordingError::Intrinsics { path, hint: "" }),
    };
    let mut index = Index { metric: true, ..Index::default() };
    index.note(poses, trajectory.notes.clone());
    if depth.is_none() {
        let topics: Vec<String> = contents.images.values().map(described).collect();
        index.warnings.push(format!(
            "{}: no topic holds depth; topics of images are {}",
            path.display(),
            topics.join(", ")
        ));
    }
    let camera = depth.map(|(depth, _)| depth_camera(&contents, topic, depth, &lens, &path, &mut index.warnings));
    let camera = camera.transpose()?.flatten();
    let clock = Clock::matching(&trajectory, images);
    let (mut no_pose, mut no_depth) = (Vec::new(), Vec::new());
    for (i, image) in images.iter().enumerate() {
        let name = format!("{} {i}", topic.name);
        let Some(Pose { world_to_camera, .. }) = clock.and_then(|c| trajectory.at(c.time(image, &images[0]))) else {
            no_pose.push(name);
            continue;
        };
        let measured = depth.and_then(|(t, list)| Some((t.clone(), nearest_in_time(list, image)?.clone())));
        if measured.is_none() {
            no_depth.push(name.clone());
        }
        index.entries.push(Entry {
            time: Some(image.stamp),
            world_to_camera,
            lens,
            color: color(&container, topic, image, &name),
            depth: measured.map(|(t, s)| depth_image(&container, t, s, contents.unit, camera)),
            mask: None,
            name,
        });
    }
    if index.entries.is_empty() {
        let (first, last) = (images.first().map_or(0.0, |s| s.stamp), images.last().map_or(0.0, |s| s.stamp));
        let reason = format!(
            "none of its poses is within 20 ms of an image; time stamps of images of {} are {first:.3} to {last:.3}",
            path.display()
        );
        return Err(RecordingError::malformed(poses, reason));
    }
    index.skip(&path, "images have no pose within 20 ms", &no_pose);
    index.warn_no_depth(&path, depth.map_or(0, |(_, list)| list.len()), &no_depth);
    Ok(index)
}

/// Name and encoding of a topic.
fn described((topic, list): &(Topic, Vec<Sighting>)) -> String {
    format!("{} ({})", topic.name, list.first().map_or("", |s| s.encoding.trim()))
}

fn scan(container: &dyn Container) -> Result<Contents, RecordingError> {
    let mut contents = Contents::default();
    let mut incomplete = None;
    container.scan(&mut |topic, recorded, location, data| {
        if contents.visit(topic, recorded, location, data).is_err() {
            incomplete.get_or_insert_with(|| topic.name.clone());
        }
    })?;
    match incomplete {
        Some(topic) => {
            let reason = format!("a message of {topic} is incomplete; copy or record it again");
            Err(RecordingError::malformed(container.path(), reason))
        }
        None => Ok(contents),
    }
}

/// Which time of an image the poses state.
#[derive(Clone, Copy)]
enum Clock {
    Device,
    Recording,
    /// Seconds since the first image.
    Since,
}

impl Clock {
    fn time(self, image: &Sighting, first: &Sighting) -> f64 {
        match self {
            Self::Device => image.stamp,
            Self::Recording => image.recorded,
            Self::Since => image.stamp - first.stamp,
        }
    }

    /// The clock in which most images have a pose.
    fn matching(trajectory: &Trajectory, images: &[Sighting]) -> Option<Self> {
        let posed = |clock: Self| {
            images.iter().filter(|i| trajectory.nearest(clock.time(i, &images[0]), NEAR).is_some()).count()
        };
        let counts = [Self::Device, Self::Recording, Self::Since].map(|c| (posed(c), c));
        // Of equal counts the first.
        counts.into_iter().rev().max_by_key(|(count, _)| *count).filter(|(count, _)| *count > 0).map(|(_, c)| c)
    }
}

fn nearest_in_time<'a>(list: &'a [Sighting], image: &Sighting) -> Option<&'a Sighting> {
    let apart = |s: &&Sighting| (s.stamp - image.stamp).abs();
    list.iter().min_by(|a, b| apart(a).total_cmp(&apart(b))).filter(|s| apart(s) <= NEAR)
}

/// The depth camera if it is not the colour camera.
fn depth_camera(
    contents: &Contents,
    color: &Topic,
    depth: &Topic,
    lens: &Lens,
    path: &Path,
    warnings: &mut Vec<String>,
) -> Result<Option<DepthCamera>, RecordingError> {
    let own = Contents::nearest(&contents.cameras, &depth.name).map(|c| c.lens);
    let Some(own) = own.filter(|own| own.focal != lens.focal || own.center != lens.center) else { return Ok(None) };
    if depth.name.contains("aligned") {
        return Ok(None);
    }
    let (Some((width, height)), Some(center)) = (own.size, own.center) else { return Ok(None) };
    let common = |topic: &Topic| {
        let stem = topic.name.split("/image/").next().unwrap_or_default();
        contents.transforms.iter().find(|(name, _)| name.starts_with(stem)).map(|(_, t)| *t)
    };
    let (Some(color_from_common), Some(depth_from_common)) = (common(color), common(depth)) else {
        let reason = "depth and colour have different cameras and no transformation between them; record depth that is \
                      aligned to colour";
        return Err(RecordingError::incomplete(path, reason));
    };
    if own.distortion != Distortion::None {
        warnings.push(format!("{}: lens distortion of the depth camera is ignored", path.display()));
    }
    let intrinsics = Intrinsics { fx: own.focal.x, fy: own.focal.y, cx: center.x, cy: center.y, width, height };
    Ok(Some(DepthCamera { intrinsics, color_from_depth: color_from_common * depth_from_common.inverse() }))
}

fn color(container: &Arc<dyn Container>, topic: &Topic, image: &Sighting, name: &str) -> Load<Color> {
    let (container, topic, location) = (Arc::clone(container), topic.clone(), image.location);
    let place = container.path().join(name);
    Box::new(move || {
        let data = container.fetch(&location)?;
        let mut bytes = values(&topic, &data);
        if topic.kind.ends_with("CompressedImage") {
            let image = header(&topic, &mut bytes).and_then(|_| bytes.text()).and_then(|_| bytes.block());
            return decode_color(&place, image.map_err(|_| short(&place))?);
        }
        let head = image_head(&topic, &mut bytes).map_err(|_| short(&place))?;
        let pixels = bytes.block().map_err(|_| short(&place))?;
        let order: &[usize] = match head.encoding.as_str() {
            "rgb8" | "rgba8" => &[0, 1, 2],
            _ => &[2, 1, 0],
        };
        let channels = if head.encoding.contains('a') { 4 } else { 3 };
        let rows = rows(pixels, &head, channels).ok_or_else(|| short(&place))?;
        let pixel = |p: &[u8]| [p[order[0]], p[order[1]], p[order[2]], 255];
        Ok(Color::new(head.width, head.height, rows.flat_map(|r| r.chunks_exact(channels).map(pixel)).collect()))
    })
}

pub(super) fn short(place: &Path) -> RecordingError {
    RecordingError::malformed(place, "the message is incomplete; copy or record it again")
}

/// The rows of an image of `size` bytes per pixel, without padding; none if the data is too short.
pub(super) fn rows<'a>(
    pixels: &'a [u8],
    head: &ImageHead,
    size: usize,
) -> Option<impl Iterator<Item = &'a [u8]> + use<'a>> {
    let (row, step, height) = (head.width as usize * size, head.step, head.height as usize);
    let enough =
        row > 0 && height > 0 && step >= row && step.checked_mul(height - 1)?.checked_add(row)? <= pixels.len();
    enough.then(|| pixels.chunks(step).take(height).map(move |r| &r[..row]))
}

fn depth_image(
    container: &Arc<dyn Container>,
    topic: Topic,
    image: Sighting,
    unit: Option<f32>,
    camera: Option<DepthCamera>,
) -> Load<Measured> {
    let container = Arc::clone(container);
    let place = container.path().join(topic.name.trim_start_matches('/'));
    Box::new(move || {
        let data = container.fetch(&image.location)?;
        let mut bytes = values(&topic, &data);
        let per_unit = 1.0 / unit.filter(|u| *u > 0.0).unwrap_or(1e-3);
        let mut measured = if topic.kind.ends_with("CompressedImage") {
            let parts = header(&topic, &mut bytes).and_then(|_| Ok((bytes.text()?, bytes.block()?)));
            let (format, data) = parts.map_err(|_| short(&place))?;
            ros_depth::compressed(&place, &format, data, per_unit)?
        } else {
            let head = image_head(&topic, &mut bytes).map_err(|_| short(&place))?;
            let pixels = bytes.block().map_err(|_| short(&place))?;
            ros_depth::raw(&place, &head, pixels, per_unit)?
        };
        measured.camera = camera;
        Ok(measured)
    })
}
