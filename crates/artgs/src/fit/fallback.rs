//! Training that outlives its device: the processor takes over from the last saved state.

use super::FitError;
use super::backend::{Backend, StepStats, TrainConfig, TrainState};
use super::devices::{Cpu, Devices};
use super::images::TrainImage;
use std::cell::Cell;
use std::ops::ControlFlow;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The state is saved at least every so many steps.
const SAVE_EVERY: usize = 500;

/// Trains on a device as long as it works. When it fails, or cannot train what it is given ([`FitError::Device`]), the
/// processor repeats the stretch of steps from its beginning and trains from then on, also in what is made later.
#[derive(Debug)]
pub struct WithFallback {
    first: Box<dyn Devices>,
    state: Mutex<FallbackState>,
}

#[derive(Debug, Default)]
struct FallbackState {
    failed: bool,
    /// Why, until it is returned once.
    notice: Option<String>,
}

impl WithFallback {
    /// Trains on `first` while that works.
    pub fn new(first: Box<dyn Devices>) -> Self {
        Self { first, state: Mutex::default() }
    }

    fn state(&self) -> MutexGuard<'_, FallbackState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn has_failed(&self) -> bool {
        self.state().failed
    }

    /// From now on on the processor.
    fn give_up(&self, reason: &str) {
        let notice = Some(format!("training continues on the CPU: {}: {reason}", self.first.name()));
        *self.state() = FallbackState { failed: true, notice };
    }
}

impl Devices for WithFallback {
    fn name(&self) -> String {
        if self.has_failed() { Cpu.name() } else { self.first.name() }
    }

    fn backend<'a>(
        &'a self,
        images: Vec<TrainImage<'a>>,
        config: TrainConfig,
        seed: u64,
    ) -> Result<Box<dyn Backend + 'a>, FitError> {
        if !self.has_failed() {
            match self.first.backend(images.clone(), config, seed) {
                Ok(backend) => {
                    let saved = Some(Saved { images, state: None, made: Vec::new() });
                    return Ok(Box::new(FallbackBackend { devices: self, config, seed, backend, saved }));
                }
                Err(FitError::Device(reason)) => self.give_up(&reason),
                Err(other) => return Err(other),
            }
        }
        Cpu.backend(images, config, seed)
    }

    fn notice(&self) -> Option<String> {
        self.state().notice.take()
    }
}

/// A backend of a device, and what the processor needs to take its place.
struct FallbackBackend<'a> {
    devices: &'a WithFallback,
    config: TrainConfig,
    seed: u64,
    backend: Box<dyn Backend + 'a>,
    /// None once the processor trains.
    saved: Option<Saved<'a>>,
}

struct Saved<'a> {
    images: Vec<TrainImage<'a>>,
    /// As it was uploaded last.
    state: Option<TrainState>,
    /// What ran since.
    made: Vec<ReplayedSteps>,
}

/// Arguments of [`Backend::run`], and the number of the last step it reported.
struct ReplayedSteps {
    steps: usize,
    update_last: bool,
    end: usize,
}

/// Reports every step once, also if steps are repeated.
struct Reporter<'t> {
    on_step: &'t mut dyn FnMut(StepStats) -> ControlFlow<()>,
    /// Number of the last reported step.
    reported: &'t Cell<usize>,
    /// The observer broke off.
    broken: &'t Cell<bool>,
}

impl Reporter<'_> {
    fn report(&mut self, s: StepStats) -> ControlFlow<()> {
        if s.step > self.reported.get() {
            self.reported.set(s.step);
            self.broken.set((self.on_step)(s).is_break() || self.broken.get());
        }
        // A repeated stretch breaks off where the first one had: what was reported has to have happened.
        if self.broken.get() && s.step >= self.reported.get() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

impl FallbackBackend<'_> {
    /// Saves the state of the device, so that fewer steps are repeated after a failure.
    fn save(&mut self) -> Result<(), FitError> {
        let state = self.download()?;
        self.upload(state)
    }

    /// Replaces a device that failed by the CPU and repeats its steps since the last saved state; returns other errors.
    fn replace_device(&mut self, error: FitError) -> Result<(), FitError> {
        let (reason, saved) = match (error, self.saved.take()) {
            (FitError::Device(reason), Some(saved)) => (reason, saved),
            (error, saved) => {
                self.saved = saved;
                return Err(error);
            }
        };
        self.devices.give_up(&reason);
        self.backend = Cpu.backend(saved.images, self.config, self.seed)?;
        if let Some(state) = saved.state {
            self.backend.upload(state)?;
        }
        for ReplayedSteps { steps, update_last, end } in saved.made {
            self.backend.run(steps, update_last, &mut |s| {
                if s.step < end { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            })?;
        }
        Ok(())
    }

    fn stretch(&mut self, steps: usize, update_last: bool, reporter: &mut Reporter<'_>) -> Result<(), FitError> {
        if let Err(error) = self.backend.run(steps, update_last, &mut |s| reporter.report(s)) {
            self.replace_device(error)?;
            return self.backend.run(steps, update_last, &mut |s| reporter.report(s));
        }
        if let Some(saved) = &mut self.saved {
            saved.made.push(ReplayedSteps { steps, update_last, end: reporter.reported.get() });
        }
        Ok(())
    }
}

impl Backend for FallbackBackend<'_> {
    fn upload(&mut self, state: TrainState) -> Result<(), FitError> {
        if let Some(saved) = &mut self.saved {
            saved.state = Some(state.clone());
            saved.made.clear();
        }
        self.backend.upload(state).or_else(|error| self.replace_device(error))
    }

    fn run(
        &mut self,
        steps: usize,
        update_last: bool,
        on_step: &mut dyn FnMut(StepStats) -> ControlFlow<()>,
    ) -> Result<(), FitError> {
        let (reported, broken) = (Cell::new(0), Cell::new(false));
        let mut reporter = Reporter { on_step, reported: &reported, broken: &broken };
        if self.saved.as_ref().is_some_and(|s| s.made.iter().map(|m| m.steps).sum::<usize>() >= SAVE_EVERY) {
            self.save()?;
        }
        let mut left = steps;
        while left > SAVE_EVERY && self.saved.is_some() {
            self.stretch(SAVE_EVERY, true, &mut reporter)?;
            if broken.get() {
                return Ok(());
            }
            left -= SAVE_EVERY;
            self.save()?;
        }
        self.stretch(left, update_last, &mut reporter)
    }

    fn held_back(&mut self) -> Result<Option<f64>, FitError> {
        match self.backend.held_back() {
            Err(error) => {
                self.replace_device(error)?;
                self.backend.held_back()
            }
            seen => seen,
        }
    }

    fn download(&mut self) -> Result<TrainState, FitError> {
        let state = match self.backend.download() {
            Err(error) => {
                self.replace_device(error)?;
                self.backend.download()
            }
            state => state,
        }?;
        if let Some(saved) = &mut self.saved {
            saved.state = None;
            saved.made.clear();
        }
        Ok(state)
    }
}

#[cfg(test)]
#[path = "fallback_tests.rs"]
mod tests;
