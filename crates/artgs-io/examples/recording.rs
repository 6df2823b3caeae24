//! Prints what a recording contains: `cargo run --example recording -- PATH [fx,fy,cx,cy] [POSES]`. The environment variable
//! `SIDE` sets the longest side of images.
#![allow(clippy::print_stdout)]

use artgs_core::{RecordedFrame, Recording};
use artgs_io::recording::{RecordingOptions, load_recording, parse_intrinsics};
use glam::DVec2;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some(path) = arguments.first() else {
        return Err("give a folder or file".into());
    };
    let intrinsics = arguments.get(1).filter(|a| !a.is_empty()).map(|a| parse_intrinsics(a)).transpose()?;
    let poses = arguments.get(2).map(PathBuf::from);
    let begin = std::time::Instant::now();
    let recording = load_recording(
        path.as_ref(),
        &RecordingOptions {
            intrinsics,
            poses,
            longest_side: std::env::var("SIDE").map_or(720, |s| s.parse().unwrap_or(720)),
            ..RecordingOptions::default()
        },
    )?;
    println!(
        "{}: {} of {} frames in {:.1} s, up {:?}, metric {}",
        recording.format,
        recording.frames.len(),
        recording.recorded,
        begin.elapsed().as_secs_f64(),
        recording.up,
        recording.metric
    );
    recording.warnings.iter().for_each(|w| println!("warning: {w}"));
    describe(&recording);
    Ok(())
}

fn describe(recording: &Recording) {
    for frame in recording.frames.iter().take(3) {
        let (k, eye) = (frame.view.camera.intrinsics, frame.view.camera.position());
        println!(
            "{}: {}x{}, f {:.1} {:.1}, c {:.1} {:.1}, eye {eye:.3}, time {:?}, depth step {:.2}, {:.0}% with depth",
            frame.view.name,
            k.width,
            k.height,
            k.fx,
            k.fy,
            k.cx,
            k.cy,
            frame.time,
            frame.depth_step,
            100.0 * share_with_depth(frame)
        );
    }
    let mut all: Vec<f64> = recording.frames.windows(2).filter_map(|w| disagreement(&w[0], &w[1])).collect();
    all.sort_by(f64::total_cmp);
    if let [first, .., last] = all.as_slice() {
        let median = all[all.len() / 2];
        println!("depth of consecutive frames differs by {median:.4} in the median pair ({first:.4} to {last:.4})");
    }
}

fn share_with_depth(frame: &RecordedFrame) -> f64 {
    frame.view.depth.as_ref().map_or(0.0, |d| d.iter().filter(|d| *d > 0.0).count() as f64 / d.len() as f64)
}

/// Median distance, along the rays of `b`, between the surfaces that `a` and `b` measured where both see.
fn disagreement(a: &RecordedFrame, b: &RecordedFrame) -> Option<f64> {
    let (from, to) = (a.view.depth.as_ref()?, b.view.depth.as_ref()?);
    let ((w, h), (w2, h2)) = (a.view.size(), b.view.size());
    let mut off = Vec::new();
    for (x, y) in (0..h).step_by(4).flat_map(|y| (0..w).step_by(4).map(move |x| (x, y))) {
        let depth = f64::from(from.at(y * w + x));
        if depth == 0.0 {
            continue;
        }
        let point = a.view.camera.unproject(DVec2::new(x as f64 + 0.5, y as f64 + 0.5), depth);
        let (pixel, expected) = b.view.camera.project(point);
        if expected <= 0.0 || pixel.min_element() < 0.0 || pixel.x >= w2 as f64 || pixel.y >= h2 as f64 {
            continue;
        }
        let seen = f64::from(to.at(pixel.y as usize * w2 + pixel.x as usize));
        if seen > 0.0 && (seen - expected).abs() < 0.2 * expected {
            off.push((seen - expected).abs());
        }
    }
    off.sort_by(f64::total_cmp);
    (off.len() > 50).then(|| off[off.len() / 2])
}
