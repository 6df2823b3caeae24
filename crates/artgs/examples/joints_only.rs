//! Joints only: discovery without training and meshes, a second or two per capture.
//!
//! `cargo run --example joints_only -- CAPTURE` reads a folder of photos with depth.

#![allow(clippy::print_stdout, reason = "an example prints")]

use artgs::Reconstruction;
use artgs::observer::NullObserver;
use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let capture = match std::env::args().nth(1) {
        Some(folder) => artgs_io::load_capture(Path::new(&folder))?,
        None => cabinet_capture(&CabinetOptions { views: 20, size: 120, ..CabinetOptions::default() })?.0,
    };
    let found = Reconstruction::new(&capture).find_parts(&mut NullObserver)?;
    for (i, (part, joint)) in found.parts.iter().zip(found.joints()).enumerate() {
        let confidence = part.confidence.map_or("unknown".into(), |c| format!("{c:.2}"));
        let carrier = if part.parent == 0 { "the static part".into() } else { format!("part {}", part.parent) };
        println!("part {} on {carrier}: {:?} about {:.4} at {:.4}", i + 1, joint.kind, joint.axis, joint.origin);
        println!("  0 to {:.4} between the states, pitch {:.4}, confidence {confidence}", joint.limits[1], joint.pitch);
    }
    found.warnings.iter().for_each(|warning| println!("warning: {warning}"));
    Ok(())
}
