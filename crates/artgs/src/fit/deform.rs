//! Canonical Gaussians of moving parts: rendered at the state of each image, with gradients for the
//! motions of the parts and for which Gaussian belongs to which.

use super::schedule::LogLinear;
use crate::articulation::adam::{Adam, corrections};
use crate::articulation::{DualQuaternion, MotionModel, MotionParameters, Skin};
use crate::articulation::{Warp, WarpGradients, WarpInput};
use crate::published::{Assignment, ChamferTargets};
use artgs_core::{Rigid, Splats, State};
use artgs_raster::{Colors, ShFrames, SplatGrads, SplatView};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::sync::Arc;

/// Most parameters a motion has.
const MOST: usize = 8;

/// Which part every Gaussian belongs to.
#[derive(Clone, Debug)]
pub enum Membership {
    /// Fixed parts, `[n]`, below K.
    Labels(Vec<u16>),
    /// Learnt with everything else.
    Learned(Box<Assignment>),
}

/// How parts and their motions are trained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeformConfig {
    /// True derivatives of the warp; see [`Warp::exact`].
    pub exact: bool,
    /// Turn colours with the parts.
    pub rotate_sh: bool,
    /// Update the motions.
    pub learn_joints: bool,
    /// Rate of the motions' parameters; of lengths per `length_unit`.
    pub joint_rate: LogLinear,
    /// Rate of a learnt membership.
    pub assign_rate: LogLinear,
    /// Scene units that count as 1.
    pub length_unit: f64,
    /// Weight of the Chamfer term, lengths in `length_unit`; it trains motions and membership only.
    pub chamfer: f64,
    /// The Chamfer term acts at steps strictly between these.
    pub chamfer_steps: [usize; 2],
    /// The pull of centres to their parts acts after this step.
    pub centre_after: usize,
}

/// Parts, their motions and the optimisers of both.
#[derive(Clone, Debug)]
pub struct Articulated {
    /// Part of every Gaussian.
    pub membership: Membership,
    /// Half motions of the movable parts, `[K - 1]`, as seen from `middles`.
    pub(super) joints: Vec<MotionParameters>,
    /// Points about which motions are optimised, `[K - 1]`.
    middles: Vec<DVec3>,
    config: DeformConfig,
    targets: Option<Arc<ChamferTargets>>,
    moments: Vec<Adam>,
    updates: u32,
    rng: Pcg64Mcg,
}

/// Scratch memory of a training device for [`Articulated`], and the gradients of one step.
#[derive(Debug, Default)]
pub struct DeformWorkspace {
    means: Vec<[f32; 3]>,
    rotations: Vec<[f32; 4]>,
    weights: Vec<f32>,
    d_weights: Vec<f32>,
    labels: Vec<u16>,
    world_to_frame: Vec<[[f32; 3]; 3]>,
    motions: Vec<DualQuaternion>,
    d_motions: Vec<DualQuaternion>,
    d_means: Vec<[f32; 3]>,
    d_rotations: Vec<[f32; 4]>,
    /// Gradients of the Chamfer term by warped centres, and what the warp makes of them.
    chamfer: Chamfer,
    /// Gradients by the parameters of the motions, `[K - 1]`.
    pub(crate) d_joints: Vec<[f64; MOST]>,
}

/// The motion of a part as its optimiser sees it, for devices that train it elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointState {
    /// Which motions are possible.
    pub model: MotionModel,
    /// Parameters in the order given at [`MotionModel`], as seen from `middle`; zeros beyond those it has.
    pub values: [f64; MOST],
    /// First and second moments of the parameters.
    pub moments: [[f64; 2]; MOST],
    /// Point about which the motion is optimised, scene units.
    pub middle: DVec3,
}

#[derive(Debug, Default)]
struct Chamfer {
    d_warped: Vec<[f32; 3]>,
    zeros: Vec<[f32; 4]>,
    d_means: Vec<[f32; 3]>,
    d_weights: Vec<f32>,
    d_motions: Vec<DualQuaternion>,
    sums: Vec<f64>,
}

impl Articulated {
    /// Fresh optimisers. `joints` are half motions of the movable parts, `[K - 1]`: part `k` has entry `k - 1`. They are
    /// optimised as seen from `middles`, which should be near the parts: there, turns and shifts hardly mix. `seed` decides
    /// the noise of a learnt membership; `targets` are for the Chamfer term.
    pub fn new(
        membership: Membership,
        joints: Vec<MotionParameters>,
        middles: Vec<DVec3>,
        targets: Option<Arc<ChamferTargets>>,
        config: DeformConfig,
        seed: u64,
    ) -> Self {
        assert_eq!(joints.len(), middles.len(), "every joint has a middle");
        let moments = joints.iter().map(|j| Adam::new(j.values().len())).collect();
        let local = |(joint, middle): (MotionParameters, &DVec3)| {
            let mut joint = joint.shifted(-*middle);
            if *middle != DVec3::ZERO {
                joint.fix_gauge(DVec3::ZERO);
            }
            joint
        };
        let joints = joints.into_iter().zip(&middles).map(local).collect();
        Self { membership, joints, middles, config, targets, moments, updates: 0, rng: Pcg64Mcg::seed_from_u64(seed) }
    }

    /// Half motions of the movable parts, `[K - 1]`, world frame.
    pub fn joints(&self) -> Vec<MotionParameters> {
        self.joints.iter().zip(&self.middles).map(|(joint, &middle)| joint.clone().shifted(middle)).collect()
    }

    /// How it is trained.
    pub fn config(&self) -> &DeformConfig {
        &self.config
    }

    /// Where the Chamfer term pulls Gaussians to, if it acts at some step.
    pub fn targets(&self) -> Option<&Arc<ChamferTargets>> {
        self.targets.as_ref().filter(|_| self.config.chamfer > 0.0)
    }

    /// Seed of the noise of a learnt membership for a device that draws its own.
    pub fn noise_seed(&self) -> u64 {
        self.rng.clone().random()
    }

    /// Half motions of all parts as dual quaternions, `[K]`, the static one first, world frame.
    pub fn half_motions(&self) -> Vec<DualQuaternion> {
        let mut out = Vec::new();
        half_motions(&self.joints, &mut out);
        for (motion, middle) in out[1..].iter_mut().zip(&self.middles) {
            *motion = motion.shifted(middle.to_array());
        }
        out
    }

    /// Motions and their optimisers, `[K - 1]`.
    pub fn joint_states(&self) -> Vec<JointState> {
        let pairs = self.joints.iter().zip(&self.moments).zip(&self.middles);
        let padded = |values: &[f64]| std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0));
        pairs
            .map(|((joint, adam), &middle)| JointState {
                model: joint.model(),
                values: padded(joint.values()),
                moments: std::array::from_fn(|i| adam.moments().get(i).copied().unwrap_or_default()),
                middle,
            })
            .collect()
    }

    /// Takes over values and moments that [`joint_states`](Self::joint_states) has given out.
    pub fn set_joint_states(&mut self, states: &[JointState]) {
        for ((joint, adam), state) in self.joints.iter_mut().zip(&mut self.moments).zip(states) {
            joint.values_mut().iter_mut().zip(state.values).for_each(|(to, v)| *to = v);
            adam.moments_mut().iter_mut().zip(state.moments).for_each(|(to, m)| *to = m);
        }
    }

    /// Counts an update of motions and membership that was made elsewhere.
    pub fn count_update(&mut self) {
        self.updates += u32::from(self.config.learn_joints);
        if let Membership::Learned(assignment) = &mut self.membership
            && let Assignment::Centres(module) = &mut **assignment
        {
            module.count_step();
        }
    }

    /// Bias corrections `1 - beta^t` of the `ahead`-th update of the motions from here on.
    pub fn corrections(&self, ahead: u32) -> [f64; 2] {
        corrections(self.updates + ahead)
    }

    /// Number of parts, the static one included.
    pub fn parts(&self) -> usize {
        self.joints.len() + 1
    }

    /// Moves canonical Gaussians to a state for training step `step`.
    pub fn forward(&mut self, splats: &Splats, state: State, step: usize, work: &mut DeformWorkspace) {
        let (n, parts) = (splats.len(), self.parts());
        half_motions(&self.joints, &mut work.motions);
        for (motion, middle) in work.motions[1..].iter_mut().zip(&self.middles) {
            *motion = motion.shifted(middle.to_array());
        }
        if let Membership::Learned(assignment) = &mut self.membership {
            work.weights.resize(n * parts, 0.0);
            assignment.forward(&splats.means, step, &mut self.rng, &mut work.weights);
            if self.config.rotate_sh {
                work.labels.clear();
                work.labels.extend(work.weights.chunks_exact(parts).map(heaviest));
            }
        }
        if self.config.rotate_sh {
            sh_frames(&work.motions, state, &mut work.world_to_frame);
        }
        work.means.resize(n, [0.0; 3]);
        work.rotations.resize(n, [0.0; 4]);
        let skin = skin(&self.membership, &work.weights);
        let input =
            WarpInput { means: &splats.means, rotations: &splats.rotations, skin, motions: &work.motions, state };
        Warp::new(self.config.exact).forward(&input, &mut work.means, &mut work.rotations);
    }

    /// What the last [`forward`](Self::forward) of `splats` left to draw.
    pub fn view<'a>(&'a self, splats: &'a Splats, work: &'a DeformWorkspace) -> SplatView<'a> {
        let index = match &self.membership {
            Membership::Labels(labels) => labels,
            Membership::Learned(_) => &work.labels,
        };
        let frames = self.config.rotate_sh.then_some(ShFrames { index, world_to_frame: &work.world_to_frame });
        let colors = Colors::Sh { sh: &splats.sh, degree: splats.sh_degree, frames };
        SplatView { means: &work.means, rotations: &work.rotations, colors, ..SplatView::from(splats) }
    }

    /// Takes the gradients of the drawn Gaussians in `grads` to the canonical ones, and to motions and membership, and
    /// adds the terms that act on the parts alone. Returns the weighted sum of those.
    pub fn backward(
        &mut self,
        splats: &Splats,
        state: State,
        step: usize,
        warp: &mut Warp,
        grads: &mut SplatGrads,
        work: &mut DeformWorkspace,
    ) -> f64 {
        let (n, parts) = (splats.len(), self.parts());
        let learned = matches!(self.membership, Membership::Learned(_));
        work.d_means.resize(n, [0.0; 3]);
        work.d_rotations.resize(n, [0.0; 4]);
        work.d_weights.resize(if learned { n * parts } else { 0 }, 0.0);
        work.d_motions.resize(parts, DualQuaternion::default());
        warp.exact = self.config.exact;
        let input = WarpInput {
            means: &splats.means,
            rotations: &splats.rotations,
            skin: skin(&self.membership, &work.weights),
            motions: &work.motions,
            state,
        };
        let out = WarpGradients {
            means: &mut work.d_means,
            rotations: &mut work.d_rotations,
            weights: learned.then_some(&mut work.d_weights),
            motions: &mut work.d_motions,
        };
        warp.backward(&input, &grads.means, &grads.rotations, out);
        std::mem::swap(&mut grads.means, &mut work.d_means);
        std::mem::swap(&mut grads.rotations, &mut work.d_rotations);
        let mut extra = self.chamfer(splats, state, step, warp, work);
        if let Membership::Learned(assignment) = &mut self.membership {
            if step > self.config.centre_after {
                extra += assignment.centre_regulariser(splats, &work.weights, &mut work.d_weights);
            }
            assignment.backward(&work.d_weights);
        }
        work.d_joints.resize(self.joints.len(), [0.0; MOST]);
        for (k, joint) in self.joints.iter().enumerate() {
            let d_local = work.d_motions[k + 1].shifted_vjp(self.middles[k].to_array());
            joint.vjp(&d_local, &mut work.d_joints[k][..joint.values().len()]);
        }
        extra
    }

    /// The Chamfer term, if it acts: adds its gradients by motions and weights.
    fn chamfer(&self, splats: &Splats, state: State, step: usize, warp: &mut Warp, work: &mut DeformWorkspace) -> f64 {
        let [after, before] = self.config.chamfer_steps;
        let Some(targets) = &self.targets else { return 0.0 };
        if self.config.chamfer <= 0.0 || step <= after || step >= before {
            return 0.0;
        }
        let n = splats.len();
        let learned = matches!(self.membership, Membership::Learned(_));
        let Chamfer { d_warped, zeros, d_means, d_weights, d_motions, sums } = &mut work.chamfer;
        d_warped.resize(n, [0.0; 3]);
        zeros.resize(n, [0.0; 4]);
        zeros.fill([0.0; 4]);
        d_means.resize(n, [0.0; 3]);
        d_weights.resize(work.d_weights.len(), 0.0);
        d_motions.resize(work.d_motions.len(), DualQuaternion::default());
        let weight = self.config.chamfer / self.config.length_unit.powi(2);
        let loss = targets.evaluate(state, &work.means, weight, d_warped, sums);
        let input = WarpInput {
            means: &splats.means,
            rotations: &splats.rotations,
            skin: skin(&self.membership, &work.weights),
            motions: &work.motions,
            state,
        };
        let out = WarpGradients {
            means: d_means,
            rotations: &mut work.d_rotations,
            weights: learned.then_some(&mut d_weights[..]),
            motions: d_motions,
        };
        warp.backward(&input, d_warped, zeros, out);
        work.d_weights.iter_mut().zip(&*d_weights).for_each(|(total, d)| *total += d);
        work.d_motions.iter_mut().zip(&*d_motions).for_each(|(total, d)| total.add_scaled(d, 1.0));
        loss
    }

    /// One optimiser step of motions and membership with the gradients of the last [`backward`](Self::backward).
    pub fn update(&mut self, step: usize, work: &DeformWorkspace) {
        if let Membership::Learned(assignment) = &mut self.membership {
            assignment.step(self.config.assign_rate.at(step));
        }
        if !self.config.learn_joints {
            return;
        }
        self.updates += 1;
        let (rate, correction) = (self.config.joint_rate.at(step), corrections(self.updates));
        for ((joint, adam), gradient) in self.joints.iter_mut().zip(&mut self.moments).zip(&work.d_joints) {
            // One Gaussian out of numbers must not take its joint along.
            if gradient.iter().any(|g| !g.is_finite()) {
                continue;
            }
            let model = joint.model();
            for (i, value) in joint.values_mut().iter_mut().enumerate() {
                let unit = if model.is_length(i) { self.config.length_unit } else { 1.0 };
                *value -= rate * unit * adam.update(i, gradient[i], correction);
            }
        }
    }

    /// Follows a change of the set of Gaussians: the new one `i` descends from the old one `parents[i]`.
    pub fn follow(&mut self, parents: &[usize]) {
        if let Membership::Labels(labels) = &mut self.membership {
            *labels = parents.iter().map(|&i| labels[i]).collect();
        }
    }

    /// Part of every Gaussian, the most probable one where it is learnt.
    pub fn labels(&self, splats: &Splats) -> Vec<u16> {
        match &self.membership {
            Membership::Labels(labels) => labels.clone(),
            Membership::Learned(assignment) => assignment.labels(&splats.means),
        }
    }
}

fn skin<'a>(membership: &'a Membership, weights: &'a [f32]) -> Skin<'a> {
    match membership {
        Membership::Labels(labels) => Skin::Labels(labels),
        Membership::Learned(_) => Skin::Weights(weights),
    }
}

/// Half motions of all parts, `[K]`, the static one first.
pub(crate) fn half_motions(joints: &[MotionParameters], out: &mut Vec<DualQuaternion>) {
    out.clear();
    out.push(DualQuaternion::IDENTITY);
    out.extend(joints.iter().map(MotionParameters::dual_quaternion));
}

/// Rotations from the world at a state back to the canonical directions of every part, `[K]`, row-major.
pub(crate) fn sh_frames(motions: &[DualQuaternion], state: State, out: &mut Vec<[[f32; 3]; 3]>) {
    out.clear();
    out.extend(motions.iter().map(|motion| {
        let rotation = Rigid::from_dual_quaternion(motion.real, motion.dual).matrix();
        let back = if state == State::END { rotation.transpose() } else { rotation };
        let row = |i: usize| back.row(i).as_vec3().to_array();
        [row(0), row(1), row(2)]
    }));
}

/// Index of the largest weight.
fn heaviest(weights: &[f32]) -> u16 {
    let mut best = 0;
    for (k, w) in weights.iter().enumerate() {
        if *w > weights[best] {
            best = k;
        }
    }
    best as u16
}
