//! The last stage: replica, scores and preview from trained parts and meshes.

use super::preview::Preview;
use super::stages::Run;
use super::{Error, FittedParts, Reconstructed, ViewMeans};
use crate::articulation::{Trained, score_state};
use crate::config::Method;
use crate::discover::Discovery;
use crate::fit::score::mean_score;
use crate::observer::{Event, percent};
use crate::surface::PartMeshes;
use artgs_core::{Alternative, Capture, Joint, JointEstimate, Mesh, Replica, State, View};
use artgs_io::run_folder::{load_text, save_json};
use artgs_io::write_atomic;
use glam::DVec3;

/// Joints with a smaller confidence are uncertain and warned of; right ones have more than 0.9.
pub const DOUBTFUL: f64 = 0.5;

impl Run<'_> {
    /// The result, saved in the folder if there is one.
    pub(super) fn assemble(
        mut self,
        fitted: FittedParts,
        meshes: PartMeshes,
        points: Option<Discovery>,
    ) -> Result<Reconstructed, Error> {
        /// Share of the work until the images are scored, the preview comes then.
        const SCORED: f64 = 0.5;
        self.warn_of_doubtful_parts(&fitted, &meshes);
        let mut result = self.stage(
            "assemble",
            |_| None,
            |run| {
                let rotate = run.config.articulate.rotate_sh;
                let capture = run.capture;
                run.summary.parts = fitted.parts.len() + 1;
                percent(run.observer, "assemble")(0.0);
                let preview = fitted.trained.as_ref().map(|trained| {
                    run.summary.gaussians = trained.splats.len();
                    (run.summary.test, run.summary.train) = score_pictures(capture, trained, rotate);
                    percent(run.observer, "assemble")(SCORED);
                    Preview::new(capture, trained, &fitted.parts, rotate)
                });
                let mut replica = replica(&fitted.parts, points.as_ref(), &meshes);
                (replica.frames, replica.frame_errors) = (capture.frames, capture.frame_errors);
                replica.up = capture.up;
                let result = Reconstructed {
                    replica,
                    meshes,
                    points,
                    trained: fitted.trained,
                    preview,
                    summary: Default::default(),
                    config: run.config.clone(),
                };
                run.save(|folder| result.save_results(folder))?;
                if run.folder.map_or(Ok(false), |folder| folder.remove_stale_exports())? {
                    let note = "the replica has changed: exports of the earlier one were removed";
                    run.observer.event(Event::note(note));
                }
                Ok(result)
            },
        )?;
        let before: f64 = self.what.prepared.seconds().map(|(_, seconds)| seconds).sum();
        self.summary.total_seconds = before + self.begun.elapsed().as_secs_f64();
        self.summary.peak_memory_mib = peak_memory_mib();
        if let Some(folder) = self.folder {
            let applied = load_text(&folder.applied_corrections())?.unwrap_or_default();
            write_atomic(&folder.replica_corrections(), applied.as_bytes())?;
            save_json(&folder.metrics(), &self.summary)?;
        }
        result.summary = self.summary;
        Ok(result)
    }

    fn warn_of_doubtful_parts(&mut self, fitted: &FittedParts, meshes: &PartMeshes) {
        for (part, _) in meshes.parts.iter().enumerate().filter(|(_, m)| m[State::START].is_empty()) {
            self.warn(format!("part {part} has no surface: no view shows enough of it"));
        }
        for (k, found) in fitted.parts.iter().enumerate() {
            if let Some(confidence) = found.confidence.filter(|&c| c < DOUBTFUL) {
                self.warn(low_confidence(k + 1, confidence, self.config.method));
            }
        }
    }
}

/// A warning of a joint that is probably wrong. The confidence of the baseline is another measure.
fn low_confidence(part: usize, confidence: f64, method: Method) -> String {
    let percent = 100.0 * confidence;
    let what = match method {
        Method::Registration => {
            format!("its joint takes only {percent:.0} % of its visible points onto a surface of the other state")
        }
        _ => format!("the probability that its joint is correct is only {percent:.0} %"),
    };
    format!("part {part}: {what}; check it in artgs view, and correct its joint there if it is wrong")
}

/// The joints' origins are near the parts at the start state. Joints are those to the part that carries each.
fn replica(parts: &[JointEstimate], found: Option<&Discovery>, meshes: &PartMeshes) -> Replica {
    let middles: Vec<DVec3> = meshes.parts.iter().skip(1).map(|m| middle(&m[State::START])).collect();
    let joints: Vec<Joint> = parts.iter().zip(&middles).map(|(part, at)| part.joint_near(parts, *at)).collect();
    let mut replica = Replica::new(&joints);
    for (part, fitted) in replica.parts[1..].iter_mut().zip(parts) {
        part.confidence = fitted.confidence;
        part.interval = fitted.interval;
        part.parent = Some(fitted.parent);
    }
    let others = found.map_or(&[][..], |found| found.alternatives.as_slice());
    for ((part, others), at) in replica.parts[1..].iter_mut().zip(others).zip(&middles) {
        part.alternatives = others.iter().map(|other| Alternative::near(other, *at)).collect();
    }
    replica
}

/// Mean of the vertices.
fn middle(mesh: &Mesh) -> DVec3 {
    let sum: DVec3 = mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from))).sum();
    sum / mesh.vertices.len().max(1) as f64
}

/// Mean scores per state.
type Means = [Option<ViewMeans>; 2];

/// Scores of held-out and of training images.
fn score_pictures(capture: &Capture, trained: &Trained, rotate_sh: bool) -> (Means, Means) {
    let means = |views: &[View], step: usize, state: State| {
        let scores = score_state(trained, views.iter().step_by(step), state, rotate_sh);
        let mean = mean_score(&scores);
        (!scores.is_empty()).then_some(ViewMeans { psnr: mean.psnr, ssim: mean.ssim, views: scores.len() })
    };
    let test = State::ALL.map(|state| means(&capture.states[state].test, 1, state));
    // A few training views suffice to see overfitting.
    let train = State::ALL.map(|state| {
        let views = &capture.states[state].train;
        means(views, views.len().div_ceil(8).max(1), state)
    });
    (test, train)
}

/// Largest resident memory so far, MiB; only Linux reports it without further crates.
fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<f64>().ok()? / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_low_confidence_is_stated_as_the_probability_that_the_joint_is_correct() {
        let text = low_confidence(2, 0.342, Method::Discover);
        assert!(text.contains("part 2: the probability that its joint is correct is only 34 %"), "{text}");
        let text = low_confidence(2, 0.342, Method::Registration);
        assert!(text.contains("part 2: its joint takes only 34 % of its visible points"), "{text}");
    }
}
