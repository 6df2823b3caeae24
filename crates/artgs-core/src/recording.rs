//! A recording: frames that a phone or a depth camera took of one state, in a world frame of its own.

use crate::View;
use glam::DVec3;

/// Depth confidence of a pixel that the device does not trust. Such depth is removed by readers.
pub const LOW_CONFIDENCE: u8 = 0;

/// One state of an object as a device recorded it. Frames are in the order of recording.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// Name of the format, used in messages.
    pub format: &'static str,
    /// Unit vector opposite to gravity in the recording's world frame, where the format states it.
    pub up: Option<DVec3>,
    /// True if lengths are metres; false if the unit is unknown (structure from motion).
    pub metric: bool,
    /// Selected frames.
    pub frames: Vec<RecordedFrame>,
    /// Frames that the files hold; `frames` are a selection of them.
    pub recorded: usize,
    /// Warnings, one sentence each.
    pub warnings: Vec<String>,
}

/// One frame: a pinhole image without lens distortion, with depth registered to its pixels.
#[derive(Clone, Debug)]
pub struct RecordedFrame {
    /// Image, camera and depth. World frame: that of the recording. Alpha is 255, or the mask if the recording has masks.
    pub view: View,
    /// Time stamp, seconds; none if the format has none.
    pub time: Option<f64>,
    /// Width in image pixels of one measured depth pixel, at least 1: depth of a smaller image was resampled.
    pub depth_step: f64,
}

impl Recording {
    /// True if some frame has a mask, so that alpha separates the object from the background.
    pub fn has_masks(&self) -> bool {
        self.frames.iter().any(|f| f.view.rgba.iter().any(|p| p[3] < crate::capture::OBJECT_ALPHA))
    }

    /// True if every frame has depth.
    pub fn has_depth(&self) -> bool {
        !self.frames.is_empty() && self.frames.iter().all(|f| f.view.depth.is_some())
    }
}
