//! How well renderings of a finished replica, whose Gaussians are moved by its joints, agree with the held-out photos of
//! both states.

use super::flip::{PIXELS_PER_DEGREE, flip};
use super::lpips::Lpips;
use crate::articulation::Trained;
use crate::articulation::{MotionModel, MotionParameters};
use crate::config::Config;
use crate::fit::images::Rect;
use crate::fit::score::{over_black, psnr};
use crate::fit::ssim::Ssim;
use crate::settings::ConfigError;
use artgs_core::{Capture, Replica, State, View};
use artgs_io::replica::ReplicaFileError;
use artgs_io::{FileError, RunFolder};
use artgs_raster::{Frame, Rasterizer};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Why pictures could not be scored.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// `replica.json` cannot be used.
    #[error(transparent)]
    Replica(#[from] ReplicaFileError),
    /// Gaussians or settings cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The settings of the run cannot be used.
    #[error("{path}: {source}")]
    Settings {
        /// The file.
        path: String,
        /// What is wrong.
        source: ConfigError,
    },
}

/// Means over the held-out views of a state, pictures over black.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PictureScores {
    /// Peak signal-to-noise ratio, dB.
    pub psnr: f64,
    /// Structural similarity, at most 1.
    pub ssim: f64,
    /// Visible difference, [0, 1], at 67 pixels per degree.
    pub flip: f64,
    /// Distance of deep features, at least 0; none without weights or if a picture is too small for the network.
    pub lpips: Option<f64>,
    /// Number of views.
    pub views: usize,
}

impl PictureScores {
    /// Means weighted by views; none for none. LPIPS only where all have it.
    pub fn mean_of(scores: &[Self]) -> Option<Self> {
        let views: usize = scores.iter().map(|s| s.views).sum();
        let mean =
            |f: &dyn Fn(&Self) -> f64| scores.iter().map(|s| f(s) * s.views as f64).sum::<f64>() / views.max(1) as f64;
        let all = scores.iter().all(|s| s.lpips.is_some());
        (views > 0).then(|| Self {
            psnr: mean(&|s| s.psnr),
            ssim: mean(&|s| s.ssim),
            flip: mean(&|s| s.flip),
            lpips: all.then(|| mean(&|s| s.lpips.unwrap_or_default())),
            views,
        })
    }
}

/// Scores of both states as a report of their own, for captures without known joints. Its `Display` is a table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PictureReport {
    /// Start and end; none without held-out views, or without Gaussians.
    pub pictures: [Option<PictureScores>; 2],
}

impl fmt::Display for PictureReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:<8} {:>9} {:>9} {:>9} {:>9} {:>9}", "pictures", "PSNR dB", "SSIM", "FLIP", "LPIPS", "views")?;
        let found: Vec<PictureScores> = self.pictures.into_iter().flatten().collect();
        let rows = State::ALL
            .map(State::name)
            .into_iter()
            .zip(self.pictures)
            .chain([("mean", PictureScores::mean_of(&found))]);
        for (name, scores) in rows {
            let Some(s) = scores else {
                write!(f, "\n{name:<8} {:>9} {:>9} {:>9} {:>9} {:>9}", "-", "-", "-", "-", 0)?;
                continue;
            };
            let lpips = s.lpips.map_or_else(|| "-".into(), |v| format!("{v:.4}"));
            write!(f, "\n{name:<8} {:>9.2} {:>9.4} {:>9.4} {lpips:>9} {:>9}", s.psnr, s.ssim, s.flip, s.views)?;
        }
        Ok(())
    }
}

/// Scores the held-out views of start and end of `capture` against renderings of the replica in a run's folder, at full
/// size. None for a state without held-out views and for a replica without Gaussians. PSNR and SSIM are those of
/// `metrics.json` where the joints hold all of the trained motion, which those of `--preset paper` do not.
pub fn score_replica(
    folder: &RunFolder,
    capture: &Capture,
    lpips: Option<&Lpips>,
) -> Result<[Option<PictureScores>; 2], PictureError> {
    let replica = artgs_io::read_replica(folder.root())?;
    if !folder.has_splats() {
        return Ok([None, None]);
    }
    let trained = load(folder, &replica)?;
    let rotate_sh = settings(folder)?.articulate.rotate_sh;
    let mut rasterizer = Rasterizer::new();
    Ok(State::ALL.map(|state| {
        let posed = trained.posed(state);
        let score = |view: &View| score_view(posed.render(&mut rasterizer, &view.camera, rotate_sh), view, lpips);
        let scores: Vec<PictureScores> = capture.states[state].test.iter().map(score).collect();
        PictureScores::mean_of(&scores)
    }))
}

/// The settings of the run in a folder; the default ones if it has none.
fn settings(folder: &RunFolder) -> Result<Config, PictureError> {
    let Some(text) = folder.load_config()? else { return Ok(Config::default()) };
    let path = || folder.config().display().to_string();
    Config::default().overridden_by(&text).map_err(|source| PictureError::Settings { path: path(), source })
}

/// Gaussians with the motions that the replica's joints give.
fn load(folder: &RunFolder, replica: &Replica) -> Result<Trained, PictureError> {
    let (splats, labels) = folder.load_splats()?;
    let parts = replica.parts.len();
    if let Some(label) = labels.iter().find(|l| usize::from(**l) >= parts) {
        let reason = format!("a Gaussian belongs to part {label}, but the replica has {parts} parts");
        return Err(FileError::malformed(&folder.canonical_splats(), reason).into());
    }
    let motion = |part| MotionParameters::from_motion(MotionModel::Free, &replica.world_motion(part));
    Ok(Trained { splats, labels, joints: (1..parts).map(motion).collect() })
}

fn score_view(frame: &Frame, view: &View, lpips: Option<&Lpips>) -> PictureScores {
    let picture: Vec<f32> = frame.rgb.iter().map(|v| v.clamp(0.0, 1.0)).collect();
    let (truth, (w, h)) = (over_black(view), view.size());
    let mut unused = vec![0.0; picture.len()];
    PictureScores {
        psnr: psnr(&picture, &truth),
        ssim: Ssim::new().evaluate(&picture, &truth, (w, h), Rect::full(w, h), 0.0, &mut unused),
        flip: flip(&truth, &picture, w, h, PIXELS_PER_DEGREE),
        lpips: lpips.and_then(|l| l.distance(&truth, &picture, w, h)),
        views: 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{Camera, Intrinsics, Joint, JointKind, Rigid, Splats};
    use artgs_io::{write_atomic, write_replica, write_splat_ply};
    use glam::DVec3;

    const SIZE: u32 = 48;

    /// A row of blobs on the static part and a row on a hinged one, midway between the states.
    fn scene() -> (Splats, Vec<u16>, Joint) {
        let hinge = Rigid::about(DVec3::Z, DVec3::new(0.0, 0.4, 0.0), 1.2);
        let mut splats = Splats { sh_degree: 0, ..Splats::default() };
        let labels: Vec<u16> = (0..16).map(|i| i / 8).collect();
        for (i, label) in labels.iter().enumerate() {
            let x = (i % 8) as f32 * 0.12 - 0.4;
            splats.means.push([x, 0.4 * f32::from(*label) - 0.2, 0.0]);
            splats.rotations.push([1.0, 0.0, 0.0, 0.0]);
            splats.log_scales.push([-2.8; 3]);
            splats.logit_opacities.push(3.0);
            splats.sh.extend([1.5 - 0.2 * (i % 8) as f32, 0.3, -0.5 + 0.2 * (i % 8) as f32]);
        }
        (splats, labels, Joint::from_motion(JointKind::Revolute, &hinge))
    }

    fn camera() -> Camera {
        let f = f64::from(SIZE);
        let intrinsics = Intrinsics { fx: f, fy: f, cx: f / 2.0, cy: f / 2.0, width: SIZE, height: SIZE };
        Camera::look_at(intrinsics, DVec3::new(0.1, -0.2, 1.7), DVec3::ZERO, DVec3::Y)
    }

    /// A rendering of the blobs moved by hand.
    fn rendered(state: State) -> View {
        let (mut splats, labels, joint) = scene();
        let half = joint.motion(joint.state_values[State::END] * if state == State::END { 0.5 } else { -0.5 });
        for (mean, label) in splats.means.iter_mut().zip(&labels) {
            if *label == 1 {
                *mean = half.apply(DVec3::from_array(mean.map(f64::from))).as_vec3().to_array();
            }
        }
        let mut rasterizer = Rasterizer::new();
        let frame = crate::fit::render_view(&mut rasterizer, &splats, &camera());
        let n = frame.alpha.len();
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        let rgba = (0..n).map(|i| [byte(frame.rgb[i]), byte(frame.rgb[n + i]), byte(frame.rgb[2 * n + i]), 255]);
        View { name: "test".into(), camera: camera(), rgba: rgba.collect(), depth: None, derived: None }
    }

    fn capture() -> Capture {
        let mut capture = Capture::default();
        for state in State::ALL {
            capture.states[state].test = vec![rendered(state); 2];
        }
        capture
    }

    fn replica(labels: Option<&[u16]>) -> (tempfile::TempDir, RunFolder) {
        let (splats, _, joint) = scene();
        let dir = tempfile::tempdir().unwrap();
        let replica = Replica::new(&[joint]);
        for mesh in replica.parts.iter().map(|p| &p.meshes).chain([&replica.whole]) {
            mesh.iter().for_each(|path| write_atomic(&dir.path().join(path), b"").unwrap());
        }
        write_replica(dir.path(), &replica).unwrap();
        let folder = RunFolder::new(dir.path());
        write_splat_ply(&folder.canonical_splats(), &splats, labels, "canonical").unwrap();
        (dir, folder)
    }

    #[test]
    fn renderings_of_a_replica_agree_with_both_states() {
        let (capture, (_, labels, _)) = (capture(), scene());
        let (_dir, folder) = replica(Some(&labels));
        for scores in score_replica(&folder, &capture, None).unwrap() {
            let s = scores.unwrap();
            // Rounding to bytes leaves 10 log10(12 * 255^2) dB where nothing is black.
            assert!(s.psnr > 58.0 && s.ssim > 0.999 && s.flip < 0.01 && s.lpips.is_none() && s.views == 2, "{s:?}");
        }
        let mut swapped = Capture::default();
        swapped.states[State::START].test = vec![rendered(State::END); 2];
        let [start, end] = score_replica(&folder, &swapped, None).unwrap();
        assert!(start.unwrap().psnr < 25.0 && start.unwrap().flip > 0.05 && end.is_none(), "{start:?}");
    }

    #[test]
    fn a_replica_without_gaussians_has_no_scores_and_broken_files_are_named() {
        let (capture, (_, mut labels, _)) = (capture(), scene());
        let (_dir, folder) = replica(None);
        let message = |folder: &RunFolder| score_replica(folder, &capture, None).unwrap_err().to_string();
        assert!(message(&folder).contains("canonical.ply: property `part`"), "{}", message(&folder));
        std::fs::remove_file(folder.canonical_splats()).unwrap();
        assert_eq!(score_replica(&folder, &capture, None).unwrap(), [None, None]);
        labels[3] = 2;
        let (_dir, folder) = replica(Some(&labels));
        assert!(message(&folder).contains("belongs to part 2, but the replica has 2 parts"), "{}", message(&folder));
        std::fs::write(folder.config(), "seed = \"x\"").unwrap();
        labels[3] = 0;
        write_splat_ply(&folder.canonical_splats(), &scene().0, Some(&labels), "canonical").unwrap();
        assert!(message(&folder).contains("config.toml") && message(&folder).contains("seed"), "{}", message(&folder));
    }

    #[test]
    fn means_weigh_views_and_need_every_lpips() {
        let one = PictureScores { psnr: 10.0, ssim: 0.1, flip: 0.4, lpips: Some(0.2), views: 1 };
        let three = PictureScores { psnr: 30.0, ssim: 0.9, flip: 0.0, lpips: None, views: 3 };
        let mean = PictureScores::mean_of(&[one, three]).unwrap();
        assert!((mean.psnr - 25.0).abs() < 1e-12 && (mean.flip - 0.1).abs() < 1e-12);
        assert_eq!((mean.lpips, mean.views, PictureScores::mean_of(&[])), (None, 4, None));
    }
}
