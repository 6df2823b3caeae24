//! Parts and joints of two states of a random object, and the alignment of two recordings of an object in a room.

use artgs::align::{AlignConfig, align};
use artgs::observer::NullObserver;
use artgs::{Prepared, Reconstruction};
use artgs_core::Capture;
use artgs_synth::population::random_object;
use artgs_synth::recording::Sensor;
use artgs_synth::{CaptureOptions, RecordingCaptureOptions, render_capture, render_recording};
use divan::Bencher;

fn main() {
    divan::main();
}

/// Exact depth, 24 views per state of 240 x 240 pixels.
fn capture(seed: u64) -> Capture {
    let drawn = random_object(seed, 2).expect("an object");
    let options = CaptureOptions { views: 24, test_views: 0, size: 240, ..CaptureOptions::default() };
    render_capture(&drawn.object, &options).expect("a capture")
}

/// A box with a lid, a monitor arm with three joints, a chest with five drawers.
#[divan::bench(args = [11, 5, 7], sample_count = 3)]
fn discovery(bencher: Bencher<'_, '_>, seed: u64) {
    let capture = capture(seed);
    let prepared = Prepared::as_is(capture);
    bencher.bench_local(|| Reconstruction::new(&prepared).find_parts(&mut NullObserver));
}

/// 2 x 40 frames of 320 x 240 pixels.
#[divan::bench(args = [Sensor::Lidar, Sensor::Kinect], sample_count = 3)]
fn alignment(bencher: Bencher<'_, '_>, sensor: Sensor) {
    let options = RecordingCaptureOptions { views: 40, width: 320, sensor, ..RecordingCaptureOptions::default() };
    let (recordings, _) = render_recording("storage2", &options).expect("recordings");
    bencher.bench_local(|| align(&recordings, &AlignConfig::default(), 0));
}
