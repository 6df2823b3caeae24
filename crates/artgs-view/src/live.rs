//! State of a running reconstruction for the page: the training thread writes it, server threads read it.
//!
//! Without an open page the cost is negligible. With one, Gaussians are requested only after the page has loaded the previous
//! ones, and so rarely that training waits for at most 1 % of the time.

use crate::Placement;
use artgs_core::Splats;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Least interval between two versions of the Gaussians.
const PERIOD: Duration = Duration::from_secs(2);
/// Interval between two versions, relative to the time that training waited for one, and to the time for packing it.
const WAIT_SHARE: u32 = 100;
const PACK_SHARE: u32 = 50;
/// A page without requests for this time counts as closed.
const PRESENCE: Duration = Duration::from_secs(6);
/// Largest number of points of the curves; with more, pairs are merged.
const MOST_POINTS: usize = 2000;

/// State of a run for the page.
#[derive(Debug)]
pub struct Live {
    name: String,
    placement: Placement,
    begun: Instant,
    now: Mutex<Now>,
}

/// Colouring of the Gaussians.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tint {
    Photo = 0,
    Parts = 1,
}

#[derive(Debug, Default)]
struct Now {
    stages: Vec<Stage>,
    progress: Progress,
    curves: Curves,
    shown: Option<Arc<Shown>>,
    /// Time of the last request of a page.
    polled: Option<Instant>,
    /// Time since which Gaussians are requested from training.
    asked: Option<Instant>,
    /// Time of the last version, and the interval until the next request.
    given: Option<(Instant, Duration)>,
    end: Option<Result<(), String>>,
    /// A page has received the end of the run.
    end_sent: bool,
}

#[derive(Clone, Debug, Serialize)]
struct Stage {
    name: String,
    /// Wall-clock seconds of a finished stage.
    seconds: Option<f64>,
    reused: bool,
}

#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Progress {
    step: usize,
    total: usize,
    gaussians: Option<usize>,
}

/// A version of the Gaussians.
#[derive(Debug)]
struct Shown {
    version: u64,
    splats: Splats,
    labels: Vec<u16>,
    /// SPZ by [`Tint`], packed on the first request.
    packed: [OnceLock<Option<Vec<u8>>>; 2],
}

/// Means over one or more steps.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    /// Number of the last step, over all stages.
    seq: u64,
    stage: usize,
    step: usize,
    loss: Mean,
    psnr: Mean,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Mean {
    sum: f64,
    count: u32,
}

impl Mean {
    fn of(value: Option<f64>) -> Self {
        value.filter(|v| v.is_finite()).map_or_else(Self::default, |sum| Self { sum, count: 1 })
    }

    fn and(self, other: Self) -> Self {
        Self { sum: self.sum + other.sum, count: self.count + other.count }
    }

    fn value(self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / f64::from(self.count))
    }
}

impl Point {
    /// Merges this point and the next one; none if they are in different stages.
    fn and(self, next: Self) -> Option<Self> {
        (self.stage == next.stage).then(|| Self {
            loss: self.loss.and(next.loss),
            psnr: self.psnr.and(next.psnr),
            ..next
        })
    }
}

impl Serialize for Point {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (self.stage, self.step, self.loss.value(), self.psnr.value()).serialize(serializer)
    }
}

/// Loss and PSNR by step; older steps are merged.
#[derive(Debug)]
struct Curves {
    points: VecDeque<Point>,
    /// Steps per point, and steps in the last point.
    stride: usize,
    filled: usize,
    seq: u64,
}

impl Default for Curves {
    fn default() -> Self {
        Self { points: VecDeque::new(), stride: 1, filled: 0, seq: 0 }
    }
}

impl Curves {
    fn add(&mut self, stage: usize, step: usize, loss: Option<f64>, psnr: Option<f64>) {
        self.seq += 1;
        let point = Point { seq: self.seq, stage, step, loss: Mean::of(loss), psnr: Mean::of(psnr) };
        if self.filled < self.stride
            && let Some(last) = self.points.back_mut()
            && let Some(both) = last.and(point)
        {
            *last = both;
            self.filled += 1;
            return;
        }
        if self.points.len() >= MOST_POINTS {
            self.halve();
        }
        self.points.push_back(point);
        self.filled = 1;
    }

    fn halve(&mut self) {
        let mut kept: VecDeque<Point> = VecDeque::with_capacity(MOST_POINTS);
        let mut points = std::mem::take(&mut self.points).into_iter().peekable();
        while let Some(point) = points.next() {
            let both = points.peek().and_then(|next| point.and(*next));
            if both.is_some() {
                points.next();
            }
            kept.push_back(both.unwrap_or(point));
        }
        self.points = kept;
        self.stride *= 2;
    }

    /// Complete points after step `since`, and the value of `since` for the next request.
    fn since(&self, since: u64) -> (Vec<Point>, u64) {
        let complete = self.points.len() - usize::from(self.filled < self.stride && !self.points.is_empty());
        let new: Vec<Point> = self.points.iter().take(complete).filter(|p| p.seq > since).copied().collect();
        let next = new.last().map_or(since.min(self.seq), |p| p.seq);
        (new, next)
    }
}

impl Live {
    /// A run for the object `name` before its first stage; `placement` maps the capture's frame to the page's.
    pub fn new(name: &str, placement: Placement) -> Self {
        Self { name: name.into(), placement, begun: Instant::now(), now: Mutex::default() }
    }

    /// Name of the object.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn placement(&self) -> Placement {
        self.placement
    }

    /// A poisoned lock is used: no code that holds it can leave inconsistent data.
    fn now(&self) -> MutexGuard<'_, Now> {
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reports the start of a stage.
    pub fn stage_started(&self, stage: &str) {
        let mut now = self.now();
        now.stages.push(Stage { name: stage.into(), seconds: None, reused: false });
        now.progress = Progress { gaussians: now.progress.gaussians, ..Progress::default() };
    }

    /// Reports the end of a stage after `seconds`; `reused`: an earlier run computed it.
    pub fn stage_finished(&self, stage: &str, seconds: f64, reused: bool) {
        if let Some(s) = self.now().stages.iter_mut().rev().find(|s| s.name == stage) {
            (s.seconds, s.reused) = (Some(seconds), reused);
        }
    }

    /// Reports step `step` of `total` of a stage.
    pub fn event(
        &self,
        stage: &str,
        [step, total]: [usize; 2],
        loss: Option<f64>,
        psnr: Option<f64>,
        gaussians: Option<usize>,
    ) {
        let mut now = self.now();
        // Trainings within a stage may have their own names.
        if now.stages.last().is_none_or(|s| s.name != stage) {
            now.stages.push(Stage { name: stage.into(), seconds: None, reused: false });
        }
        let index = now.stages.len() - 1;
        now.progress = Progress { step, total, gaussians: gaussians.or(now.progress.gaussians) };
        if loss.is_some() || psnr.is_some() {
            now.curves.add(index, step, loss, psnr);
        }
    }

    /// True if [`Live::update_splats`] should be called: a page is open, has loaded the previous version, and enough time has
    /// passed. The time from here to the update counts as waiting time of the training. Call it after every step.
    pub fn wants_splats(&self) -> bool {
        let mut now = self.now();
        let present = now.polled.is_some_and(|at| at.elapsed() < PRESENCE);
        let taken = now.shown.as_ref().is_none_or(|s| s.packed.iter().any(|p| p.get().is_some()));
        let rested = now.given.is_none_or(|(at, rest)| at.elapsed() >= rest);
        let wanted = present && taken && rested;
        now.asked = wanted.then(|| now.asked.unwrap_or_else(Instant::now));
        wanted
    }

    /// Stores a copy of the Gaussians, capture's frame, with their parts `[n]` (or none), and only colours of degree 0. Does
    /// nothing unless [`Live::wants_splats`].
    pub fn update_splats(&self, splats: &Splats, labels: &[u16]) {
        if !self.wants_splats() {
            return;
        }
        let (stride, n) = (splats.sh_stride(), splats.len());
        let flat = Splats {
            means: splats.means.clone(),
            rotations: splats.rotations.clone(),
            log_scales: splats.log_scales.clone(),
            logit_opacities: splats.logit_opacities.clone(),
            sh_degree: 0,
            sh: splats.sh.chunks_exact(stride).flat_map(|sh| &sh[..3]).copied().collect(),
        };
        let labels = if labels.len() == n { labels.to_vec() } else { Vec::new() };
        let mut now = self.now();
        let version = now.shown.as_ref().map_or(1, |s| s.version + 1);
        now.shown = Some(Arc::new(Shown { version, splats: flat, labels, packed: Default::default() }));
        let waited = now.asked.take().map_or(Duration::ZERO, |asked| asked.elapsed());
        now.given = Some((Instant::now(), PERIOD.max(waited * WAIT_SHARE)));
    }

    /// True until [`Live::finish`].
    pub(crate) fn is_running(&self) -> bool {
        self.now().end.is_none()
    }

    /// Reports the end of the run; `Err` says why it failed.
    pub fn finish(&self, outcome: Result<(), String>) {
        self.now().end.get_or_insert(outcome);
    }

    /// Waits until the page has received the end of the run, at most `longest`, and not at all if no page is open.
    pub fn wait_until_end_is_shown(&self, longest: Duration) {
        let begun = Instant::now();
        loop {
            let now = self.now();
            let present = now.polled.is_some_and(|at| at.elapsed() < PRESENCE);
            if now.end_sent || !present || begun.elapsed() >= longest {
                return;
            }
            drop(now);
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// `live.json` for a page that has the curves up to `since`.
    pub(crate) fn json(&self, since: u64) -> String {
        let mut now = self.now();
        now.polled = Some(Instant::now());
        now.end_sent |= now.end.is_some();
        let (points, next) = now.curves.since(since);
        let (state, message) = match &now.end {
            None => ("running", Value::Null),
            Some(Ok(())) => ("finished", Value::Null),
            Some(Err(reason)) => ("failed", Value::from(reason.as_str())),
        };
        let shown = now.shown.as_ref();
        let parts = shown.and_then(|s| s.labels.iter().max()).map_or(0, |&most| usize::from(most) + 1);
        json!({
            "format": "artgs-live", "version": 1, "state": state, "message": message,
            "seconds": self.begun.elapsed().as_secs_f64(), "stages": now.stages, "progress": now.progress,
            "since": next, "points": points, "splats": shown.map_or(0, |s| s.version), "parts": parts,
        })
        .to_string()
    }

    /// The latest Gaussians as SPZ; none before the first version, or if they cannot be packed.
    pub(crate) fn spz(&self, tint: Tint) -> Option<Vec<u8>> {
        let shown = self.now().shown.clone()?;
        let begun = Instant::now();
        let mut packed_here = false;
        let bytes = shown.packed[tint as usize].get_or_init(|| {
            packed_here = true;
            shown.pack(tint)
        });
        if packed_here && let Some((_, rest)) = &mut self.now().given {
            *rest = (*rest).max(begun.elapsed() * PACK_SHARE);
        }
        bytes.clone()
    }
}

impl Shown {
    /// None if a Gaussian is not finite; a later version may be.
    fn pack(&self, tint: Tint) -> Option<Vec<u8>> {
        let packed = match tint {
            Tint::Photo => artgs_io::asset::spz::spz_bytes(&self.splats),
            Tint::Parts => {
                let label = |i: usize| usize::from(self.labels.get(i).copied().unwrap_or(0));
                let sh =
                    (0..self.splats.len()).flat_map(|i| constant_harmonics(crate::page::colour(label(i)))).collect();
                artgs_io::asset::spz::spz_bytes(&Splats { sh, ..self.splats.clone() })
            }
        };
        packed.ok()
    }
}

/// Harmonics of degree 0 of a colour, sRGB.
fn constant_harmonics(color: [u8; 3]) -> [f32; 3] {
    const BASIS: f32 = 0.282_094_8;
    color.map(|c| (f32::from(c) / 255.0 - 0.5) / BASIS)
}

#[cfg(test)]
#[path = "live_tests.rs"]
mod tests;
