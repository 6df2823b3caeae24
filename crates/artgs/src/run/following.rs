//! Training as reported to the observer of the run.

use crate::fit::{Deformation, Devices, Follow, StepStats, TrainState};
use crate::observer::{Event, Observer, Snapshot};
use artgs_core::State;

/// Reports the steps of a stage, and failures of its device, to the observer of a run.
pub(super) struct Following<'o> {
    observer: &'o mut dyn Observer,
    devices: &'o dyn Devices,
    /// Of the whole run.
    warnings: &'o mut Vec<String>,
    stage: &'static str,
    /// Steps of the stage before this training, and after it.
    around: [usize; 2],
}

impl<'o> Following<'o> {
    /// Training is all of the stage.
    pub(super) fn new(
        observer: &'o mut dyn Observer,
        devices: &'o dyn Devices,
        warnings: &'o mut Vec<String>,
        stage: &'static str,
    ) -> Self {
        Self { observer, devices, warnings, stage, around: [0, 0] }
    }

    /// The stage trains each state, `steps` steps at most, and this is the training of `state`.
    pub(super) fn of_two(self, state: State, steps: usize) -> Self {
        Self { around: [state.index() * steps, state.other().index() * steps], ..self }
    }

    fn counted(&self, step: usize, total: usize) -> [usize; 2] {
        [step + self.around[0], total + self.around[0] + self.around[1]]
    }
}

impl Follow for Following<'_> {
    fn step(&mut self, s: StepStats) {
        if let Some(message) = self.devices.notice() {
            self.observer.event(Event::warning(message.clone()));
            self.warnings.push(message);
        }
        let [step, total] = self.counted(s.step, s.total);
        self.observer.event(Event::Progress {
            stage: self.stage.into(),
            step,
            total,
            loss: Some(s.loss),
            psnr: Some(s.psnr),
            gaussians: Some(s.gaussians),
        });
    }

    fn stage(&mut self, name: &'static str) {
        self.stage = name;
    }

    fn note(&mut self, message: String) {
        self.observer.event(Event::note(message));
    }

    fn wants_snapshot(&mut self) -> bool {
        self.observer.wants_snapshot()
    }

    fn snapshot(&mut self, state: &TrainState, total: usize) {
        let labels = match &state.deformation {
            Deformation::None => Vec::new(),
            Deformation::Articulated(articulated) => articulated.labels(&state.splats),
        };
        let [step, total] = self.counted(state.step, total);
        let (stage, splats) = (self.stage, &state.splats);
        self.observer.snapshot(&Snapshot { stage, step, total, splats, labels: &labels });
    }
}
