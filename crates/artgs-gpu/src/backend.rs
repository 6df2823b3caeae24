//! Training on a graphics processor.

#[path = "profile.rs"]
mod profile;

use crate::constants::{CONTROL_WORDS, NEEDED, OVERFLOW};
use crate::device_image::DeviceImage;
use crate::kernels::{Kernels, PixelTransfer};
use crate::published::{chamfer, membership};
use crate::resident::Resident;
use crate::scene::ImageBuffers;
use crate::step::{self, Outcome, PartTerms, Step};
use crate::{Gpu, GpuError, joints};
use artgs::fit::{
    Backend, Deformation, Devices, FitError, LossConfig, LossTerms, Membership, StepStats, TrainConfig, TrainImage,
    TrainState, ViewPlan, psnr_of_mse,
};
use artgs::low_level::Assignment;
use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Most steps that are uploaded together.
const MAX_BATCH: usize = 64;
/// Steps submitted to the device at a time: it starts while the host still encodes the next ones.
const STEPS_PER_SUBMIT: usize = 8;
/// Batches become longer while they take less than this, and shorter when they take more than four times as long.
const BATCH_TIME: Duration = Duration::from_millis(200);
/// Initial capacity for intersections, per Gaussian.
const TILES_PER_GAUSSIAN: usize = 8;

/// A [`Backend`] on a graphics processor. All data of a step stays on the device; the host chooses the views of a batch of
/// steps and reads the losses when the batch is done. The same seed gives the same bytes on the same device.
#[derive(Debug)]
pub struct GpuBackend<'a> {
    gpu: Gpu,
    kernels: Arc<Kernels>,
    config: TrainConfig,
    state: TrainState,
    views: ViewPlan<'a>,
    device_images: Vec<DeviceImage>,
    image_buffers: ImageBuffers,
    resident: Option<Resident>,
    /// Number of intersections that the buffers hold.
    capacity: usize,
    batch: usize,
    /// Views and backgrounds that were sampled but not trained on yet.
    sampled: VecDeque<(usize, [f32; 3])>,
}

/// An open graphics processor, as a [`Devices`] that creates backends.
#[derive(Clone, Debug)]
pub struct GpuDevices {
    gpu: Gpu,
    kernels: Arc<Kernels>,
}

impl GpuDevices {
    /// Compiles the kernels for the device.
    pub fn new(gpu: Gpu) -> Result<Self, GpuError> {
        let kernels = Arc::new(Kernels::new(&gpu, PixelTransfer::of(&gpu))?);
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

/// Losses of one step of a batch.
struct StepResult {
    outcome: Outcome,
    parts: PartTerms,
}

fn device(error: GpuError) -> FitError {
    FitError::Device(error.to_string())
}

impl<'a> GpuBackend<'a> {
    /// Holds the images as [`artgs::fit::CpuBackend`] does, and samples the same views for the same `seed`.
    pub(crate) fn new(
        gpu: Gpu,
        kernels: Arc<Kernels>,
        images: Vec<TrainImage<'a>>,
        config: TrainConfig,
        seed: u64,
    ) -> Result<Self, FitError> {
        let (views, images) = ViewPlan::new(images, &config, seed)?;
        let (device_images, image_buffers) = upload_images(&gpu, &images).map_err(device)?;
        let state = TrainState::default();
        Ok(Self {
            gpu,
            kernels,
            config,
            state,
            views,
            device_images,
            image_buffers,
            resident: None,
            capacity: 0,
            batch: 1,
            sampled: VecDeque::new(),
        })
    }

    /// The uniform of the step after `done` further ones, on a view.
    fn step_uniform(&self, done: usize, (view, background): (usize, [f32; 3]), loss: &LossConfig) -> Step {
        let Self { config, state, .. } = self;
        let number = state.step + done + 1;
        let mut step = self.device_images[view].step(config, loss, background);
        let n = state.splats.len();
        step.n = n as u32;
        step.sh_stride = state.splats.sh_stride() as u32;
        step.sh_degree = config.sh_degree(number, state.splats.sh_degree) as u32;
        step.capacity = self.capacity as u32;
        step.entropy_step = loss.opacity_entropy / n as f32;
        step.update(&config.rates_at(number, state.settling), &config.adam, state.adam.count + done + 1);
        if let Deformation::Articulated(articulated) = &state.deformation {
            joints::set_fields(&mut step, articulated, number, done);
            membership::set_fields(&mut step, articulated, number, done);
            chamfer::set_fields(&mut step, articulated, number);
        }
        step
    }

    /// Runs the next `steps` steps and returns their losses. The last one updates Gaussians only if `update_last`. Once a step
    /// overflows the buffers, it and all later ones change nothing.
    fn batch(&mut self, steps: usize, update_last: bool) -> Result<Vec<StepResult>, GpuError> {
        while self.sampled.len() < steps {
            let view = self.views.sampler.view();
            let background = if self.config.random_background { self.views.sampler.color() } else { [0.0; 3] };
            self.sampled.push_back((view, background));
        }
        let numbers: Vec<Step> = (0..steps)
            .map(|i| {
                let mut step = self.step_uniform(i, self.sampled[i], &self.config.loss);
                step.slot = i as u32;
                step
            })
            .collect();
        let Some(resident) = &self.resident else { return Ok(Vec::new()) };
        let Resident { step_buffers, programs, .. } = resident;
        self.gpu.write(&step_buffers.steps, 0, &step::bytes(&numbers));
        for (chunk, numbers) in numbers.chunks(STEPS_PER_SUBMIT).enumerate() {
            let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                for (k, step) in numbers.iter().enumerate() {
                    let i = chunk * STEPS_PER_SUBMIT + k;
                    let update = update_last || i + 1 < steps;
                    for (call, size) in programs.of_step(self.sampled[i].0, update) {
                        call.encode(&mut pass, i, size.groups(step), &step_buffers.arguments);
                    }
                }
            }
            self.gpu.queue.submit([encoder.finish()]);
        }
        self.results(steps)
    }

    /// Reads the losses of a batch; enlarges the buffers if they overflowed.
    fn results(&mut self, steps: usize) -> Result<Vec<StepResult>, GpuError> {
        let Some(resident) = &self.resident else { return Ok(Vec::new()) };
        let step_buffers = &resident.step_buffers;
        let words = |bytes: usize| steps * bytes / 4;
        let read = self.gpu.read(&[
            (&step_buffers.results, words(size_of::<Outcome>())),
            (&step_buffers.part_terms, words(size_of::<PartTerms>())),
            (&step_buffers.control, CONTROL_WORDS as usize),
        ])?;
        let outcomes: &[Outcome] = bytemuck::cast_slice(&read[0]);
        let parts: &[PartTerms] = bytemuck::cast_slice(&read[1]);
        let seen = outcomes.iter().zip(parts).map(|(&outcome, &parts)| StepResult { outcome, parts }).collect();
        let [overflow, needed] = [OVERFLOW, NEEDED].map(|word| read[2][word as usize]);
        if overflow != 0 {
            self.gpu.write(&step_buffers.control, 0, &[0_u32; CONTROL_WORDS as usize]);
            self.reserve(needed as usize + needed as usize / 4)?;
        }
        Ok(seen)
    }

    /// Allocates buffers for `capacity` intersections, and prepares the calls that use them.
    fn reserve(&mut self, capacity: usize) -> Result<(), GpuError> {
        let Self { gpu, kernels, image_buffers, device_images, resident, .. } = self;
        let Some(resident) = resident else { return Ok(()) };
        self.capacity = resident.reserve(gpu, kernels, capacity, image_buffers, device_images)?;
        gpu.check()
    }

    /// Copies the state to the device.
    fn upload_state(&mut self) -> Result<(), GpuError> {
        let Self { gpu, state, .. } = self;
        let n = state.splats.len();
        let resident = match self.resident.take() {
            Some(resident) if resident.fits(state) => resident,
            old => Resident::new(gpu, state, MAX_BATCH, old)?,
        };
        resident.fill(gpu, state);
        let ready = !resident.programs.forward.is_empty();
        self.resident = Some(resident);
        if !ready {
            self.reserve(self.capacity.max(TILES_PER_GAUSSIAN * n))?;
        }
        self.gpu.check()
    }

    /// Copies the trained state back.
    fn download_state(&mut self) -> Result<(), GpuError> {
        let Some(resident) = &self.resident else { return Ok(()) };
        resident.fetch(&self.gpu, &mut self.state)
    }

    fn stats(&self, seen: &StepResult, view: usize) -> StepStats {
        let terms = self.terms(seen, view, &self.config.loss);
        let n = self.state.splats.len();
        let weight = f64::from(self.config.loss.opacity_entropy);
        let loss = terms.total
            + weight * f64::from(seen.outcome.entropy) / n as f64
            + f64::from(seen.parts.chamfer + seen.parts.centre);
        let psnr = psnr_of_mse(terms.mse);
        StepStats { step: self.state.step, total: self.config.total, loss, psnr, gaussians: n, terms }
    }

    fn terms(&self, seen: &StepResult, view: usize, config: &LossConfig) -> LossTerms {
        let device_image = &self.device_images[view];
        let area = (device_image.size[0] * device_image.size[1]) as f64;
        let [l1, squared, depth, mask] = seen.outcome.sums.map(f64::from);
        let mut terms = LossTerms {
            l1: l1 / (3.0 * area),
            mse: squared / (3.0 * area),
            depth: depth / device_image.depth_pixels(config) as f64,
            mask: mask / area,
            ..LossTerms::default()
        };
        if config.ssim > 0.0 {
            terms.ssim = (f64::from(seen.outcome.similarity) / 3.0 + area - device_image.windows(config) as f64) / area;
        }
        terms.weigh(config);
        terms
    }
}

/// Uploads the images, and allocates buffers for renderings of their size.
fn upload_images(gpu: &Gpu, images: &[TrainImage<'_>]) -> Result<(Vec<DeviceImage>, ImageBuffers), GpuError> {
    /// Images whose pixels are in staging memory at a time.
    const PER_UPLOAD: usize = 16;
    let mut device_images = Vec::with_capacity(images.len());
    for images in images.chunks(PER_UPLOAD) {
        for image in images {
            device_images.push(DeviceImage::new(gpu, image)?);
        }
        gpu.read(&[])?;
    }
    let image_buffers = ImageBuffers::new(gpu, images.iter().map(|image| [image.width, image.height]))?;
    Ok((device_images, image_buffers))
}

/// An error for states that this backend cannot train.
fn check_supported(state: &TrainState) -> Result<(), FitError> {
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
        check_supported(&state)?;
        self.state = state;
        if self.state.settling.is_some() {
            if !self.views.held.is_empty() {
                self.sampled.clear();
            }
            if let Some(fine) = self.views.settle() {
                self.resident = None;
                self.device_images.clear();
                (self.device_images, self.image_buffers) = upload_images(&self.gpu, &fine).map_err(device)?;
            }
        }
        self.upload_state().map_err(device)
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
        let (mut done, mut keep_running) = (0, true);
        while done < steps && keep_running {
            let count = self.batch.min(steps - done);
            let begun = Instant::now();
            let update = update_last || done + count < steps;
            let seen = self.batch(count, update).map_err(device)?;
            let took = begun.elapsed();
            for seen in seen.iter().take_while(|seen| seen.outcome.complete != 0.0) {
                let (view, _) = self.sampled.pop_front().unwrap_or_default();
                done += 1;
                self.state.step += 1;
                self.state.adam.count += usize::from(update_last || done < steps);
                if let Deformation::Articulated(articulated) = &mut self.state.deformation {
                    articulated.count_update();
                }
                let stats = self.stats(seen, view);
                keep_running &= on_step(stats).is_continue();
            }
            if took < BATCH_TIME {
                self.batch = (2 * self.batch).min(MAX_BATCH);
            } else if took > 4 * BATCH_TIME {
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
            let seen = self.evaluate(view, &colors).map_err(device)?;
            sum += psnr_of_mse(self.terms(&seen, view, &colors).mse);
        }
        Ok((!self.views.held.is_empty()).then(|| sum / self.views.held.len() as f64))
    }

    fn download(&mut self) -> Result<TrainState, FitError> {
        self.download_state().map_err(device)?;
        Ok(std::mem::take(&mut self.state))
    }
}

impl GpuBackend<'_> {
    /// Renders a view over black and computes its loss, without training.
    fn evaluate(&mut self, view: usize, loss: &LossConfig) -> Result<StepResult, GpuError> {
        loop {
            let step = self.step_uniform(0, (view, [0.0; 3]), loss);
            let Some(Resident { step_buffers, programs, .. }) = &self.resident else {
                return Err(GpuError::Failed("no state was uploaded".into()));
            };
            self.gpu.write(&step_buffers.steps, 0, &step::bytes(&[step]));
            let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                for (call, size) in programs.forward.iter().chain(&programs.compare[view]) {
                    call.encode(&mut pass, 0, size.groups(&step), &step_buffers.arguments);
                }
            }
            self.gpu.queue.submit([encoder.finish()]);
            if let Some(seen) = self.results(1)?.pop()
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
#[path = "published/membership_tests.rs"]
mod membership_tests;
