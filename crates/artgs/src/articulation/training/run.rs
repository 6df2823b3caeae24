//! The optimisation from a start to a trained object.

use super::config::ArticulateConfig;
use super::trained::Trained;
use crate::articulation::{MotionModel, MotionParameters};
use crate::fit::images::prepare;
use crate::fit::single::camera_extent;
use crate::fit::{
    Articulated, ChamferTargets, DeformConfig, Deformation, Devices, FitError, Follow, Membership, Region, RunPlan,
    TrainImage, TrainState, train,
};
use crate::published::Assignment;
use artgs_core::{PerState, Splats, State, View};
use glam::DVec3;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use std::sync::Arc;

/// What is known of the parts of the canonical Gaussians.
#[derive(Clone, Debug, PartialEq)]
pub enum SkinStart {
    /// Part of every Gaussian, `[n]`, below K. They stay; clones and halves inherit them.
    Labels(Vec<u16>),
    /// Where the parts are, `[K]` each, the static one first; Gaussians are assigned by training.
    Centres {
        /// Centres, scene units.
        centres: Vec<[f32; 3]>,
        /// Radii, positive, scene units.
        radii: Vec<f32>,
    },
}

/// Where the joint optimisation begins.
#[derive(Clone, Debug)]
pub struct Start {
    /// Canonical Gaussians.
    pub splats: Splats,
    /// Their parts.
    pub skin: SkinStart,
    /// Half motions of the movable parts, `[K - 1]`: part `k` has entry `k - 1`.
    pub joints: Vec<MotionParameters>,
}

impl Start {
    fn check(&self) -> Result<(), FitError> {
        let (n, parts) = (self.splats.len(), self.joints.len() + 1);
        let wrong = match &self.skin {
            _ if n == 0 => return Err(FitError::Empty),
            SkinStart::Labels(labels) if labels.len() != n => format!("{} labels for {n} Gaussians", labels.len()),
            SkinStart::Labels(labels) => match labels.iter().find(|&&l| usize::from(l) >= parts) {
                Some(label) => format!("label {label}, but there are {parts} parts"),
                None => return Ok(()),
            },
            SkinStart::Centres { centres, radii } if centres.len() != parts || radii.len() != parts => {
                format!("{} centres and {} radii for {parts} parts", centres.len(), radii.len())
            }
            SkinStart::Centres { radii, .. } if !radii.iter().all(|r| r.is_finite() && *r > 0.0) => {
                "a radius that is not positive".into()
            }
            SkinStart::Centres { .. } => return Ok(()),
        };
        Err(FitError::Start(wrong))
    }

    /// Middle of every movable part, `[K - 1]`; that of all Gaussians for a part without any.
    fn middles(&self) -> Vec<DVec3> {
        let position = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
        let whole = (DVec3::ZERO, 0);
        let add = |(sum, n): (DVec3, usize), p: &[f32; 3]| (sum + position(p), n + 1);
        let mean = |(sum, n): (DVec3, usize)| sum / n.max(1) as f64;
        match &self.skin {
            SkinStart::Centres { centres, .. } => centres[1..].iter().map(position).collect(),
            SkinStart::Labels(labels) => {
                let mut sums = vec![whole; self.joints.len() + 1];
                for (p, &label) in self.splats.means.iter().zip(labels) {
                    let sum = &mut sums[usize::from(label)];
                    *sum = add(*sum, p);
                }
                let all = mean(self.splats.means.iter().fold(whole, add));
                sums[1..].iter().map(|&s| if s.1 > 0 { mean(s) } else { all }).collect()
            }
        }
    }

    fn membership(&self, config: &ArticulateConfig, rng: &mut Pcg64Mcg) -> Membership {
        match &self.skin {
            SkinStart::Labels(labels) => Membership::Labels(labels.clone()),
            SkinStart::Centres { centres, radii } => {
                let bounds = bounds(&self.splats.means);
                let module = Assignment::new(config.assign.clone(), centres, radii, bounds, rng);
                Membership::Learned(Box::new(module))
            }
        }
    }
}

/// Least and greatest coordinates.
fn bounds(points: &[[f32; 3]]) -> [[f32; 3]; 2] {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (p, a) in points.iter().flat_map(|p| (0..3).map(move |a| (p, a))) {
        low[a] = low[a].min(p[a]);
        high[a] = high[a].max(p[a]);
    }
    [low, high]
}

/// Trains canonical Gaussians, and as configured parts and motions, on the views of both states.
/// `cd_targets`, centres of Gaussians fitted to each state alone, are for the Chamfer term and may be left out.
/// The same seed gives the same bytes on the processor.
pub fn articulate(
    views: PerState<&[View]>,
    start: Start,
    cd_targets: Option<&PerState<Vec<[f32; 3]>>>,
    config: &ArticulateConfig,
    seed: u64,
    devices: &dyn Devices,
    follow: &mut dyn Follow,
) -> Result<Trained, FitError> {
    start.check()?;
    if views.iter().any(|v| v.is_empty()) {
        return Err(FitError::NoViews);
    }
    let sides = views.iter().flat_map(|views| views.iter().map(|v| v.size().0.max(v.size().1)));
    let divisor = divisor(sides.max().unwrap_or(0), config.image_side);
    let prepared = |state: State| prepare(views[state], state, divisor, config.depth_pick);
    let images: Vec<TrainImage<'_>> = State::ALL.into_iter().flat_map(prepared).collect();
    let half_side = half_side(&images);
    let extent = camera_extent(&images).max(half_side);
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let state = train_state(start, cd_targets, config, half_side, &mut rng);
    let mut backend = devices.backend(images, config.train(extent, half_side), seed.wrapping_add(1))?;
    let ArticulateConfig { steps, plateau, update_always, densify, .. } = *config;
    let plan = RunPlan { steps, plateau, update_always, densify, extent: extent as f32 };
    let state = train(backend.as_mut(), state, &plan, &mut rng, follow)?;
    Ok(finish(state))
}

/// The integer factor that brings the longer side of an image nearest to `side` pixels; 1 for a side of 0.
fn divisor(longer: usize, side: usize) -> usize {
    (longer + side / 2).checked_div(side).map_or(1, |factor| factor.max(1))
}

/// Half the longest side of the region that the object fills in either state, scene units. Images are sorted by state.
fn half_side(images: &[TrainImage]) -> f64 {
    let of_state = images.chunk_by(|a, b| a.state == b.state).map(Region::of);
    of_state.reduce(|a, b| a.union(&b)).map_or(0.0, |region| region.half_side())
}

/// Step 0 of an optimisation.
pub(super) fn train_state(
    start: Start,
    cd_targets: Option<&PerState<Vec<[f32; 3]>>>,
    config: &ArticulateConfig,
    half_side: f64,
    rng: &mut Pcg64Mcg,
) -> TrainState {
    let membership = start.membership(config, rng);
    let middles = start.middles();
    let slides = start.joints.iter().any(|j| j.model() == MotionModel::Prismatic);
    let wanted = config.chamfer > 0.0 && !(config.chamfer_not_if_prismatic && slides);
    let targets = cd_targets.filter(|_| wanted).map(|points| Arc::new(ChamferTargets::new(points)));
    let deform = DeformConfig {
        exact: config.exact,
        rotate_sh: config.rotate_sh,
        learn_joints: config.learn_joints,
        joint_rate: config.joint_rate,
        assign_rate: config.assign_rate,
        length_unit: half_side,
        chamfer: config.chamfer,
        chamfer_steps: [config.chamfer_after, config.chamfer_before],
        centre_after: config.centre_after,
    };
    let noise = rand::RngExt::random(rng);
    let articulated = Articulated::new(membership, start.joints, middles, targets, deform, noise);
    TrainState { deformation: Deformation::Articulated(Box::new(articulated)), ..TrainState::new(start.splats) }
}

fn finish(state: TrainState) -> Trained {
    match state.deformation {
        Deformation::Articulated(articulated) => {
            let labels = articulated.labels(&state.splats);
            Trained { splats: state.splats, labels, joints: articulated.joints() }
        }
        Deformation::None => Trained { labels: vec![0; state.splats.len()], splats: state.splats, joints: Vec::new() },
    }
}

#[cfg(test)]
mod tests {
    use super::divisor;

    #[test]
    fn images_are_made_smaller_by_the_factor_nearest_to_the_wanted_side() {
        assert_eq!([800, 256, 240, 96, 0].map(|longer| divisor(longer, 100)), [8, 3, 2, 1, 1]);
        assert_eq!(divisor(4000, 0), 1);
    }
}
