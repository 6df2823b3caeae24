//! Jumps of the poses of a recording: after tracking was lost, frames may be placed where nothing connects them to the others.

use super::agreement::agreement;
use super::samples::{CoarseView, Reading, coarse_views};
use artgs_core::View;
use serde::Serialize;

/// Step between neighbouring frames that is a jump, in median steps.
const JUMP: f64 = 8.0;
/// Frames that a recording must have before its steps are judged.
const LEAST_FRAMES: usize = 8;
/// Share of the carried points that two runs of frames must have in common to be connected.
const COMMON: f64 = 0.02;

/// Frames that a jump of the poses separates from the others, in their order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Apart {
    /// Their names.
    pub names: Vec<String>,
    /// Names of the frames before and after the largest jump.
    pub between: [String; 2],
    /// Distance between these two cameras, scene units.
    pub distance: f64,
    /// Number of frames of the recording with depth.
    pub of: usize,
}

impl Apart {
    /// Finds the frames of runs between jumps that show no surface of the longest run, nor of a run that is connected with it.
    /// `views` are in the order of their time; those without depth are ignored.
    pub(super) fn find<'v>(views: impl Iterator<Item = &'v View>) -> Option<Self> {
        let views: Vec<&View> = views.filter(|v| v.depth.is_some()).collect();
        let steps = steps(&views);
        let median = crate::trimmed::median(&mut steps.clone())?;
        if views.len() < LEAST_FRAMES || median <= 0.0 {
            return None;
        }
        let jumps: Vec<usize> = (0..steps.len()).filter(|&i| steps[i] > JUMP * median).collect();
        let ends = jumps.iter().map(|i| i + 1).chain([views.len()]);
        let starts = [0].into_iter().chain(jumps.iter().map(|i| i + 1));
        let runs: Vec<&[&View]> = starts.zip(ends).map(|(a, b)| &views[a..b]).collect();
        let connected = connected(&runs);
        let apart = || runs.iter().zip(&connected).filter(|(_, is)| !**is).flat_map(|(run, _)| run.iter());
        let largest = jumps.iter().copied().max_by(|a, b| steps[*a].total_cmp(&steps[*b]))?;
        let between = [largest, largest + 1].map(|i| views[i].name.clone());
        let names: Vec<String> = apart().map(|v| v.name.clone()).collect();
        (!names.is_empty()).then(|| Self { names, between, distance: steps[largest], of: views.len() })
    }

    /// What was found, as a sentence.
    pub(super) fn described(&self) -> String {
        let [before, after] = &self.between;
        format!(
            "the poses jump by {:.2} between {before} and {after}, and {} of {} images show nothing that the others show; they \
             are ignored: tracking was lost, so record again in one slow walk if parts are missing",
            self.distance,
            self.names.len(),
            self.of
        )
    }
}

/// Distances between the cameras of neighbouring views, scene units.
fn steps(views: &[&View]) -> Vec<f64> {
    let center = |v: &View| v.camera.world_to_camera.inverse().translation;
    views.windows(2).map(|w| center(w[0]).distance(center(w[1]))).collect()
}

/// Whether each run is the longest one or shares surfaces with it, also through other runs.
fn connected(runs: &[&[&View]]) -> Vec<bool> {
    let coarse: Vec<Vec<CoarseView>> = runs.iter().map(|run| coarse_views(run.iter().copied())).collect();
    let Some(longest) = (0..runs.len()).max_by_key(|&i| (runs[i].len(), usize::MAX - i)) else { return Vec::new() };
    let mut found = vec![false; runs.len()];
    found[longest] = true;
    let mut open = vec![longest];
    while let Some(with) = open.pop() {
        for run in 0..runs.len() {
            if !found[run] && share(&coarse[run], &coarse[with]).max(share(&coarse[with], &coarse[run])) > COMMON {
                found[run] = true;
                open.push(run);
            }
        }
    }
    found
}

/// Share of the points of a run, per view of the other, that agree.
fn share(of: &[CoarseView], with: &[CoarseView]) -> f64 {
    agreement(of, with, [Reading::STATED; 2]).share_of_all()
}
