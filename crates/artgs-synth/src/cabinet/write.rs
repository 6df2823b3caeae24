//! The cabinet on disk, in the layout of the ArtGS benchmark.

use super::{Cabinet, CabinetOptions, cabinet_capture};
use crate::SynthError;
use crate::write::{SPLIT_NAMES, joint_entry, transforms, write_json, write_meshes, write_view};
use artgs_core::{Camera, Capture, Mesh};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::path::Path;

/// Value of `input.generator` in the `gt/trans.json` of a cabinet.
pub const GENERATOR: &str = "artgs cabinet";

/// Renders the cabinet and writes the capture into `folder`: images, cameras, and the ground truth under `gt`.
/// `gt/trans.json` is written last, so that a folder with it is complete.
pub fn write_cabinet(folder: &Path, options: &CabinetOptions) -> Result<(Capture, Cabinet), SynthError> {
    let (capture, cabinet) = cabinet_capture(options)?;
    for (state, views) in capture.states.enumerate() {
        for (split, views) in [&views.train, &views.test].into_iter().enumerate() {
            views.par_iter().try_for_each(|view| write_view(folder, view))?;
            let frames: Vec<(&str, &Camera)> = views.iter().map(|v| (v.name.as_str(), &v.camera)).collect();
            if !frames.is_empty() {
                let name = format!("transforms_{}_{}.json", SPLIT_NAMES[split], state.name());
                write_json(&folder.join(name), &transforms(&frames, state.index(), true))?;
            }
        }
        let meshes: Vec<Mesh> = (0..cabinet.parts.len()).map(|part| cabinet.mesh(part, state)).collect();
        write_meshes(folder, &meshes, state.name())?;
    }
    write_json(&folder.join("gt/trans.json"), &ground_truth(&cabinet, options))?;
    Ok((capture, cabinet))
}

fn ground_truth(cabinet: &Cabinet, options: &CabinetOptions) -> Value {
    let names = cabinet.parts.iter().filter(|p| p.joint.is_some()).map(|p| p.name);
    let joints = cabinet.joints().zip(names).enumerate();
    let joints: Vec<Value> = joints.map(|(index, (joint, name))| joint_entry(joint, name, index + 2)).collect();
    json!({ "input": { "generator": GENERATOR, "options": options }, "trans_info": joints })
}
