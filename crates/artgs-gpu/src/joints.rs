//! Motions of parts on the device: gradients and updates.

use crate::constants::{self, ARTICULATED, EXACT_WARP, LEARN_JOINTS, ROTATE_SH};
use crate::kernels::Kernels;
use crate::scene::{Gaussians, Program, Size, StepBuffers};
use crate::shared::shared_struct;
use crate::step::Step;
use crate::{Gpu, GpuError};
use artgs::fit::{Articulated, JointState};
use artgs::low_level::MotionModel;
use wgpu::Buffer;

/// Number of ranges of Gaussians whose gradients are summed in parallel.
pub(crate) const CHUNKS: u32 = 64;

shared_struct! {
    /// The motion of a part, its optimiser, and the point about which it is optimised.
    pub(crate) struct Joint {
        /// Parameters in the order of [`MotionModel`].
        values: [[f32; 4]; 2],
        /// Moments of the parameters.
        first: [[f32; 4]; 2],
        second: [[f32; 4]; 2],
        middle: [f32; 3],
        /// One of the constants `MODEL_*`.
        model: u32,
    }
}

/// Arrays of optimised motions.
#[derive(Debug)]
pub(crate) struct Joints {
    parts: usize,
    /// [`Joint`] of each movable part.
    values: Buffer,
    /// Gradients with respect to the motions, partial sums, `[K][CHUNKS][2]` quaternions.
    partial: Buffer,
}

/// Sets the fields of a step that the parts need. `done` updates have not been counted yet.
pub(crate) fn set_fields(step: &mut Step, articulated: &Articulated, number: usize, done: usize) {
    let config = articulated.config();
    step.parts = articulated.parts() as u32;
    step.flags |= ARTICULATED;
    for (set, flag) in [(config.exact, EXACT_WARP), (config.rotate_sh, ROTATE_SH), (config.learn_joints, LEARN_JOINTS)]
    {
        step.flags |= if set { flag } else { 0 };
    }
    step.chunks = CHUNKS;
    step.joint_rate = config.joint_rate.at(number) as f32;
    step.joint_corrections = articulated.corrections(done as u32 + 1).map(|c| c as f32);
    step.length_unit = config.length_unit as f32;
}

impl Joints {
    pub(crate) fn new(gpu: &Gpu, parts: usize) -> Result<Self, GpuError> {
        Ok(Self {
            parts,
            values: gpu.array("joints", parts, size_of::<Joint>())?,
            partial: gpu.array("gradients by motions, partial", 2 * parts * CHUNKS as usize, 16)?,
        })
    }

    /// Copies the motions and their moments to the device.
    pub(crate) fn fill(&self, gpu: &Gpu, articulated: &Articulated) {
        let halves = |v: [f32; 8]| [[v[0], v[1], v[2], v[3]], [v[4], v[5], v[6], v[7]]];
        let joint = |joint: JointState| Joint {
            values: halves(joint.values.map(|v| v as f32)),
            first: halves(joint.moments.map(|m| m[0] as f32)),
            second: halves(joint.moments.map(|m| m[1] as f32)),
            middle: joint.middle.as_vec3().to_array(),
            model: model_number(joint.model),
        };
        let joints: Vec<Joint> = articulated.joint_states().into_iter().map(joint).collect();
        gpu.write(&self.values, 0, &joints);
    }

    /// Copies the motions and their moments back.
    pub(crate) fn fetch(&self, gpu: &Gpu, articulated: &mut Articulated) -> Result<(), GpuError> {
        let words = size_of::<Joint>() / 4 * (self.parts - 1);
        let read = gpu.read(&[(&self.values, words)])?;
        let found: &[Joint] = bytemuck::cast_slice(&read[0]);
        let states: Vec<JointState> = articulated
            .joint_states()
            .into_iter()
            .zip(found)
            .map(|(joint, found)| {
                let [values, first, second] = [&found.values, &found.first, &found.second].map(|v| v.as_flattened());
                JointState {
                    values: std::array::from_fn(|i| f64::from(values[i])),
                    moments: std::array::from_fn(|i| [f64::from(first[i]), f64::from(second[i])]),
                    ..joint
                }
            })
            .collect();
        articulated.set_joint_states(&states);
        Ok(())
    }

    /// Updates the motions from the gradients with respect to the motion of every Gaussian. `weights` are those of the parts,
    /// or any array if parts have labels.
    pub(crate) fn program(
        &self,
        gpu: &Gpu,
        k: &Kernels,
        g: &Gaussians,
        weights: &Buffer,
        step_buffers: &StepBuffers,
    ) -> Program {
        let parts = self.parts as u32;
        let sums = [&step_buffers.steps, &g.labels, &g.d_motions, weights, &self.partial];
        let update = [&step_buffers.steps, &self.partial, &step_buffers.control, &self.values, &step_buffers.motions];
        vec![
            (k.sum_motions.on(gpu, &sums), Size::Grid([CHUNKS, parts, 1])),
            (k.update_joints.on(gpu, &update), Size::Count(1)),
        ]
    }
}

fn model_number(model: MotionModel) -> u32 {
    match model {
        MotionModel::Free => constants::MODEL_FREE,
        MotionModel::Prismatic => constants::MODEL_PRISMATIC,
        MotionModel::Hinge => constants::MODEL_HINGE,
        MotionModel::Screw => constants::MODEL_SCREW,
    }
}
