//! Meshes of all parts at any joint value, one PLY file per part and pose.
//!
//! `cargo run --example posed_meshes -- FOLDER` writes into a folder; a temporary one if absent.

#![allow(clippy::print_stdout, reason = "an example prints")]

use artgs::prelude::*;
use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let temporary = tempfile::tempdir()?;
    let folder = std::env::args().nth(1).map_or(temporary.path().to_path_buf(), PathBuf::from);
    let (capture, _) = cabinet_capture(&CabinetOptions { views: 24, size: 120, ..CabinetOptions::default() })?;
    // The baseline trains no Gaussians: seconds instead of minutes.
    let mut config = Config { parts: 3.into(), ..Config::registration() };
    config.surface.resolution = 120.0;
    let prepared = Request { config, ..Request::new(Input::Images(capture)) }.prepare(&mut NullObserver)?;
    let made = Reconstruction::new(&prepared).compute(&mut NullObserver)?;
    for step in 0..=4 {
        let share = f64::from(step) / 4.0;
        // Index 0 is the static part, whose value is ignored.
        let value = |part: usize| made.replica.joint(part).map_or(0.0, |joint| share * joint.limits[1]);
        let values: Vec<f64> = (0..made.replica.parts.len()).map(value).collect();
        for (part, mesh) in made.posed_meshes(&values).iter().enumerate() {
            artgs_io::write_mesh_ply(&folder.join(format!("pose_{step}_part_{part}.ply")), mesh)?;
        }
        println!("pose {step}: joint values {:.3?}", &values[1..]);
    }
    Ok(())
}
