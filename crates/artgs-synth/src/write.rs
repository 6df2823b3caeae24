//! Captures on disk, in the layouts of the ArtGS and PARIS benchmarks, with their ground truth.

use crate::render::{PlannedView, Renderer};
use crate::replace::replace;
use crate::{CaptureOptions, Object, SynthError, object};
use artgs_core::{Camera, Joint, JointKind, Mesh, State, View};
use artgs_io::capture::opengl_pose;
use artgs_io::image_io::{write_depth, write_gray, write_rgba};
use artgs_io::{FileError, write_atomic, write_mesh_ply};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Depth images count in this many steps per scene unit.
pub(crate) const DEPTH_SCALE: f64 = 1000.0;
/// Names of the splits, as files spell them.
pub(crate) const SPLIT_NAMES: [&str; 2] = ["train", "test"];
/// File that marks folders written by this module, and whether they are complete.
pub(crate) const MARKER: &str = "synth.json";
/// Value of `input.generator` in the `gt/trans.json` of an object.
pub(crate) const GENERATOR: &str = "artgs synth";

/// How the files of a capture are laid out. Both can hold the same capture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// `transforms_{split}_{state}.json` and `{state}/{split}/rgba`.
    #[default]
    ArtGs,
    /// `{state}/camera_{split}.json` and `{state}/{split}`.
    Paris,
}

impl Layout {
    /// Path of a colour image, relative to the capture.
    pub(crate) fn image(self, state: &str, split: &str, index: usize) -> String {
        match self {
            Self::ArtGs => format!("{state}/{split}/rgba/{index:04}.png"),
            Self::Paris => format!("{state}/{split}/{index:04}.png"),
        }
    }

    fn camera_file(self, state: &str, split: &str) -> String {
        match self {
            Self::ArtGs => format!("transforms_{split}_{state}.json"),
            Self::Paris => format!("{state}/camera_{split}.json"),
        }
    }
}

/// What a folder made by [`write_object`] holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaptureInfo {
    /// Name of the object.
    pub object: String,
    /// Number of its parts, the static part included: the value for `--parts`.
    pub parts: usize,
    /// How it was rendered.
    pub options: CaptureOptions,
    /// False while it is being written.
    pub complete: bool,
}

/// The marker of a folder that [`write_object`] wrote or began to write; None for any other folder.
pub fn capture_info(folder: &Path) -> Option<CaptureInfo> {
    serde_json::from_slice(&std::fs::read(folder.join(MARKER)).ok()?).ok()
}

/// Renders the object of this name and writes the capture into `folder`, the ground truth under `gt`. An earlier capture of
/// this function in `folder` is kept if it is complete and has the same options, else replaced; other files do not change,
/// and are refused where they are in the way.
/// The marker that [`capture_info`] reads is `complete` only once all files are written.
pub fn write_object(name: &str, options: &CaptureOptions, folder: &Path) -> Result<CaptureInfo, SynthError> {
    options.check()?;
    let object = object(name, options.seed)?;
    let marker = |complete| CaptureInfo { object: name.into(), parts: object.parts.len(), options: *options, complete };
    if capture_info(folder) == Some(marker(true)) {
        return Ok(marker(true));
    }
    replace(folder, |complete| json!(marker(complete)), |new| write_files(&object, options, new))?;
    Ok(marker(true))
}

/// Writes everything but the marker.
fn write_files(object: &Object, options: &CaptureOptions, folder: &Path) -> Result<(), SynthError> {
    write_views(object, options, StatePair(0), &State::ALL, folder)?;
    let input = json!({ "generator": GENERATOR, "object": object.name, "options": options });
    Ok(write_json(&folder.join("gt/trans.json"), &ground_truth(object, input))?)
}

/// Two states of an object, by the number of the first one among all its states.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StatePair(pub(crate) usize);

impl StatePair {
    /// Number of a state among all.
    pub(crate) fn number(self, state: State) -> usize {
        self.0 + state.index()
    }

    /// Name of a state in paths: `start`, `end`, `state_2`, ...
    pub(crate) fn name(self, state: State) -> String {
        match State::from_index(self.number(state)) {
            Some(state) => state.name().into(),
            None => format!("state_{}", self.number(state)),
        }
    }
}

/// Writes images, cameras, true masks and meshes of some states of a pair. Returns for every state that was
/// written the number of depth pixels of all training views that show each part.
pub(crate) fn write_views(
    object: &Object,
    options: &CaptureOptions,
    pair: StatePair,
    states: &[State],
    folder: &Path,
) -> Result<Vec<Vec<usize>>, SynthError> {
    let renderer = Renderer::with_names(object, options, pair);
    let views: Vec<&PlannedView> = renderer.planned_views.iter().filter(|view| states.contains(&view.state)).collect();
    let counts = views
        .par_iter()
        .map(|planned| write_rendered(folder, &renderer, planned, &pair.name(planned.state), object.parts.len()));
    let counts: Vec<Vec<usize>> = counts.collect::<Result<_, _>>()?;
    let mut seen = Vec::new();
    for &state in states {
        for (split, split_name) in SPLIT_NAMES.into_iter().enumerate() {
            let of_split = |planned: &&&PlannedView| (planned.state, planned.split) == (state, split);
            let frames: Vec<(&str, &Camera)> =
                views.iter().filter(of_split).map(|s| (s.name.as_str(), &s.stated)).collect();
            if !frames.is_empty() {
                let value = match options.layout {
                    Layout::ArtGs => transforms(&frames, pair.number(state), !options.degradation.no_depth),
                    Layout::Paris => paris_cameras(&frames),
                };
                write_json(&folder.join(options.layout.camera_file(&pair.name(state), split_name)), &value)?;
            }
        }
        let meshes: Vec<Mesh> = (0..object.parts.len()).map(|part| object.mesh(part, state)).collect();
        write_meshes(folder, &meshes, &pair.name(state))?;
        let of_state = views.iter().zip(&counts).filter(|(view, _)| (view.state, view.split) == (state, 0));
        seen.push(
            of_state.fold(vec![0; object.parts.len()], |sum, (_, n)| sum.iter().zip(n).map(|(a, b)| a + b).collect()),
        );
    }
    Ok(seen)
}

/// Writes a view; returns how many of its pixels show each of some parts.
fn write_rendered(
    folder: &Path,
    renderer: &Renderer,
    planned: &PlannedView,
    state: &str,
    parts: usize,
) -> Result<Vec<usize>, FileError> {
    let (view, labels) = renderer.render(planned);
    write_view(folder, &view)?;
    let k = &view.camera.intrinsics;
    let (split, index) = (SPLIT_NAMES[planned.split], planned.index);
    let path = folder.join(format!("gt/part_masks/{state}/{split}/{index:04}.png"));
    write_gray(&path, k.width, k.height, &labels)?;
    Ok(count_labels(&labels, parts))
}

/// How many labels are 1 (part 0), 2 (part 1) and so on.
pub(crate) fn count_labels(labels: &[u8], parts: usize) -> Vec<usize> {
    let mut counts = vec![0; parts];
    for label in labels {
        if let Some(count) = usize::from(*label).checked_sub(1).and_then(|part| counts.get_mut(part)) {
            *count += 1;
        }
    }
    counts
}

/// The depth image of a colour image: in a folder `depth` in place of `rgba`, or in one beside the colour images.
fn depth_path(name: &str) -> String {
    match name.rsplit_once('/') {
        _ if name.contains("/rgba/") => name.replace("/rgba/", "/depth/"),
        Some((folder, file)) => format!("{folder}/depth/{file}"),
        None => format!("depth/{name}"),
    }
}

/// Writes the images of a view.
pub(crate) fn write_view(folder: &Path, view: &View) -> Result<(), FileError> {
    let k = &view.camera.intrinsics;
    write_rgba(&folder.join(&view.name), k.width, k.height, &view.rgba)?;
    let Some(depth) = &view.depth else { return Ok(()) };
    write_depth(&folder.join(depth_path(&view.name)), k.width, k.height, depth)
}

/// `transforms_{split}_{state}.json` for images and their cameras, at least one; `state` is its number.
pub(crate) fn transforms(frames: &[(&str, &Camera)], state: usize, has_depth: bool) -> Value {
    let k = &frames[0].1.intrinsics;
    let angle = |size: u32, focal: f64| 2.0 * (0.5 * f64::from(size) / focal).atan();
    let frame = |(name, camera): &(&str, &Camera)| {
        let mut frame = json!({
            "file_path": name,
            "time": state as f64,
            "transform_matrix": opengl_pose(camera),
        });
        if has_depth {
            frame["depth_path"] = depth_path(name).into();
        }
        frame
    };
    json!({
        "camera_angle_x": angle(k.width, k.fx),
        "camera_angle_y": angle(k.height, k.fy),
        "w": k.width, "h": k.height, "fl_x": k.fx, "fl_y": k.fy, "cx": k.cx, "cy": k.cy,
        "depth_scale": DEPTH_SCALE,
        "frames": frames.iter().map(frame).collect::<Vec<_>>(),
    })
}

/// `{state}/camera_{split}.json`: intrinsics and a pose per image.
fn paris_cameras(frames: &[(&str, &Camera)]) -> Value {
    let k = &frames[0].1.intrinsics;
    let mut cameras = Map::new();
    cameras.insert("K".into(), json!([[k.fx, 0.0, k.cx], [0.0, k.fy, k.cy], [0.0, 0.0, 1.0]]));
    for (name, camera) in frames {
        let id = Path::new(name).file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        cameras.insert(id, json!(opengl_pose(camera)));
    }
    Value::Object(cameras)
}

/// One entry of `trans_info`; `part_id` is what part masks hold.
pub(crate) fn joint_entry(joint: &Joint, name: &str, part_id: usize) -> Value {
    let degrees = joint.state_values.map(f64::to_degrees);
    let (kind, values) = match joint.kind {
        JointKind::Prismatic => {
            ("translate", json!({ "l": joint.state_values[State::START], "r": joint.state_values[State::END] }))
        }
        JointKind::Revolute => ("rotate", json!({ "l": degrees[State::START], "r": degrees[State::END] })),
        JointKind::Screw => {
            ("screw", json!({ "l": degrees[State::START], "r": degrees[State::END], "pitch": joint.pitch }))
        }
    };
    json!({
        "axis": { "o": joint.origin.to_array(), "d": joint.axis.to_array() },
        "type": kind,
        kind: values,
        "link": name,
        "part_id": part_id,
    })
}

/// `gt/trans.json`; `input` says what was rendered.
pub(crate) fn ground_truth(object: &Object, input: Value) -> Value {
    let mut joints = Vec::new();
    for (index, part) in object.parts.iter().enumerate() {
        let Some(joint) = object.world_joint(index) else { continue };
        let mut entry = joint_entry(&joint, &part.name, index + 1);
        if let Some(parent) = part.parent.filter(|p| *p > 0) {
            entry["parent"] = (parent + 1).into();
        }
        joints.push(entry);
    }
    json!({ "input": input, "trans_info": joints })
}

/// Writes the ground-truth meshes of a state of this name, the static part first.
pub(crate) fn write_meshes(folder: &Path, parts: &[Mesh], name: &str) -> Result<(), FileError> {
    let mut whole = Mesh::default();
    for (part, mesh) in parts.iter().enumerate() {
        let slot = if part == 0 { "static".to_string() } else { format!("dynamic_{}", part - 1) };
        write_mesh_ply(&folder.join(format!("gt/{name}/{name}_{slot}_rotate.ply")), mesh)?;
        whole.append(mesh);
    }
    write_mesh_ply(&folder.join(format!("gt/{name}/{name}_rotate.ply")), &whole)
}

pub(crate) fn write_json(path: &Path, value: &Value) -> Result<(), FileError> {
    write_atomic(path, format!("{value:#}\n").as_bytes())
}
