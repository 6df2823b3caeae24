//! Time that a stage still takes.

use std::time::{Duration, Instant};

/// Speed of a stage, smoothed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    since: Instant,
    /// Time and step of the last measurement.
    last: (Instant, usize),
    /// Steps per second.
    speed: Option<f64>,
}

/// Time over which the speed is averaged, seconds.
const MEMORY: f64 = 8.0;

/// Least time between two measurements, seconds.
const MEASURED: f64 = 0.25;

/// No estimate before a stage has taken this time, seconds.
const WARM_UP: f64 = 3.0;

/// Estimates above this many times the time that the stage has taken are not shown: the first steps of a stage are often
/// slow.
const LARGEST: f64 = 20.0;

impl Pace {
    /// A stage that reports `step` for the first time.
    pub(crate) fn new(now: Instant, step: usize) -> Self {
        Self { since: now, last: (now, step), speed: None }
    }

    /// Takes a step, and returns the time left; none before it can be estimated, or without an end.
    pub(crate) fn left(&mut self, now: Instant, step: usize, total: usize) -> Option<Duration> {
        let (then, before) = self.last;
        let passed = now.duration_since(then).as_secs_f64();
        if step > before && passed >= MEASURED {
            let current = (step - before) as f64 / passed;
            let weight = 1.0 - (-passed / MEMORY).exp();
            self.speed = Some(self.speed.map_or(current, |speed| speed + weight * (current - speed)));
            self.last = (now, step);
        }
        let remaining = total.checked_sub(step)? as f64;
        let taken = now.duration_since(self.since).as_secs_f64();
        let left = remaining / self.speed?;
        (taken >= WARM_UP && left <= LARGEST * taken).then(|| Duration::from_secs_f64(left))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Estimates of a stage whose step `i` takes `duration(i)` seconds, with the time that was left in fact.
    fn estimates(steps: usize, duration: impl Fn(usize) -> f64) -> Vec<(Duration, f64)> {
        let begin = Instant::now();
        let mut pace = Pace::new(begin, 0);
        let total: f64 = (0..steps).map(&duration).sum();
        let mut taken = 0.0;
        let mut out = Vec::new();
        for step in 1..=steps {
            taken += duration(step - 1);
            let left = pace.left(begin + Duration::from_secs_f64(taken), step, steps);
            out.extend(left.map(|left| (left, total - taken)));
        }
        out
    }

    #[test]
    fn a_steady_stage_is_estimated_exactly() {
        let all = estimates(400, |_| 0.1);
        assert!(all.len() > 300);
        assert!(all.iter().all(|(left, truth)| (left.as_secs_f64() - truth).abs() < 0.6), "{all:?}");
    }

    #[test]
    fn a_slow_beginning_is_not_taken_for_the_whole() {
        // 40 seconds, the first step of 400 takes 4: at its speed the stage would take 27 minutes.
        let all = estimates(400, |i| if i == 0 { 4.0 } else { 0.09 });
        assert!(all.iter().all(|(left, _)| left.as_secs_f64() < 200.0), "{all:?}");
        // Half way, the estimate is right to a quarter.
        let (left, truth) = all[all.len() / 2];
        assert!((left.as_secs_f64() / truth - 1.0).abs() < 0.25, "{left:?} {truth}");
    }

    #[test]
    fn there_is_no_estimate_without_an_end_or_a_speed() {
        let begin = Instant::now();
        let mut pace = Pace::new(begin, 100);
        assert_eq!(pace.left(begin + Duration::from_secs(10), 100, 400), None);
        assert_eq!(pace.left(begin + Duration::from_secs(10), 150, 0), None);
        assert_eq!(pace.left(begin + Duration::from_secs(20), 200, 400), Some(Duration::from_secs(40)));
    }
}
