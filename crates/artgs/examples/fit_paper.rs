//! Runs the published method on a capture for a number of steps per stage and prints how long each takes:
//! `fit_paper CAPTURE PARTS [SINGLE TYPES JOINT]`.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

use artgs::fit::{Cpu, Follow, SingleConfig, StepStats, fit_single, mean_score};
use artgs::low_level::{PaperConfig, paper_pipeline, score_state};
use artgs_core::{JointKind, PerState, State};
use std::time::Instant;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let capture = artgs_io::load_capture(args[0].as_ref()).unwrap();
    let parts: usize = args[1].parse().unwrap();
    let number = |i: usize, default: usize| args.get(i).map_or(default, |a| a.parse().unwrap());
    let config = SingleConfig { steps: number(2, 10_000), ..SingleConfig::paper() };
    let mut reports = Reports { stage: "single", clock: Instant::now() };
    let single =
        PerState::from_fn(|state| fit_single(&capture.states[state].train, &config, 1, &Cpu, &mut reports).unwrap());
    let mut config = PaperConfig::default();
    config.types.train.steps = number(3, config.types.train.steps);
    config.types.steps_for_many = number(3, config.types.steps_for_many);
    config.articulate.steps = number(4, config.articulate.steps);
    let views = capture.states.as_ref().map(|views| &views.train[..]);
    let result = paper_pipeline(views, &single, parts, &config, 1, &Cpu, &mut reports).unwrap();
    println!("{:?}", result.models);
    for joint in &result.trained.joints {
        let kind = joint.joint_kind(10_f64.to_radians());
        let joint = joint.joint(kind);
        let value = joint.state_values[State::END];
        let value = if kind == JointKind::Revolute { value.to_degrees() } else { value };
        println!("{kind:?} {value:.3} about {:?} through {:?}", joint.axis, joint.origin);
    }
    for state in State::ALL {
        let mean = mean_score(&score_state(&result.trained, &capture.states[state].test, state, false));
        println!("{} held out: {:.2} dB, SSIM {:.4}", state.name(), mean.psnr, mean.ssim);
    }
}

struct Reports {
    stage: &'static str,
    clock: Instant,
}

impl Follow for Reports {
    fn step(&mut self, s: StepStats) {
        assert!(s.loss.is_finite(), "loss of step {}", s.step);
        if s.step.is_multiple_of(100) {
            let (stage, each) = (self.stage, self.clock.elapsed().as_secs_f64() * 10.0);
            println!("{stage} {:5} {each:6.2} ms loss {:.4} {:5.2} dB {:6}", s.step, s.loss, s.psnr, s.gaussians);
            self.clock = Instant::now();
        }
    }

    fn stage(&mut self, name: &'static str) {
        self.stage = name;
    }
}
