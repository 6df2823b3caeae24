//! Frames of a video, decoded by the program ffmpeg.

use super::RecordingError;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;

/// The frames of a video as JPEG files, in order. The folder is removed when the last user is gone.
pub(super) struct VideoFrames {
    folder: tempfile::TempDir,
    /// Number of frames.
    pub(super) count: usize,
}

impl VideoFrames {
    /// Decodes all frames, reduced to `longest_side` pixels, without turning them.
    pub(super) fn decode(video: &Path, longest_side: u32) -> Result<Arc<Self>, RecordingError> {
        let fail = |reason: String| RecordingError::incomplete(video, reason);
        let folder = tempfile::tempdir().map_err(|e| fail(format!("no folder for its frames: {e}")))?;
        let scale = format!(
            "scale=w='if(gte(iw,ih),min(iw,{longest_side}),-2)':h='if(gte(iw,ih),-2,min(ih,{longest_side}))':flags=area"
        );
        let status = Command::new("ffmpeg")
            .args(["-nostdin", "-v", "error", "-noautorotate", "-i"])
            .arg(video)
            .args(["-vf", &scale, "-fps_mode", "passthrough", "-q:v", "2", "-start_number", "0"])
            .arg(folder.path().join("%06d.jpg"))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .output();
        let output = status.map_err(|e| {
            fail(format!(
                "the video needs the program ffmpeg, which cannot be started ({e}); install it, or extract the frames \
                 elsewhere: ffmpeg -noautorotate -i rgb.mp4 -q:v 2 -start_number 0 rgb/%06d.jpg"
            ))
        })?;
        let count = super::files::names(folder.path()).len();
        if !output.status.success() || count == 0 {
            let text = String::from_utf8_lossy(&output.stderr);
            let last = text.lines().last().unwrap_or("no message").to_string();
            return Err(fail(format!("ffmpeg cannot decode the video ({last}); copy or export the recording again")));
        }
        Ok(Arc::new(Self { folder, count }))
    }

    /// File of a frame, counted from 0.
    pub(super) fn path(&self, frame: usize) -> PathBuf {
        self.folder.path().join(format!("{frame:06}.jpg"))
    }
}
