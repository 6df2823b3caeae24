//! Buffers on the device during training, and the calls of a step.

use crate::constants::{CONTROL_WORDS, WIDE_GROUP};
use crate::device_image::DeviceImage;
use crate::joints::Joints;
use crate::kernel::Call;
use crate::kernels::Kernels;
use crate::published::chamfer::Chamfer;
use crate::published::membership::{self, LearnedMembership, Shape};
use crate::scene::{Gaussians, ImageBuffers, Intersections, PLAIN, Program, Size, StepBuffers, backward, forward};
use crate::{Gpu, GpuError};
use artgs::fit::{Articulated, Deformation, Membership, TrainState};
use artgs::low_level::DualQuaternion;
use artgs_core::State;

/// Buffers on the device during training.
#[derive(Debug)]
pub(crate) struct Resident {
    pub(crate) step_buffers: StepBuffers,
    pub(crate) gaussians: Gaussians,
    pub(crate) joints: Option<Joints>,
    pub(crate) membership: Option<LearnedMembership>,
    pub(crate) chamfer: Option<Chamfer>,
    /// Buffers of intersections; kept while they are large enough.
    pub(crate) intersections: Option<Intersections>,
    pub(crate) programs: Programs,
}

/// The calls of a step, in order; empty until the buffers of intersections are allocated.
#[derive(Debug, Default)]
pub(crate) struct Programs {
    pub(crate) forward: Program,
    /// For each image.
    pub(crate) compare: Vec<Program>,
    pub(crate) backward: Program,
    pub(crate) adam: Program,
    /// Updates of motions and membership.
    pub(crate) joints: Program,
}

impl Programs {
    /// The calls of a step on an image, with or without an update of the Gaussians.
    pub(crate) fn of_step(&self, view: usize, update: bool) -> impl Iterator<Item = &(Call, Size)> {
        let adam = if update { &self.adam[..] } else { &[] };
        let learn = self.backward.iter().chain(adam).chain(&self.joints);
        self.forward.iter().chain(&self.compare[view]).chain(learn)
    }
}

/// The articulation of a state, if it has one.
fn articulated(state: &TrainState) -> Option<&Articulated> {
    match &state.deformation {
        Deformation::Articulated(articulated) => Some(articulated),
        Deformation::None => None,
    }
}

impl Resident {
    /// Arrays for a state, for `steps` steps uploaded together; reuses the buffers of `old` that do not depend on the Gaussians.
    pub(crate) fn new(gpu: &Gpu, state: &TrainState, steps: usize, old: Option<Self>) -> Result<Self, GpuError> {
        let (n, stride) = (state.splats.len(), state.splats.sh_stride());
        let articulated = articulated(state);
        let learn = articulated.is_some_and(|a| a.config().learn_joints);
        let parts = articulated.map_or(1, Articulated::parts);
        let shape = articulated.and_then(membership::module).map(Shape::new);
        let targets = articulated.and_then(Articulated::targets);
        let (chamfer, intersections) = old.map_or((None, None), |r| (r.chamfer, r.intersections));
        let motions = learn || shape.is_some() || targets.is_some();
        Ok(Self {
            step_buffers: StepBuffers::new(gpu, steps, parts)?,
            gaussians: Gaussians::new(gpu, n, stride, motions)?,
            joints: if learn { Some(Joints::new(gpu, parts)?) } else { None },
            membership: shape.map(|shape| LearnedMembership::new(gpu, n, shape)).transpose()?,
            chamfer: targets.map(|t| Chamfer::new(gpu, n, t, chamfer.as_ref())).transpose()?,
            intersections,
            programs: Programs::default(),
        })
    }

    /// Whether the buffers have the sizes that a state needs.
    pub(crate) fn fits(&self, state: &TrainState) -> bool {
        let articulated = articulated(state);
        let targets = match (&self.chamfer, articulated.and_then(Articulated::targets)) {
            (Some(chamfer), Some(targets)) => chamfer.is_for(targets),
            (chamfer, targets) => chamfer.is_none() && targets.is_none(),
        };
        self.gaussians.n == state.splats.len()
            && self.gaussians.sh_stride == state.splats.sh_stride()
            && self.joints.is_some() == articulated.is_some_and(|a| a.config().learn_joints)
            && self.step_buffers.parts == articulated.map_or(1, Articulated::parts)
            && self.membership.as_ref().map(|l| &l.shape)
                == articulated.and_then(membership::module).map(Shape::new).as_ref()
            && targets
    }

    /// Copies a state that it [`fits`](Self::fits) to the device.
    pub(crate) fn fill(&self, gpu: &Gpu, state: &TrainState) {
        let Self { gaussians, step_buffers, joints, membership, .. } = self;
        let TrainState { splats, adam, stats, .. } = state;
        gaussians.fill(gpu, splats, adam, stats);
        gpu.write(&step_buffers.control, 0, &[0_u32; CONTROL_WORDS as usize]);
        if let Some(articulated) = articulated(state) {
            if let Membership::Labels(labels) = &articulated.membership {
                gpu.write(&gaussians.labels, 0, &labels.iter().map(|&l| u32::from(l)).collect::<Vec<u32>>());
            }
            gpu.write(&step_buffers.motions, 0, &motions_of(&articulated.half_motions()));
            if let Some(joints) = joints {
                joints.fill(gpu, articulated);
            }
            if let (Some(membership), Some(module)) = (membership, membership::module(articulated)) {
                membership.fill(gpu, module);
            }
        }
    }

    /// Copies the trained state back.
    pub(crate) fn fetch(&self, gpu: &Gpu, state: &mut TrainState) -> Result<(), GpuError> {
        let TrainState { step, splats, adam, stats, deformation, .. } = state;
        self.gaussians.fetch(gpu, splats, adam, stats)?;
        if let Deformation::Articulated(articulated) = deformation {
            if let Some(joints) = &self.joints {
                joints.fetch(gpu, articulated)?;
            }
            if let Some(membership) = &self.membership {
                membership.fetch(gpu, articulated, *step)?;
            }
        }
        Ok(())
    }

    /// Buffers for at least `capacity` intersections, and the calls that use them; returns their capacity.
    pub(crate) fn reserve(
        &mut self,
        gpu: &Gpu,
        kernels: &Kernels,
        capacity: usize,
        image_buffers: &ImageBuffers,
        device_images: &[DeviceImage],
    ) -> Result<usize, GpuError> {
        let Self { step_buffers, gaussians, joints, membership, chamfer, intersections: kept, programs } = self;
        *programs = Programs::default();
        let intersections = match kept.take() {
            Some(intersections) if intersections.capacity >= capacity && intersections.tiles >= image_buffers.tiles => {
                intersections
            }
            _ => Intersections::new(gpu, capacity, image_buffers.tiles, kernels.transfer.bucket())?,
        };
        let adam = [
            &step_buffers.steps,
            &gaussians.grads,
            &step_buffers.control,
            &gaussians.params,
            &gaussians.first,
            &gaussians.second,
        ];
        let floats = gaussians.n * (PLAIN + gaussians.sh_stride);
        let compare =
            |device_image: &DeviceImage| device_image.compare(gpu, kernels, gaussians, image_buffers, step_buffers);
        let motions = membership.as_ref().map_or(&step_buffers.motions, |l| &l.blended);
        let drawn = forward(gpu, kernels, gaussians, motions, &intersections, image_buffers, step_buffers);
        let mut back = backward(gpu, kernels, gaussians, motions, &intersections, image_buffers, step_buffers);
        back.extend(chamfer.iter().flat_map(|c| c.program(gpu, kernels, gaussians, motions, step_buffers)));
        back.extend(membership.iter().flat_map(|l| l.backward(gpu, kernels, gaussians, step_buffers)));
        let assign = membership.iter().flat_map(|l| l.forward(gpu, kernels, gaussians, step_buffers));
        let weights = membership.as_ref().map_or(&gaussians.labels, |l| &l.weights);
        let moved = joints.iter().flat_map(|j| j.program(gpu, kernels, gaussians, weights, step_buffers));
        let assigned = membership.iter().flat_map(|l| l.update(gpu, kernels, step_buffers));
        *programs = Programs {
            forward: assign.chain(drawn).collect(),
            compare: device_images.iter().map(compare).collect(),
            backward: back,
            adam: vec![(kernels.adam.on(gpu, &adam), Size::Count(floats.div_ceil(WIDE_GROUP as usize)))],
            joints: moved.chain(assigned).collect(),
        };
        Ok(kept.insert(intersections).capacity)
    }
}

/// Unit real parts and dual parts of half motions towards both states.
fn motions_of(half_motions: &[DualQuaternion]) -> Vec<[f32; 4]> {
    let towards = |state: State| {
        half_motions.iter().flat_map(move |m| {
            let sign = if state == State::START { -1.0 } else { 1.0 };
            let length = m
                .real
                .iter()
                .map(|c| c * c)
                .sum::<f64>()
                .sqrt()
                .max(artgs::low_level::kernel_constants::MOTION_LENGTH_MIN);
            let unit = |q: [f64; 4]| std::array::from_fn(|i| (if i > 0 { sign * q[i] } else { q[i] } / length) as f32);
            [unit(m.real), unit(m.dual)]
        })
    };
    State::ALL.into_iter().flat_map(towards).collect()
}
