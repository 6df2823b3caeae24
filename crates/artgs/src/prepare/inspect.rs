//! What an input is, before it is used: a capture, or each recording.

use super::agreement::{load_capture, refusals};
use super::input::require_two;
use super::recordings::few_depths;
use super::viewpoints::Viewpoints;
use super::{Input, PrepareError, RecordingFiles, memory};
use crate::consistency::{Consistency, Finding, StateConsistency, check_capture, check_recording};
use artgs_core::{Capture, Recording};
use artgs_io::capture::{ImageSizes, image_sizes};
use artgs_io::recording::load_recording;
use artgs_io::summary::cameras_of;
use artgs_io::{CaptureOptions, CaptureSummary};
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};

/// What a run does with a capture of which a training view has no depth.
pub(crate) const RENDERED_DEPTH: &str = "not every training view has depth: parts are found from depth that Gaussians render, which takes longer and errs more";

/// What is said about a capture or a recording; as text and as JSON.
#[derive(Debug, Serialize)]
pub struct Inspected {
    #[serde(skip)]
    path: PathBuf,
    #[serde(flatten)]
    what: What,
}

#[derive(Debug, Serialize)]
#[serde(untagged)]
enum What {
    Capture {
        #[serde(flatten)]
        summary: Box<CaptureSummary>,
        consistency: Box<Consistency>,
        /// Of both states together; null where the cameras look at no point.
        viewpoints: Option<Viewpoints>,
        /// Predicted peak of a run, bytes.
        memory_bytes: u64,
    },
    Recording {
        #[serde(flatten)]
        summary: Box<RecordingSummary>,
        consistency: Box<StateConsistency>,
        /// Why it has too little depth.
        #[serde(skip)]
        few_depths: Option<String>,
    },
}

/// Describes a capture, or each of two recordings.
pub fn inspect(input: &Input) -> Result<Vec<Inspected>, PrepareError> {
    match input {
        Input::Capture(folder) => {
            let capture = load_capture(folder, &CaptureOptions::default())?;
            // The images are larger in their files.
            let sizes = image_sizes(folder).unwrap_or_default();
            Ok(vec![Inspected::capture(folder, &capture, &sizes)])
        }
        Input::Images(capture) => Ok(vec![Inspected::capture(Path::new(""), capture, &memory::sizes_of(capture))]),
        Input::Recordings(files) => {
            let inspected = files.iter().map(Inspected::recording).collect::<Result<_, _>>()?;
            require_two(files)?;
            Ok(inspected)
        }
    }
}

impl Inspected {
    fn capture(path: &Path, capture: &Capture, sizes: &ImageSizes) -> Self {
        let (mut summary, consistency) = (Box::new(artgs_io::summarize(capture)), check_capture(capture).into());
        let mut views = capture.states.iter().flat_map(|state| &state.train);
        summary.warnings.extend(views.any(|view| view.depth.is_none()).then(|| RENDERED_DEPTH.into()));
        let cameras = capture.states.iter().flat_map(|state| cameras_of(&state.train));
        let viewpoints = Viewpoints::of(cameras, capture.up.map(|up| up.direction));
        let what = What::Capture { summary, consistency, viewpoints, memory_bytes: memory::unlimited(sizes) };
        Self { path: path.into(), what }
    }

    /// The description of one recording.
    pub fn recording(files: &RecordingFiles) -> Result<Self, PrepareError> {
        let recording = load_recording(&files.path, &files.options)?;
        let consistency = check_recording(recording.frames.iter().map(|f| &f.view));
        let few_depths = few_depths(&files.path, &recording);
        let summary = RecordingSummary::new(&recording).into();
        let what = What::Recording { summary, consistency: consistency.into(), few_depths };
        Ok(Self { path: files.path.clone(), what })
    }

    /// Where it is; empty for images in memory.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// True for a capture of both states.
    pub fn is_capture(&self) -> bool {
        matches!(self.what, What::Capture { .. })
    }

    /// Why a recording, which can be shown, has too little depth to be reconstructed from, if it has.
    fn few_depths(&self) -> Option<&str> {
        match &self.what {
            What::Capture { .. } => None,
            What::Recording { few_depths, .. } => few_depths.as_deref()?.lines().next(),
        }
    }

    /// Number of warnings.
    pub fn warnings(&self) -> usize {
        let own = match &self.what {
            What::Capture { summary, .. } => summary.warnings.len(),
            What::Recording { summary, .. } => summary.warnings.len(),
        };
        own + self.findings().iter().filter(|finding| matches!(finding, Finding::Warning(_))).count()
    }

    /// Why a run refuses it; empty if none does.
    pub fn refusals(&self) -> Vec<String> {
        refusals(&self.findings()).chain(self.few_depths()).map(String::from).collect()
    }

    fn findings(&self) -> Vec<Finding> {
        match &self.what {
            What::Capture { consistency, .. } => consistency.findings(),
            What::Recording { consistency, .. } => consistency.findings(&self.path.display().to_string()),
        }
    }
}

/// What it is and the warnings, without what a run refuses it for.
impl fmt::Display for Inspected {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        fn line(f: &mut fmt::Formatter, name: &str, share: Option<f64>, of_what: &str) -> fmt::Result {
            share.map_or(Ok(()), |share| writeln!(f, "{name:<18}{:.0} % {of_what}", 100.0 * share))
        }
        match &self.what {
            What::Capture { summary, consistency, viewpoints, .. } => {
                summary.fmt(f)?;
                viewpoints.map_or(Ok(()), |from| writeln!(f, "cameras           {from}"))?;
                for (state, own) in consistency.states.enumerate() {
                    let name = format!("agreement {}", state.name());
                    line(f, &name, own.agreement, "of the depth points agree between views")?;
                }
                line(f, "agreement of both", consistency.across, "of the surfaces agree between the states")?;
            }
            What::Recording { summary, consistency, .. } => {
                summary.fmt(f)?;
                line(f, "agreement", consistency.agreement, "of the depth points agree between frames")?;
            }
        }
        for finding in self.findings() {
            if let Finding::Warning(text) = finding {
                writeln!(f, "warning: {text}")?;
            }
        }
        match &self.what {
            What::Capture { memory_bytes, .. } => {
                writeln!(f, "memory            about {} to reconstruct", memory::size(*memory_bytes as f64))
            }
            What::Recording { .. } => Ok(()),
        }
    }
}

/// What is said about a recording.
#[derive(Debug, Serialize)]
struct RecordingSummary {
    format: &'static str,
    recorded: usize,
    kept: usize,
    image_size: [usize; 2],
    focal_length: [f64; 2],
    depth_frames: usize,
    depth_step: f64,
    /// Share of pixels with depth, 0 to 1.
    depth_share: f64,
    masks: bool,
    metric: bool,
    up: Option<[f64; 3]>,
    /// Length of the camera's path, scene units.
    path: f64,
    /// Null where the camera looks at no point.
    viewpoints: Option<Viewpoints>,
    warnings: Vec<String>,
}

impl RecordingSummary {
    fn new(recording: &Recording) -> Self {
        let first = recording.frames.first().map(|f| &f.view);
        let depths = || recording.frames.iter().filter_map(|f| f.view.depth.as_ref());
        let pixels: usize = depths().map(|d| d.len()).sum();
        let valid: usize = depths().map(|d| d.counts().iter().filter(|c| **c > 0).count()).sum();
        let eyes = recording.frames.iter().map(|f| f.view.camera.position());
        let path = eyes.clone().zip(eyes.skip(1)).map(|(a, b)| a.distance(b)).sum();
        Self {
            format: recording.format,
            recorded: recording.recorded,
            kept: recording.frames.len(),
            image_size: first.map_or([0, 0], |v| v.size().into()),
            focal_length: first.map_or([0.0; 2], |v| [v.camera.intrinsics.fx, v.camera.intrinsics.fy]),
            depth_frames: depths().count(),
            depth_step: recording.frames.first().map_or(1.0, |f| f.depth_step),
            depth_share: valid as f64 / pixels.max(1) as f64,
            masks: recording.has_masks(),
            metric: recording.metric,
            up: recording.up.map(|u| u.to_array()),
            path,
            viewpoints: Viewpoints::of(recording.frames.iter().map(|f| &f.view.camera), recording.up),
            warnings: recording.warnings.clone(),
        }
    }
}

impl fmt::Display for RecordingSummary {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let ([w, h], [fx, fy]) = (self.image_size, self.focal_length);
        writeln!(f, "format        {}", self.format)?;
        writeln!(f, "frames        {} of {} recorded", self.kept, self.recorded)?;
        writeln!(f, "images        {w}x{h}, focal length {fx:.1} x {fy:.1} pixels")?;
        match self.depth_frames {
            0 => writeln!(f, "depth         none")?,
            n => writeln!(
                f,
                "depth         in {n} frames, on {:.1} % of the pixels, one measurement per {:.1} pixels",
                100.0 * self.depth_share,
                self.depth_step
            )?,
        }
        writeln!(
            f,
            "masks         {}",
            if self.masks { "yes" } else { "no; the object is selected by what the cameras look at" }
        )?;
        writeln!(f, "unit          {}", if self.metric { "metres" } else { "unknown" })?;
        match self.up {
            Some([x, y, z]) => writeln!(f, "up            ({x:.2}, {y:.2}, {z:.2})")?,
            None => writeln!(f, "up            not stated")?,
        }
        writeln!(f, "camera path   {:.2} long", self.path)?;
        self.viewpoints.map_or(Ok(()), |from| writeln!(f, "cameras       {from}"))?;
        self.warnings.iter().try_for_each(|w| writeln!(f, "warning: {w}"))
    }
}
