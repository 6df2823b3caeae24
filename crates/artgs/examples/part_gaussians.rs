//! The Gaussians of one part, in each state.
//!
//! `cargo run --example part_gaussians -- FILE.ply` writes those at the end as 3DGS PLY.

#![allow(clippy::print_stdout, reason = "an example prints")]

use artgs::prelude::*;
use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    const PART: usize = 1;
    let (capture, _) = cabinet_capture(&CabinetOptions { views: 20, size: 96, ..CabinetOptions::default() })?;
    let config =
        Config::default().overridden_by("parts = 3\n[articulate]\nsteps = 60\n[surface]\nresolution = 80.0")?;
    let prepared = Request { config, ..Request::new(Input::Images(capture)) }.prepare(&mut NullObserver)?;
    let made = Reconstruction::new(&prepared).compute(&mut NullObserver)?;
    let canonical = made.part_splats(PART).ok_or("the baseline has no Gaussians")?;
    // From the canonical state, midway between the states, to each of them. Colours turn with the part.
    let half = made.replica.world_motion(PART).power(0.5);
    for state in State::ALL {
        let moved = artgs_raster::moved(&canonical, &half.towards(state), 1.0);
        let sum = moved.means.iter().fold([0.0; 3], |sum, p| [0, 1, 2].map(|a| sum[a] + f64::from(p[a])));
        println!("{}: {} Gaussians around {:.3?}", state.name(), moved.len(), sum.map(|v| v / moved.len() as f64));
        if let Some(file) = std::env::args().nth(1).filter(|_| state == State::END) {
            artgs_io::write_splat_ply(Path::new(&file), &moved, None, state.name())?;
        }
    }
    Ok(())
}
