//! The training loop on any device: stretches of steps between changes of the set of Gaussians and looks at held-back views.

use super::FitError;
use super::backend::{Backend, PlateauConfig, StepStats, TrainState};
use super::densify::{DensifyConfig, densify, reset_opacities};
use super::follow::Follow;
use rand_pcg::Pcg64Mcg;
use std::ops::ControlFlow;

/// Length of a run, and when it changes the set of Gaussians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunPlan {
    /// Largest number of steps, one view each.
    pub steps: usize,
    /// When the run has converged.
    pub plateau: PlateauConfig,
    /// Update Gaussians also at steps that change their set and at the last step.
    pub update_always: bool,
    /// Adaptive density control.
    pub densify: DensifyConfig,
    /// Extent of the cameras, scene units, that sizes are relative to.
    pub extent: f32,
}

/// Runs a backend from one change of the set of Gaussians or look at the held-back views to the next, until the run has
/// converged and settled, or `plan.steps` are done. In between it stops where the observer wants a snapshot.
pub fn train(
    backend: &mut dyn Backend,
    state: TrainState,
    plan: &RunPlan,
    rng: &mut Pcg64Mcg,
    follow: &mut dyn Follow,
) -> Result<TrainState, FitError> {
    let (control, plateau) = (&plan.densify, &plan.plateau);
    let latest = plateau.latest(plan.steps);
    let mut best = f64::NEG_INFINITY;
    let (mut from, mut settling) = (state.step, state.settling);
    let mut uploaded = settling;
    // The device keeps the state as long as only steps change it: taking it back costs as much as many steps.
    let mut kept = Some(state);
    loop {
        if settling.is_none() && plateau.settle > 0 && from >= latest {
            settling = Some(from);
        }
        let end = plateau.end(settling, plan.steps);
        if from >= end {
            let state = kept.map_or_else(|| backend.download(), Ok)?;
            return Ok(TrainState { settling, ..state });
        }
        if uploaded != settling && kept.is_none() {
            kept = Some(backend.download()?);
        }
        uploaded = settling;
        if let Some(state) = kept.take() {
            backend.upload(TrainState { settling, ..state })?;
        }
        let looks = |step: usize| {
            settling.is_none() && plateau.every > 0 && step.is_multiple_of(plateau.every) || step == latest
        };
        let stops = |step: &usize| control.acts_at(*step) || control.resets_at(*step) || looks(*step);
        let to = (from + 1..end).find(stops).unwrap_or(end);
        let look = looks(to);
        let (mut at, mut wanted) = (from, false);
        backend.run(to - from, plan.update_always, &mut |s| {
            at = s.step;
            follow.step(StepStats { total: end, ..s });
            wanted |= follow.wants_snapshot();
            if wanted { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        let seen = if look && at == to { backend.held_back()? } else { None };
        from = at;
        let changes = at == to && (control.acts_at(to) || control.resets_at(to));
        if wanted || changes {
            let mut state = backend.download()?;
            if wanted {
                follow.snapshot(&state, end);
            }
            if changes {
                change(&mut state, plan, to, rng);
            }
            kept = Some(state);
        }
        if let Some(psnr) = seen {
            if psnr < best + plateau.least_gain {
                settling = Some(to);
            }
            best = best.max(psnr);
        }
    }
}

/// Changes the set of Gaussians and their opacities as planned at a step.
fn change(state: &mut TrainState, plan: &RunPlan, step: usize, rng: &mut Pcg64Mcg) {
    let control = &plan.densify;
    let TrainState { splats, adam, stats, deformation, .. } = state;
    if control.acts_at(step) {
        let (_, origins) = densify(splats, adam, stats, plan.extent, step, control, rng);
        deformation.follow(&origins);
    }
    if control.resets_at(step) {
        reset_opacities(splats, adam, control);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::Splats;
    use rand::SeedableRng;

    /// Makes no steps but counts them; what it sees in held-back views is written down beforehand.
    #[derive(Default)]
    struct Scripted {
        state: TrainState,
        /// Steps it makes at once; 0: one.
        at_once: usize,
        looks: Vec<(usize, f64)>,
        /// Steps made before and after the run settled.
        steps: [usize; 2],
    }

    impl Backend for Scripted {
        fn upload(&mut self, state: TrainState) -> Result<(), FitError> {
            self.state = state;
            Ok(())
        }

        fn run(
            &mut self,
            steps: usize,
            _: bool,
            on_step: &mut dyn FnMut(StepStats) -> ControlFlow<()>,
        ) -> Result<(), FitError> {
            let (mut broken, end) = (false, self.state.step + steps);
            while !broken && self.state.step < end {
                for _ in 0..self.at_once.max(1).min(end - self.state.step) {
                    self.state.step += 1;
                    self.steps[usize::from(self.state.settling.is_some())] += 1;
                    broken |= on_step(StepStats { step: self.state.step, ..StepStats::default() }).is_break();
                }
            }
            Ok(())
        }

        fn held_back(&mut self) -> Result<Option<f64>, FitError> {
            let step = self.state.step;
            Ok(self.looks.iter().find(|l| l.0 == step).map(|l| l.1))
        }

        fn download(&mut self) -> Result<TrainState, FitError> {
            Ok(std::mem::take(&mut self.state))
        }
    }

    fn run(looks: &[(usize, f64)], steps: usize, plateau: PlateauConfig) -> ([usize; 2], Vec<usize>) {
        let plan = RunPlan {
            steps,
            plateau,
            update_always: true,
            densify: DensifyConfig { every: 0, ..DensifyConfig::default() },
            extent: 1.0,
        };
        let mut backend = Scripted { looks: looks.to_vec(), ..Scripted::default() };
        let (mut seen, mut rng) = (Vec::new(), Pcg64Mcg::seed_from_u64(1));
        train(&mut backend, TrainState::new(Splats::empty(0)), &plan, &mut rng, &mut |s: StepStats| seen.push(s.step))
            .unwrap();
        (backend.steps, seen)
    }

    #[test]
    fn a_run_settles_when_held_back_views_stop_improving() {
        let plateau =
            PlateauConfig { settle: 30, hold_back: 2, every: 10, least_gain: 0.5, ..PlateauConfig::default() };
        let rising = [(10, 20.0), (20, 24.0), (30, 24.4), (40, 30.0)];
        let (steps, seen) = run(&rising, 1000, plateau);
        assert_eq!((steps, seen), ([30, 30], (1..=60).collect()));
        // Still rising, or nothing to look at: the full length.
        let (steps, seen) = run(&rising[..2], 55, plateau);
        assert_eq!((steps, seen), ([25, 30], (1..=55).collect()));
        assert_eq!(run(&[], 55, plateau).0, [25, 30]);
        assert_eq!(run(&rising, 20, plateau).0, [0, 20]);
        assert_eq!(run(&rising, 70, PlateauConfig::never()).0, [70, 0]);
    }

    #[test]
    fn a_look_comes_after_the_last_of_several_steps_made_at_once() {
        /// Asks for a look at step 5 and forgets that it did.
        #[derive(Default)]
        struct Fickle {
            steps: Vec<usize>,
            looks: Vec<usize>,
        }
        impl Follow for Fickle {
            fn step(&mut self, s: StepStats) {
                self.steps.push(s.step);
            }
            fn wants_snapshot(&mut self) -> bool {
                self.steps.last() == Some(&5)
            }
            fn snapshot(&mut self, state: &TrainState, _: usize) {
                self.looks.push(state.step);
            }
        }
        let densify = DensifyConfig { every: 0, ..DensifyConfig::default() };
        let plan = RunPlan { steps: 20, plateau: PlateauConfig::never(), update_always: true, densify, extent: 1.0 };
        for (at_once, look) in [(1, 5), (4, 8)] {
            let mut backend = Scripted { at_once, ..Scripted::default() };
            let (mut follow, mut rng) = (Fickle::default(), Pcg64Mcg::seed_from_u64(1));
            train(&mut backend, TrainState::new(Splats::empty(0)), &plan, &mut rng, &mut follow).unwrap();
            assert_eq!((follow.steps, follow.looks), ((1..=20).collect(), vec![look]));
        }
    }

    #[test]
    fn few_views_are_held_back_and_evenly() {
        let some = PlateauConfig { hold_back: 3, ..PlateauConfig::default() };
        let held = |plateau: PlateauConfig, count: usize| plateau.held(count).collect::<Vec<usize>>();
        assert_eq!([held(some, 12), held(some, 16), held(some, 100)], [vec![6], vec![4, 12], vec![16, 50, 83]]);
        assert!(held(some, 7).is_empty() && held(PlateauConfig::never(), 100).is_empty());
    }
}
