//! The cabinet on disk, in the layout of the ArtGS benchmark.

use super::{Cabinet, CabinetOptions, DEPTH_SCALE, SPLIT_NAMES, SynthError, cabinet_capture};
use artgs_core::{Capture, Joint, JointKind, Mesh, STATE_NAMES, View};
use artgs_io::capture::opengl_pose;
use artgs_io::image_io::{write_depth, write_rgba};
use artgs_io::{FileError, write_atomic, write_mesh_ply};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::path::Path;

/// Value of `input.generator` in the `gt/trans.json` of a cabinet.
pub const GENERATOR: &str = "artgs cabinet";

/// Photographs the cabinet and writes it into `folder`: images, cameras, and the truth under `gt`.
/// `gt/trans.json` comes last, so that a folder which has it is complete.
pub fn write_cabinet(folder: &Path, options: &CabinetOptions) -> Result<(Capture, Cabinet), SynthError> {
    let (capture, cabinet) = cabinet_capture(options)?;
    for (state, views) in capture.states.iter().enumerate() {
        for (split, views) in [&views.train, &views.test].into_iter().enumerate() {
            if let Some(first) = views.first() {
                views.par_iter().try_for_each(|view| write_view(folder, view))?;
                let name = format!("transforms_{}_{}.json", SPLIT_NAMES[split], STATE_NAMES[state]);
                write_json(&folder.join(name), &transforms(first, views, state))?;
            }
        }
        write_meshes(folder, &cabinet, state)?;
    }
    write_json(&folder.join("gt/trans.json"), &truth(&cabinet, options))?;
    Ok((capture, cabinet))
}

fn depth_path(view: &View) -> String {
    view.name.replace("/rgba/", "/depth/")
}

fn write_view(folder: &Path, view: &View) -> Result<(), FileError> {
    let k = &view.camera.intrinsics;
    write_rgba(&folder.join(&view.name), k.width, k.height, &view.rgba)?;
    let Some(depth) = &view.depth else { return Ok(()) };
    write_depth(&folder.join(depth_path(view)), k.width, k.height, depth)
}

fn transforms(first: &View, views: &[View], state: usize) -> Value {
    let k = &first.camera.intrinsics;
    let angle = |size: u32, focal: f64| 2.0 * (0.5 * f64::from(size) / focal).atan();
    let frame = |view: &View| {
        json!({
            "file_path": view.name,
            "depth_path": depth_path(view),
            "time": state as f64,
            "transform_matrix": opengl_pose(&view.camera),
        })
    };
    json!({
        "camera_angle_x": angle(k.width, k.fx),
        "camera_angle_y": angle(k.height, k.fy),
        "w": k.width, "h": k.height, "fl_x": k.fx, "fl_y": k.fy, "cx": k.cx, "cy": k.cy,
        "depth_scale": DEPTH_SCALE,
        "frames": views.iter().map(frame).collect::<Vec<_>>(),
    })
}

fn truth(cabinet: &Cabinet, options: &CabinetOptions) -> Value {
    let entry = |(index, (joint, name)): (usize, (&Joint, &str))| {
        let (kind, values) = match joint.kind {
            JointKind::Prismatic => ("translate", joint.state_values),
            JointKind::Revolute | JointKind::Screw => ("rotate", joint.state_values.map(f64::to_degrees)),
        };
        json!({
            "axis": { "o": joint.origin.to_array(), "d": joint.axis.to_array() },
            "type": kind,
            kind: { "l": values[0], "r": values[1] },
            "link": name,
            "part_id": index + 2,
        })
    };
    let names = cabinet.parts.iter().filter(|p| p.joint.is_some()).map(|p| p.name);
    let joints: Vec<Value> = cabinet.joints().zip(names).enumerate().map(entry).collect();
    json!({ "input": { "generator": GENERATOR, "options": options }, "trans_info": joints })
}

fn write_meshes(folder: &Path, cabinet: &Cabinet, state: usize) -> Result<(), FileError> {
    let name = STATE_NAMES[state];
    let mut whole = Mesh::default();
    for part in 0..cabinet.parts.len() {
        let mesh = cabinet.mesh(part, state);
        let slot = if part == 0 { "static".to_string() } else { format!("dynamic_{}", part - 1) };
        write_mesh_ply(&folder.join(format!("gt/{name}/{name}_{slot}_rotate.ply")), &mesh)?;
        whole.append(&mesh);
    }
    write_mesh_ply(&folder.join(format!("gt/{name}/{name}_rotate.ply")), &whole)
}

fn write_json(path: &Path, value: &Value) -> Result<(), FileError> {
    write_atomic(path, format!("{value:#}\n").as_bytes())
}
