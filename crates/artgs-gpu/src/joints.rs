//! Motions of parts on the device: their gradients, their updates.

use crate::kernels::Kernels;
use crate::scene::{Desk, Gaussians, Program, Size};
use crate::step::{self, Step};
use crate::{Gpu, GpuError};
use artgs::articulation::MotionModel;
use artgs::fit::{Articulated, JointState};
use wgpu::Buffer;

/// Stretches of Gaussians whose gradients are summed side by side.
pub(crate) const CHUNKS: u32 = 64;
/// Floats of a part in the array of the motions: values, first and second moments (8 each), middle, model, and four that
/// round it up.
const FLOATS: usize = 32;

/// Arrays for motions that are learnt.
#[derive(Debug)]
pub(crate) struct Joints {
    parts: usize,
    /// `[K - 1][FLOATS]`.
    values: Buffer,
    /// Gradients by the motions of stretches of Gaussians, `[K][CHUNKS][2]` quaternions.
    partial: Buffer,
}

/// Sets what a step needs to know of the parts. `done` updates have not been counted yet.
pub(crate) fn numbers(step: &mut Step, articulated: &Articulated, number: usize, done: usize) {
    let config = articulated.config();
    step.parts = articulated.parts() as u32;
    step.flags |= step::ARTICULATED;
    for (set, flag) in [
        (config.exact, step::EXACT_WARP),
        (config.rotate_sh, step::ROTATE_SH),
        (config.learn_joints, step::LEARN_JOINTS),
    ] {
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
            values: gpu.array("joints", FLOATS * parts, 4)?,
            partial: gpu.array("gradients by motions, partial", 2 * parts * CHUNKS as usize, 16)?,
        })
    }

    /// Puts the motions and their moments on the device.
    pub(crate) fn fill(&self, gpu: &Gpu, articulated: &Articulated) {
        let mut floats = Vec::with_capacity(FLOATS * self.parts);
        for joint in articulated.joint_states() {
            let at = floats.len();
            floats.extend(joint.values.map(|v| v as f32));
            floats.extend(joint.moments.map(|m| m[0] as f32));
            floats.extend(joint.moments.map(|m| m[1] as f32));
            floats.extend(joint.middle.as_vec3().to_array());
            floats.push(model_number(joint.model));
            floats.resize(at + FLOATS, 0.0);
        }
        gpu.write(&self.values, 0, &floats);
    }

    /// Takes the motions and their moments back.
    pub(crate) fn fetch(&self, gpu: &Gpu, articulated: &mut Articulated) -> Result<(), GpuError> {
        let read = gpu.read(&[(&self.values, FLOATS * (self.parts - 1))])?;
        let floats: &[f32] = bytemuck::cast_slice(&read[0]);
        let states: Vec<JointState> = articulated
            .joint_states()
            .into_iter()
            .zip(floats.chunks_exact(FLOATS))
            .map(|(joint, f)| JointState {
                values: std::array::from_fn(|i| f64::from(f[i])),
                moments: std::array::from_fn(|i| [f64::from(f[8 + i]), f64::from(f[16 + i])]),
                ..joint
            })
            .collect();
        articulated.set_joint_states(&states);
        Ok(())
    }

    /// From the gradients by the motion of every Gaussian to the motions of the next step; `weights` of the parts, anything
    /// where there are none.
    pub(crate) fn program(&self, gpu: &Gpu, k: &Kernels, g: &Gaussians, weights: &Buffer, desk: &Desk) -> Program {
        let parts = self.parts as u32;
        let sums = [&desk.steps, &g.labels, &g.d_motions, weights, &self.partial];
        let update = [&desk.steps, &self.partial, &desk.control, &self.values, &desk.motions];
        vec![
            (k.sum_motions.on(gpu, &sums), Size::Grid([CHUNKS, parts, 1])),
            (k.update_joints.on(gpu, &update), Size::Count(1)),
        ]
    }
}

/// How a kernel tells models apart.
fn model_number(model: MotionModel) -> f32 {
    match model {
        MotionModel::Free => 0.0,
        MotionModel::Prismatic => 1.0,
        MotionModel::Hinge => 2.0,
        MotionModel::Screw => 3.0,
    }
}
