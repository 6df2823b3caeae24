//! What is on the device while it trains, and the calls of a step on it.

use crate::chamfer::Chamfer;
use crate::constants::{CONTROL_WORDS, WIDE_GROUP};
use crate::joints::Joints;
use crate::kernel::Call;
use crate::kernels::Kernels;
use crate::learnt::{self, Learnt, Shape};
use crate::picture::Picture;
use crate::scene::{Canvas, Desk, Gaussians, PLAIN, Program, Room, Size, backward, forward};
use crate::{Gpu, GpuError};
use artgs::articulation::DualQuaternion;
use artgs::fit::{Articulated, Deformation, Membership, TrainState};

/// What is on the device while it trains.
#[derive(Debug)]
pub(crate) struct Resident {
    pub(crate) desk: Desk,
    pub(crate) gaussians: Gaussians,
    pub(crate) joints: Option<Joints>,
    pub(crate) learnt: Option<Learnt>,
    pub(crate) chamfer: Option<Chamfer>,
    /// For intersections; kept while it is large enough.
    pub(crate) room: Option<Room>,
    pub(crate) programs: Programs,
}

/// The calls of a step, in order; empty until there is room for intersections.
#[derive(Debug, Default)]
pub(crate) struct Programs {
    pub(crate) forward: Program,
    /// For each photograph.
    pub(crate) compare: Vec<Program>,
    pub(crate) backward: Program,
    pub(crate) adam: Program,
    /// Updates of motions and membership.
    pub(crate) joints: Program,
}

impl Programs {
    /// The calls of a step on a photograph, with or without an update of the Gaussians.
    pub(crate) fn of_step(&self, view: usize, update: bool) -> impl Iterator<Item = &(Call, Size)> {
        let adam = if update { &self.adam[..] } else { &[] };
        let learn = self.backward.iter().chain(adam).chain(&self.joints);
        self.forward.iter().chain(&self.compare[view]).chain(learn)
    }
}

/// How the Gaussians of a state move, if they do.
fn articulated(state: &TrainState) -> Option<&Articulated> {
    match &state.deformation {
        Deformation::Articulated(articulated) => Some(articulated),
        Deformation::None => None,
    }
}

impl Resident {
    /// Arrays for a state, for `steps` steps uploaded together; takes over from `old` what does not depend on the Gaussians.
    pub(crate) fn new(gpu: &Gpu, state: &TrainState, steps: usize, old: Option<Self>) -> Result<Self, GpuError> {
        let (n, stride) = (state.splats.len(), state.splats.sh_stride());
        let articulated = articulated(state);
        let learn = articulated.is_some_and(|a| a.config().learn_joints);
        let parts = articulated.map_or(1, Articulated::parts);
        let shape = articulated.and_then(learnt::module).map(Shape::new);
        let targets = articulated.and_then(Articulated::targets);
        let (chamfer, room) = old.map_or((None, None), |r| (r.chamfer, r.room));
        let motions = learn || shape.is_some() || targets.is_some();
        Ok(Self {
            desk: Desk::new(gpu, steps, parts)?,
            gaussians: Gaussians::new(gpu, n, stride, motions)?,
            joints: if learn { Some(Joints::new(gpu, parts)?) } else { None },
            learnt: shape.map(|shape| Learnt::new(gpu, n, shape)).transpose()?,
            chamfer: targets.map(|t| Chamfer::new(gpu, n, t, chamfer.as_ref())).transpose()?,
            room,
            programs: Programs::default(),
        })
    }

    /// Whether its arrays are those that a state needs.
    pub(crate) fn fits(&self, state: &TrainState) -> bool {
        let articulated = articulated(state);
        let targets = match (&self.chamfer, articulated.and_then(Articulated::targets)) {
            (Some(chamfer), Some(targets)) => chamfer.is_for(targets),
            (chamfer, targets) => chamfer.is_none() && targets.is_none(),
        };
        self.gaussians.n == state.splats.len()
            && self.gaussians.sh_stride == state.splats.sh_stride()
            && self.joints.is_some() == articulated.is_some_and(|a| a.config().learn_joints)
            && self.desk.parts == articulated.map_or(1, Articulated::parts)
            && self.learnt.as_ref().map(|l| &l.shape) == articulated.and_then(learnt::module).map(Shape::new).as_ref()
            && targets
    }

    /// Puts a state that it [`fits`](Self::fits) on the device.
    pub(crate) fn fill(&self, gpu: &Gpu, state: &TrainState) {
        let Self { gaussians, desk, joints, learnt, .. } = self;
        let TrainState { splats, adam, stats, .. } = state;
        gaussians.fill(gpu, splats, adam, stats);
        gpu.write(&desk.control, 0, &[0_u32; CONTROL_WORDS as usize]);
        if let Some(articulated) = articulated(state) {
            if let Membership::Labels(labels) = &articulated.membership {
                gpu.write(&gaussians.labels, 0, &labels.iter().map(|&l| u32::from(l)).collect::<Vec<u32>>());
            }
            gpu.write(&desk.motions, 0, &motions_of(&articulated.half_motions()));
            if let Some(joints) = joints {
                joints.fill(gpu, articulated);
            }
            if let (Some(learnt), Some(module)) = (learnt, learnt::module(articulated)) {
                learnt.fill(gpu, module);
            }
        }
    }

    /// Takes back what has become of it.
    pub(crate) fn fetch(&self, gpu: &Gpu, state: &mut TrainState) -> Result<(), GpuError> {
        let TrainState { step, splats, adam, stats, deformation, .. } = state;
        self.gaussians.fetch(gpu, splats, adam, stats)?;
        if let Deformation::Articulated(articulated) = deformation {
            if let Some(joints) = &self.joints {
                joints.fetch(gpu, articulated)?;
            }
            if let Some(learnt) = &self.learnt {
                learnt.fetch(gpu, articulated, *step)?;
            }
        }
        Ok(())
    }

    /// Room for at least `capacity` intersections, and the calls that use it; returns how many there is room for.
    pub(crate) fn make_room(
        &mut self,
        gpu: &Gpu,
        kernels: &Kernels,
        capacity: usize,
        canvas: &Canvas,
        pictures: &[Picture],
    ) -> Result<usize, GpuError> {
        let Self { desk, gaussians, joints, learnt, chamfer, room: kept, programs } = self;
        *programs = Programs::default();
        let room = match kept.take() {
            Some(room) if room.capacity >= capacity && room.tiles >= canvas.tiles => room,
            _ => Room::new(gpu, capacity, canvas.tiles, kernels.walk.bucket())?,
        };
        let adam =
            [&desk.steps, &gaussians.grads, &desk.control, &gaussians.params, &gaussians.first, &gaussians.second];
        let floats = gaussians.n * (PLAIN + gaussians.sh_stride);
        let compare = |picture: &Picture| picture.compare(gpu, kernels, gaussians, canvas, desk);
        let motions = learnt.as_ref().map_or(&desk.motions, |l| &l.blended);
        let drawn = forward(gpu, kernels, gaussians, motions, &room, canvas, desk);
        let mut back = backward(gpu, kernels, gaussians, motions, &room, canvas, desk);
        back.extend(chamfer.iter().flat_map(|c| c.program(gpu, kernels, gaussians, motions, desk)));
        back.extend(learnt.iter().flat_map(|l| l.backward(gpu, kernels, gaussians, desk)));
        let assign = learnt.iter().flat_map(|l| l.forward(gpu, kernels, gaussians, desk));
        let weights = learnt.as_ref().map_or(&gaussians.labels, |l| &l.weights);
        let moved = joints.iter().flat_map(|j| j.program(gpu, kernels, gaussians, weights, desk));
        let assigned = learnt.iter().flat_map(|l| l.update(gpu, kernels, desk));
        *programs = Programs {
            forward: assign.chain(drawn).collect(),
            compare: pictures.iter().map(compare).collect(),
            backward: back,
            adam: vec![(kernels.adam.on(gpu, &adam), Size::Count(floats.div_ceil(WIDE_GROUP as usize)))],
            joints: moved.chain(assigned).collect(),
        };
        Ok(kept.insert(room).capacity)
    }
}

/// Unit real parts and dual parts of half motions towards both states.
fn motions_of(half_motions: &[DualQuaternion]) -> Vec<[f32; 4]> {
    let towards = |state: usize| {
        half_motions.iter().flat_map(move |m| {
            let sign = if state == 0 { -1.0 } else { 1.0 };
            let length =
                m.real.iter().map(|c| c * c).sum::<f64>().sqrt().max(artgs::kernel_constants::MOTION_LENGTH_MIN);
            let unit = |q: [f64; 4]| std::array::from_fn(|i| (if i > 0 { sign * q[i] } else { q[i] } / length) as f32);
            [unit(m.real), unit(m.dual)]
        })
    };
    towards(0).chain(towards(1)).collect()
}
