//! Joints only: discovery without training and meshes, a second or two per capture.
//!
//! `cargo run --example joints_only -- CAPTURE` reads a folder of photos with depth, with two paths the recordings of both states.

#![allow(clippy::print_stdout, reason = "an example prints")]

use artgs::prelude::*;
use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    let input = if paths.is_empty() {
        let options = CabinetOptions { views: 20, size: 120, ..CabinetOptions::default() };
        Input::Images(cabinet_capture(&options)?.0)
    } else {
        Input::new(&paths)?
    };
    let prepared = Request::new(input).prepare(&mut NullObserver)?;
    let found = Reconstruction::new(&prepared).find_parts(&mut NullObserver)?;
    for (i, (part, joint)) in found.parts.iter().zip(found.joints()).enumerate() {
        let confidence = part.confidence.map_or("unknown".into(), |c| format!("{c:.2}"));
        let carrier = if part.parent == 0 { "the static part".into() } else { format!("part {}", part.parent) };
        println!("part {} on {carrier}: {:?} about {:.4} at {:.4}", i + 1, joint.kind, joint.axis, joint.origin);
        println!("  0 to {:.4} between the states, pitch {:.4}, confidence {confidence}", joint.limits[1], joint.pitch);
    }
    found.warnings.iter().for_each(|warning| println!("warning: {warning}"));
    Ok(())
}
