//! The cabinet on disk, in the layout of the ArtGS benchmark.

use super::{Cabinet, CabinetOptions, DEPTH_SCALE, SPLIT_NAMES, SynthError, cabinet_capture};
use artgs_core::{Camera, Capture, Joint, JointKind, Mesh, STATE_NAMES, View};
use image::{ExtendedColorType, ImageFormat};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::fmt::Display;
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

fn write_view(folder: &Path, view: &View) -> Result<(), SynthError> {
    let k = &view.camera.intrinsics;
    let save = |name: &str, bytes: &[u8], color| {
        let path = folder.join(name);
        make_parent(&path)?;
        image::save_buffer_with_format(&path, bytes, k.width, k.height, color, ImageFormat::Png)
            .map_err(|e| failed(&path, e))
    };
    save(&view.name, view.rgba.as_flattened(), ExtendedColorType::Rgba8)?;
    let Some(depth) = &view.depth else { return Ok(()) };
    let steps: Vec<u8> = depth.iter().flat_map(|d| ((d * DEPTH_SCALE as f32).round() as u16).to_ne_bytes()).collect();
    save(&depth_path(view), &steps, ExtendedColorType::L16)
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

/// Camera-to-world with y up and z backward, rows first.
fn opengl_pose(camera: &Camera) -> [[f64; 4]; 4] {
    let pose = camera.world_to_camera.inverse();
    let (r, t) = (pose.matrix(), pose.translation);
    let row = |i: usize| [r.x_axis[i], -r.y_axis[i], -r.z_axis[i], t[i]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
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

fn write_meshes(folder: &Path, cabinet: &Cabinet, state: usize) -> Result<(), SynthError> {
    let name = STATE_NAMES[state];
    let mut whole = Mesh::default();
    for part in 0..cabinet.parts.len() {
        let mesh = cabinet.mesh(part, state);
        let slot = if part == 0 { "static".to_string() } else { format!("dynamic_{}", part - 1) };
        write_mesh(&folder.join(format!("gt/{name}/{name}_{slot}_rotate.ply")), &mesh)?;
        whole.append(&mesh);
    }
    write_mesh(&folder.join(format!("gt/{name}/{name}_rotate.ply")), &whole)
}

fn write_mesh(path: &Path, mesh: &Mesh) -> Result<(), SynthError> {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.vertices.len(),
        mesh.triangles.len()
    );
    let mut bytes = header.into_bytes();
    bytes.extend(mesh.vertices.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
    for triangle in &mesh.triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|i| i.to_le_bytes()));
    }
    write_bytes(path, &bytes)
}

fn write_json(path: &Path, value: &Value) -> Result<(), SynthError> {
    write_bytes(path, format!("{value:#}\n").as_bytes())
}

fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), SynthError> {
    make_parent(path)?;
    std::fs::write(path, bytes).map_err(|e| failed(path, e))
}

fn make_parent(path: &Path) -> Result<(), SynthError> {
    let Some(parent) = path.parent() else { return Ok(()) };
    std::fs::create_dir_all(parent).map_err(|e| failed(parent, e))
}

fn failed(path: &Path, reason: impl Display) -> SynthError {
    SynthError::Write { path: path.to_path_buf(), reason: reason.to_string() }
}
