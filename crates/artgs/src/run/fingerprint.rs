//! Whether a folder was made from a capture.

use super::Error;
use artgs_core::{Capture, View};
use artgs_io::run_folder::RunFolder;
use artgs_io::write_atomic;

/// True if a run's folder was made from this capture; none if it does not record its capture.
pub fn made_from(folder: &RunFolder, capture: &Capture) -> Option<bool> {
    let mark = std::fs::read_to_string(folder.capture_fingerprint()).ok()?;
    Some(mark == fingerprint(capture))
}

/// Records the capture in the folder; refuses to resume a run of another capture.
pub(super) fn claim(folder: &RunFolder, capture: &Capture, resume: bool) -> Result<(), Error> {
    if resume && made_from(folder, capture) == Some(false) {
        return Err(Error::OtherCapture(folder.root().display().to_string()));
    }
    Ok(write_atomic(&folder.capture_fingerprint(), fingerprint(capture).as_bytes())?)
}

/// Differs between captures: names, cameras, and some of the pixels of the training views.
fn fingerprint(capture: &Capture) -> String {
    const PIXELS: usize = 97;
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |bytes: &[u8]| {
        bytes.iter().for_each(|b| hash = (hash ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3));
    };
    let views = capture.states.iter().flat_map(|s| &s.train);
    views.for_each(|view: &View| {
        add(view.name.as_bytes());
        let eye = view.camera.position();
        [eye.x, eye.y, eye.z, view.camera.intrinsics.fx].iter().for_each(|v| add(&v.to_le_bytes()));
        view.rgba.iter().step_by(PIXELS).for_each(|pixel| add(pixel));
        view.depth.iter().for_each(|d| d.counts().iter().step_by(PIXELS).for_each(|c| add(&c.to_le_bytes())));
    });
    format!("{hash:016x}\n")
}
