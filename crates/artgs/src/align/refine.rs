//! Refinement of poses that is kept only where depth agrees better afterwards.

use super::bundle::{BundleConfig, BundleReport, overlapping_pairs, register_frames};
use super::frames::DepthFrame;
use crate::trimmed::quantile;
use artgs_core::Rigid;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Cells of a frame that judge a refinement; those that it is fitted to are not among them.
const JUDGES: usize = 200;
/// Depth difference below which two cells show one surface, relative to their depth: far above drift, below furniture.
const NEAR: f64 = 0.1;
/// Least cosine between the normals of two cells that show one surface.
const ALONG: f64 = 0.5;
/// Residuals are cut off at this multiple of their median as stated.
const CUT: f64 = 4.0;

/// Moves the frames so that their depth agrees, as [`register_frames`]: with brightness, or without it if depth agrees worse than
/// before with it. The frames stay as they are if that holds without it, too: colours that are not registered to depth pull poses
/// away, and so do moved things.
pub(crate) fn refine_poses(frames: &mut [DepthFrame], order: &[(usize, usize)], config: &BundleConfig) -> BundleReport {
    let pairs = overlapping_pairs(frames, config.overlap);
    let judges: Vec<Vec<usize>> = frames.iter().map(judges).collect();
    let stated: Vec<Rigid> = frames.iter().map(DepthFrame::pose).collect();
    let residuals = residuals(frames, &pairs, &judges);
    let middle = quantile(residuals.clone(), 0.5).map_or(0.0, f64::from);
    let before = disagreement(&residuals, middle);
    let plain = BundleConfig { brightness: 0.0, ..*config };
    let tries: &[&BundleConfig] = if config.brightness > 0.0 { &[config, &plain] } else { &[config] };
    let mut unchanged = BundleReport::default();
    for config in tries {
        let report = register_frames(frames, &pairs, order, config);
        if disagreement(&self::residuals(frames, &pairs, &judges), middle) <= before {
            return report;
        }
        unchanged = BundleReport { after: report.before, ..report };
        frames.iter_mut().zip(&stated).for_each(|(frame, pose)| frame.set_pose(*pose));
    }
    unchanged
}

/// Cells with normals, spread over the frame.
fn judges(frame: &DepthFrame) -> Vec<usize> {
    let fitted: std::collections::HashSet<u32> = frame.samples.iter().copied().collect();
    let free = |i: &usize| frame.normals[*i] != Vec3::ZERO && !fitted.contains(&(*i as u32));
    let cells: Vec<usize> = (0..frame.points.len()).filter(free).collect();
    // An odd stride does not stay in one column.
    let stride = cells.len().div_ceil(JUDGES).max(1) | 1;
    cells.into_iter().step_by(stride).collect()
}

/// Distances of the judging cells to the planes of the cells that other frames show there, scene units.
fn residuals(frames: &[DepthFrame], pairs: &[(usize, usize)], judges: &[Vec<usize>]) -> Vec<f32> {
    let of_pair = |&(i, j): &(usize, usize)| {
        let (a, b) = (&frames[i], &frames[j]);
        let relative = b.camera.world_to_camera * a.pose();
        let compared = judges[i].iter().filter_map(|&cell| {
            let (p, n) = (relative.apply(a.points[cell].as_dvec3()), relative.turn(a.normals[cell].as_dvec3()));
            let there = b.cell_of(p)?;
            let (q, normal) = (b.points[there].as_dvec3(), b.normals[there].as_dvec3());
            let one = normal != DVec3::ZERO && n.dot(normal) > ALONG && (p.z - q.z).abs() < NEAR * q.z;
            one.then(|| normal.dot(p - q).abs() as f32)
        });
        compared.collect::<Vec<f32>>()
    };
    pairs.par_iter().map(of_pair).collect::<Vec<_>>().concat()
}

/// Mean of the residuals in units of `middle`, each cut off; infinite without residuals.
fn disagreement(residuals: &[f32], middle: f64) -> f64 {
    if residuals.is_empty() {
        return f64::INFINITY;
    }
    let unit = middle.max(f64::MIN_POSITIVE);
    residuals.iter().map(|r| (f64::from(*r) / unit).min(CUT)).sum::<f64>() / residuals.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::align::GridConfig;
    use artgs_core::State;
    use artgs_synth::recording::{RecordingCaptureOptions, render_recording};

    /// Mean distance between where the poses put points one unit in front of the cameras and where the true ones do, after the best shift
    /// of the first camera.
    fn pose_error(frames: &[DepthFrame], truth: &[Rigid]) -> f64 {
        let world = truth[0].inverse() * frames[0].camera.world_to_camera;
        let ahead = |to_camera: &Rigid| to_camera.inverse().apply(DVec3::Z);
        let errors = frames.iter().zip(truth).map(|(frame, camera)| {
            let own = world.apply(ahead(&frame.camera.world_to_camera));
            own.distance(ahead(camera))
        });
        errors.sum::<f64>() / frames.len() as f64
    }

    #[test]
    fn colors_that_contradict_depth_do_not_make_poses_worse() {
        let options = RecordingCaptureOptions { views: 16, width: 160, seed: 4, ..RecordingCaptureOptions::default() };
        let (mut recordings, truth) = render_recording("storage2", &options).expect("the object exists");
        let recording = &mut recordings[State::START];
        for (i, frame) in recording.frames.iter_mut().enumerate() {
            // Each frame in another direction, so that no registration of all of them exists.
            let width = frame.view.size().0;
            let by = [12, 8 * width, 1, 12 * width + 9][i % 4];
            frame.view.rgba.rotate_left(by);
        }
        let mut frames = DepthFrame::all(&recording.frames, &GridConfig::default());
        let order: Vec<(usize, usize)> = (0..frames.len()).map(|i| (0, i)).collect();
        let cameras: Vec<Rigid> = truth.cameras[State::START].iter().map(|c| c.world_to_camera).collect();
        let before = pose_error(&frames, &cameras);
        refine_poses(&mut frames, &order, &BundleConfig::default());
        let after = pose_error(&frames, &cameras);
        assert!(after < 1.05 * before, "{before} {after}");
    }
}
