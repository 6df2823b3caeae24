//! Training on a graphics processor.

#[path = "profile.rs"]
mod profile;

use crate::constants::{CONTROL_WORDS, NEEDED, OVERFLOW};
use crate::kernels::{Kernels, Walk};
use crate::picture::Picture;
use crate::resident::Resident;
use crate::scene::Canvas;
use crate::step::{self, Outcome, PartTerms, Step};
use crate::{Gpu, GpuError, chamfer, joints, learnt};
use artgs::articulation::Assignment;
use artgs::fit::{
    Backend, Deformation, Devices, FitError, LossConfig, LossTerms, Membership, StepStats, TrainConfig, TrainImage,
    TrainState, ViewPlan,
};
use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Steps whose numbers are uploaded together at most.
const BATCH: usize = 64;
/// Steps handed to the device at a time: it begins while the host still writes down the next ones.
const SUBMIT: usize = 8;
/// Batches become longer while they take less than this and shorter when they take more than four times as long.
const PATIENCE: Duration = Duration::from_millis(200);
/// Intersections there is room for at first, for each Gaussian.
const TILES_PER_GAUSSIAN: usize = 8;

/// A [`Backend`] on a graphics processor. Everything of a step stays there; the host says which view is next and hears at the
/// end of a batch what its steps were like. The same seed gives the same bytes on the same device.
#[derive(Debug)]
pub struct GpuBackend<'a> {
    gpu: Gpu,
    kernels: Arc<Kernels>,
    config: TrainConfig,
    state: TrainState,
    views: ViewPlan<'a>,
    pictures: Vec<Picture>,
    canvas: Canvas,
    resident: Option<Resident>,
    /// Room for so many intersections.
    capacity: usize,
    batch: usize,
    /// Views and backgrounds that were drawn but not trained on yet.
    drawn: VecDeque<(usize, [f32; 3])>,
}

/// An open graphics processor that makes backends.
#[derive(Clone, Debug)]
pub struct GpuDevices {
    gpu: Gpu,
    kernels: Arc<Kernels>,
}

impl GpuDevices {
    /// Compiles the kernels for the device.
    pub fn new(gpu: Gpu) -> Result<Self, GpuError> {
        let kernels = Arc::new(Kernels::new(&gpu, Walk::of(&gpu))?);
        Ok(Self { gpu, kernels })
    }

    /// A backend that holds the images as [`artgs::fit::CpuBackend`] does.
    pub fn train<'a>(
        &self,
        images: Vec<TrainImage<'a>>,
        config: TrainConfig,
        seed: u64,
    ) -> Result<GpuBackend<'a>, FitError> {
        GpuBackend::new(self.gpu.clone(), self.kernels.clone(), images, config, seed)
    }
}

impl Devices for GpuDevices {
    fn name(&self) -> String {
        self.gpu.name.clone()
    }

    fn backend<'a>(
        &'a self,
        images: Vec<TrainImage<'a>>,
        config: TrainConfig,
        seed: u64,
    ) -> Result<Box<dyn Backend + 'a>, FitError> {
        Ok(Box::new(self.train(images, config, seed)?))
    }
}

/// What one step of a batch found.
struct Seen {
    outcome: Outcome,
    parts: PartTerms,
}

fn device(error: GpuError) -> FitError {
    FitError::Device(error.to_string())
}

impl<'a> GpuBackend<'a> {
    /// Holds the images as [`artgs::fit::CpuBackend`] does, and draws the same views for the same `seed`.
    pub(crate) fn new(
        gpu: Gpu,
        kernels: Arc<Kernels>,
        images: Vec<TrainImage<'a>>,
        config: TrainConfig,
        seed: u64,
    ) -> Result<Self, FitError> {
        let (views, images) = ViewPlan::new(images, &config, seed)?;
        let (pictures, canvas) = show(&gpu, &images).map_err(device)?;
        let state = TrainState::default();
        Ok(Self {
            gpu,
            kernels,
            config,
            state,
            views,
            pictures,
            canvas,
            resident: None,
            capacity: 0,
            batch: 1,
            drawn: VecDeque::new(),
        })
    }

    /// The numbers of the step after `done` further ones, on a view.
    fn numbers(&self, done: usize, (view, background): (usize, [f32; 3]), loss: &LossConfig) -> Step {
        let Self { config, state, .. } = self;
        let number = state.step + done + 1;
        let mut step = self.pictures[view].step(config, loss, background);
        let n = state.splats.len();
        step.n = n as u32;
        step.sh_stride = state.splats.sh_stride() as u32;
        step.sh_degree = config.sh_degree(number, state.splats.sh_degree) as u32;
        step.capacity = self.capacity as u32;
        step.entropy_step = loss.opacity_entropy / n as f32;
        step.update(&config.rates_at(number, state.settling), &config.adam, state.adam.count + done + 1);
        if let Deformation::Articulated(articulated) = &state.deformation {
            joints::numbers(&mut step, articulated, number, done);
            learnt::numbers(&mut step, articulated, number, done);
            chamfer::numbers(&mut step, articulated, number);
        }
        step
    }

    /// Makes the next `steps` steps, of which the last only updates Gaussians if `update_last`; says what they were like. None
    /// after one for which there was no room has been made.
    fn batch(&mut self, steps: usize, update_last: bool) -> Result<Vec<Seen>, GpuError> {
        while self.drawn.len() < steps {
            let view = self.views.sampler.view();
            let background = if self.config.random_background { self.views.sampler.color() } else { [0.0; 3] };
            self.drawn.push_back((view, background));
        }
        let numbers: Vec<Step> = (0..steps)
            .map(|i| {
                let mut step = self.numbers(i, self.drawn[i], &self.config.loss);
                step.slot = i as u32;
                step
            })
            .collect();
        let Some(resident) = &self.resident else { return Ok(Vec::new()) };
        let Resident { desk, programs, .. } = resident;
        self.gpu.write(&desk.steps, 0, &step::bytes(&numbers));
        for (chunk, numbers) in numbers.chunks(SUBMIT).enumerate() {
            let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                for (k, step) in numbers.iter().enumerate() {
                    let i = chunk * SUBMIT + k;
                    let update = update_last || i + 1 < steps;
                    for (call, size) in programs.of_step(self.drawn[i].0, update) {
                        call.encode(&mut pass, i, size.groups(step), &desk.arguments);
                    }
                }
            }
            self.gpu.queue.submit([encoder.finish()]);
        }
        self.seen(steps)
    }

    /// Reads what the steps of a batch were like; makes room if there was not enough.
    fn seen(&mut self, steps: usize) -> Result<Vec<Seen>, GpuError> {
        let Some(resident) = &self.resident else { return Ok(Vec::new()) };
        let desk = &resident.desk;
        let words = |bytes: usize| steps * bytes / 4;
        let read = self.gpu.read(&[
            (&desk.results, words(size_of::<Outcome>())),
            (&desk.part_terms, words(size_of::<PartTerms>())),
            (&desk.control, CONTROL_WORDS as usize),
        ])?;
        let outcomes: &[Outcome] = bytemuck::cast_slice(&read[0]);
        let parts: &[PartTerms] = bytemuck::cast_slice(&read[1]);
        let seen = outcomes.iter().zip(parts).map(|(&outcome, &parts)| Seen { outcome, parts }).collect();
        let [overflow, needed] = [OVERFLOW, NEEDED].map(|word| read[2][word as usize]);
        if overflow != 0 {
            self.gpu.write(&desk.control, 0, &[0_u32; CONTROL_WORDS as usize]);
            self.make_room(needed as usize + needed as usize / 4)?;
        }
        Ok(seen)
    }

    /// Room for `capacity` intersections, and the calls that use it.
    fn make_room(&mut self, capacity: usize) -> Result<(), GpuError> {
        let Self { gpu, kernels, canvas, pictures, resident, .. } = self;
        let Some(resident) = resident else { return Ok(()) };
        self.capacity = resident.make_room(gpu, kernels, capacity, canvas, pictures)?;
        gpu.check()
    }

    /// Puts the state on the device.
    fn place(&mut self) -> Result<(), GpuError> {
        let Self { gpu, state, .. } = self;
        let n = state.splats.len();
        let resident = match self.resident.take() {
            Some(resident) if resident.fits(state) => resident,
            old => Resident::new(gpu, state, BATCH, old)?,
        };
        resident.fill(gpu, state);
        let ready = !resident.programs.forward.is_empty();
        self.resident = Some(resident);
        if !ready {
            self.make_room(self.capacity.max(TILES_PER_GAUSSIAN * n))?;
        }
        self.gpu.check()
    }

    /// What the last upload and the steps since have made of the state.
    fn fetch(&mut self) -> Result<(), GpuError> {
        let Some(resident) = &self.resident else { return Ok(()) };
        resident.fetch(&self.gpu, &mut self.state)
    }

    fn stats(&self, seen: &Seen, view: usize) -> StepStats {
        let terms = self.terms(seen, view, &self.config.loss);
        let n = self.state.splats.len();
        let weight = f64::from(self.config.loss.opacity_entropy);
        let loss = terms.total
            + weight * f64::from(seen.outcome.entropy) / n as f64
            + f64::from(seen.parts.chamfer + seen.parts.centre);
        let psnr = -10.0 * terms.mse.max(1e-12).log10();
        StepStats { step: self.state.step, total: self.config.total, loss, psnr, gaussians: n, terms }
    }

    fn terms(&self, seen: &Seen, view: usize, config: &LossConfig) -> LossTerms {
        let picture = &self.pictures[view];
        let area = (picture.size[0] * picture.size[1]) as f64;
        let [l1, squared, depth, mask] = seen.outcome.sums.map(f64::from);
        let mut terms = LossTerms {
            l1: l1 / (3.0 * area),
            mse: squared / (3.0 * area),
            depth: depth / picture.depth_pixels(config) as f64,
            mask: mask / area,
            ..LossTerms::default()
        };
        if config.ssim > 0.0 {
            terms.ssim = (f64::from(seen.outcome.similarity) / 3.0 + area - picture.windows(config) as f64) / area;
        }
        terms.weigh(config);
        terms
    }
}

/// Photographs on the device, and what is drawn to compare with them.
fn show(gpu: &Gpu, images: &[TrainImage<'_>]) -> Result<(Vec<Picture>, Canvas), GpuError> {
    /// Photographs whose pixels wait in memory of the host at a time.
    const TOGETHER: usize = 16;
    let mut pictures = Vec::with_capacity(images.len());
    for images in images.chunks(TOGETHER) {
        for image in images {
            pictures.push(Picture::new(gpu, image)?);
        }
        gpu.read(&[])?;
    }
    let canvas = Canvas::new(gpu, images.iter().map(|image| [image.width, image.height]))?;
    Ok((pictures, canvas))
}

/// What this backend cannot train.
fn refuse(state: &TrainState) -> Result<(), FitError> {
    let Deformation::Articulated(articulated) = &state.deformation else { return Ok(()) };
    let Membership::Learned(assignment) = &articulated.membership else { return Ok(()) };
    let kind = match **assignment {
        Assignment::Centres(_) => return Ok(()),
        Assignment::Mlp(_) => "mlp",
        Assignment::Slots(_) => "slots",
    };
    let why = "graphics processors learn parts by centres only";
    Err(FitError::Device(format!("{why}: train assign.kind = \"{kind}\" with --device cpu")))
}

impl Backend for GpuBackend<'_> {
    fn upload(&mut self, state: TrainState) -> Result<(), FitError> {
        if state.splats.is_empty() {
            return Err(FitError::Empty);
        }
        refuse(&state)?;
        self.state = state;
        if self.state.settling.is_some() {
            if !self.views.held.is_empty() {
                self.drawn.clear();
            }
            if let Some(fine) = self.views.settle() {
                self.resident = None;
                self.pictures.clear();
                (self.pictures, self.canvas) = show(&self.gpu, &fine).map_err(device)?;
            }
        }
        self.place().map_err(device)
    }

    fn run(
        &mut self,
        steps: usize,
        update_last: bool,
        on_step: &mut dyn FnMut(StepStats) -> ControlFlow<()>,
    ) -> Result<(), FitError> {
        if self.state.splats.is_empty() {
            return Err(FitError::Empty);
        }
        let (mut done, mut go_on) = (0, true);
        while done < steps && go_on {
            let count = self.batch.min(steps - done);
            let begun = Instant::now();
            let update = update_last || done + count < steps;
            let seen = self.batch(count, update).map_err(device)?;
            let took = begun.elapsed();
            for seen in seen.iter().take_while(|seen| seen.outcome.complete != 0.0) {
                let (view, _) = self.drawn.pop_front().unwrap_or_default();
                done += 1;
                self.state.step += 1;
                self.state.adam.count += usize::from(update_last || done < steps);
                if let Deformation::Articulated(articulated) = &mut self.state.deformation {
                    articulated.count_update();
                }
                let stats = self.stats(seen, view);
                go_on &= on_step(stats).is_continue();
            }
            if took < PATIENCE {
                self.batch = (2 * self.batch).min(BATCH);
            } else if took > 4 * PATIENCE {
                self.batch = (self.batch / 2).max(1);
            }
        }
        Ok(())
    }

    fn held_back(&mut self) -> Result<Option<f64>, FitError> {
        if self.state.splats.is_empty() {
            return Err(FitError::Empty);
        }
        let colors = LossConfig { ssim: 0.0, depth: 0.0, mask: 0.0, opacity_entropy: 0.0, ..self.config.loss };
        let mut sum = 0.0;
        for view in self.views.held.clone() {
            let seen = self.look(view, &colors).map_err(device)?;
            sum -= 10.0 * self.terms(&seen, view, &colors).mse.max(1e-12).log10();
        }
        Ok((!self.views.held.is_empty()).then(|| sum / self.views.held.len() as f64))
    }

    fn download(&mut self) -> Result<TrainState, FitError> {
        self.fetch().map_err(device)?;
        Ok(std::mem::take(&mut self.state))
    }
}

impl GpuBackend<'_> {
    /// Draws a view over black and compares, but learns nothing.
    fn look(&mut self, view: usize, loss: &LossConfig) -> Result<Seen, GpuError> {
        loop {
            let step = self.numbers(0, (view, [0.0; 3]), loss);
            let Some(Resident { desk, programs, .. }) = &self.resident else {
                return Err(GpuError::Failed("there is nothing to look at".into()));
            };
            self.gpu.write(&desk.steps, 0, &step::bytes(&[step]));
            let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                for (call, size) in programs.forward.iter().chain(&programs.compare[view]) {
                    call.encode(&mut pass, 0, size.groups(&step), &desk.arguments);
                }
            }
            self.gpu.queue.submit([encoder.finish()]);
            if let Some(seen) = self.seen(1)?.pop()
                && seen.outcome.complete != 0.0
            {
                return Ok(seen);
            }
        }
    }
}

#[cfg(test)]
#[path = "backend_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "learnt_tests.rs"]
mod learnt_tests;
