//! Adaptive density control of 3DGS: clone small, split large, prune faint Gaussians; reset opacities at intervals.

use super::adam::SplatAdam;
use crate::random::normal;
use artgs_core::Splats;
use artgs_raster::SplatGrads;
use glam::{Quat, Vec3};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// When and how the set of Gaussians changes. Steps are counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DensifyConfig {
    /// Acts at steps after this one.
    pub after: usize,
    /// Acts at steps before this one.
    pub before: usize,
    /// Acts at multiples of this many steps; 0 never.
    pub every: usize,
    /// Mean length of the screen-space gradient (normalised device units) from which a Gaussian is multiplied.
    pub grad_threshold: f32,
    /// Largest standard deviation, relative to the extent, up to which a Gaussian is cloned and not split.
    pub clone_scale: f32,
    /// Standard deviations of the two halves of a split Gaussian are divided by this.
    pub split_shrink: f32,
    /// Gaussians of a lower opacity are pruned.
    pub prune_opacity: f32,
    /// After this step Gaussians that are too large are pruned too, and the next opacity holds.
    pub late_after: usize,
    /// `prune_opacity` after `late_after`.
    pub late_prune_opacity: f32,
    /// Largest footprint radius in pixels; 0: unlimited.
    pub prune_radius_px: f32,
    /// Largest standard deviation, relative to the extent.
    pub prune_scale: f32,
    /// Opacities are reset at multiples of this many steps; 0 never.
    pub reset_every: usize,
    /// Opacities are at most this after a reset.
    pub reset_opacity: f32,
    /// The set does not grow beyond this; the largest gradients go first.
    pub max_gaussians: usize,
}

impl DensifyConfig {
    /// The first stage as published. Its limit of 20 pixels is not here: the program of 3DGS forgets the footprints before it
    /// compares them, so it prunes none for that.
    pub fn paper() -> Self {
        Self {
            after: 500,
            before: 15_000,
            every: 100,
            grad_threshold: 2e-4,
            clone_scale: 0.01,
            split_shrink: 1.6,
            prune_opacity: 0.005,
            late_after: 3000,
            late_prune_opacity: 0.005,
            prune_radius_px: 0.0,
            prune_scale: 0.1,
            reset_every: 3000,
            reset_opacity: 0.01,
            max_gaussians: u32::MAX as usize,
        }
    }

    /// True if the set changes at this step.
    pub fn acts_at(&self, step: usize) -> bool {
        self.every > 0 && step > self.after && step < self.before && step.is_multiple_of(self.every)
    }

    /// True if opacities are reset at this step.
    pub fn resets_at(&self, step: usize) -> bool {
        self.reset_every > 0 && step > 0 && step < self.before && step.is_multiple_of(self.reset_every)
    }
}

impl Default for DensifyConfig {
    /// For Gaussians that start on the surface: few are missing, so no resets, fewer births,
    /// none in the second half of the run: more or later births cost held-out quality there.
    fn default() -> Self {
        Self {
            after: 200,
            before: 601,
            grad_threshold: 1e-3,
            prune_opacity: 0.02,
            late_after: 400,
            late_prune_opacity: 0.02,
            reset_every: 0,
            max_gaussians: 120_000,
            ..Self::paper()
        }
    }
}

/// What was seen of each Gaussian since the last change of the set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DensifyStats {
    /// Sum of the lengths of screen-space gradients.
    pub grad: Vec<f32>,
    /// Number of renderings it was drawn in.
    pub count: Vec<u32>,
    /// Largest footprint, pixels.
    pub radius: Vec<f32>,
}

impl DensifyStats {
    /// Nothing seen of `n` Gaussians.
    pub fn zeros(n: usize) -> Self {
        Self { grad: vec![0.0; n], count: vec![0; n], radius: vec![0.0; n] }
    }

    /// Adds one rendering.
    pub fn add(&mut self, grads: &SplatGrads) {
        let seen = self.grad.par_iter_mut().zip(&mut self.count).zip(&mut self.radius);
        let new = grads.mean2d.par_iter().zip(&grads.radii);
        seen.zip(new).with_min_len(4096).for_each(|(((grad, count), radius), (&g, &r))| {
            if r > 0.0 {
                *grad += g;
                *count += 1;
                *radius = radius.max(r);
            }
        });
    }

    fn mean(&self, i: usize) -> f32 {
        self.grad[i] / self.count[i].max(1) as f32
    }
}

/// How many Gaussians came and went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DensifyReport {
    /// Copied.
    pub cloned: usize,
    /// Replaced by two.
    pub split: usize,
    /// Removed.
    pub pruned: usize,
}

/// Changes the set at `step`: clones, splits, prunes; the optimiser's moments follow, `stats` start again at 0. `extent` is
/// the size of the scene (largest distance of a camera from their mean) that sizes are relative to. Survivors keep
/// their order, followed by clones, then by halves. Also returns which of the old Gaussians each new one descends from.
pub(crate) fn densify(
    splats: &mut Splats,
    adam: &mut SplatAdam,
    stats: &mut DensifyStats,
    extent: f32,
    step: usize,
    config: &DensifyConfig,
    rng: &mut Pcg64Mcg,
) -> (DensifyReport, Vec<usize>) {
    let n = splats.len();
    let chosen = choose(stats, config, n);
    let large = |s: &Splats, i: usize, limit: f32| s.log_scales[i].iter().any(|v| v.exp() > limit * extent);
    let (split, cloned): (Vec<usize>, Vec<usize>) =
        chosen.into_iter().partition(|&i| large(splats, i, config.clone_scale));
    let mut gone = vec![false; n];
    split.iter().for_each(|&i| gone[i] = true);

    splats.extend_from(&splats.clone(), cloned.iter().copied());
    splats.extend_from(&halves(splats, &split, config.split_shrink, rng), 0..2 * split.len());

    let late = step > config.late_after;
    let opacity = if late { config.late_prune_opacity } else { config.prune_opacity };
    let faint = logit(opacity);
    let wide = |i: usize| i < n && config.prune_radius_px > 0.0 && stats.radius[i] > config.prune_radius_px;
    let prune = |i: usize| {
        let finite = splats.means[i].iter().chain(&splats.log_scales[i]).all(|v| v.is_finite());
        let too_large = late && (wide(i) || large(splats, i, config.prune_scale));
        splats.logit_opacities[i] < faint || too_large || !finite
    };
    let parents = splats.len() - 2 * split.len();
    let keep: Vec<usize> = (0..splats.len()).filter(|&i| (i >= n || !gone[i]) && !prune(i)).collect();
    let pruned = parents - split.len() + 2 * split.len() - keep.len();
    let rows: Vec<Option<usize>> = keep.iter().map(|&i| (i < n).then_some(i)).collect();
    let origin = |i: usize| match i - n.min(i) {
        _ if i < n => i,
        new if new < cloned.len() => cloned[new],
        new => split[(new - cloned.len()) % split.len()],
    };
    let origins = keep.iter().map(|&i| origin(i)).collect();
    *adam = adam.select(&rows);
    *splats = splats.select(keep);
    *stats = DensifyStats::zeros(splats.len());
    (DensifyReport { cloned: cloned.len(), split: split.len(), pruned }, origins)
}

/// Gaussians to multiply, in order: those above the threshold, or the foremost of them if there is no room for all.
fn choose(stats: &DensifyStats, config: &DensifyConfig, n: usize) -> Vec<usize> {
    let mut chosen: Vec<usize> = (0..n).filter(|&i| stats.mean(i) >= config.grad_threshold).collect();
    let room = config.max_gaussians.saturating_sub(n);
    if chosen.len() > room {
        chosen.sort_by(|&a, &b| stats.mean(b).total_cmp(&stats.mean(a)).then(a.cmp(&b)));
        chosen.truncate(room);
        chosen.sort_unstable();
    }
    chosen
}

/// Two smaller Gaussians for each of `parents`, centred at samples of it: all first halves, then all second.
fn halves(splats: &Splats, parents: &[usize], shrink: f32, rng: &mut Pcg64Mcg) -> Splats {
    let mut out = splats.select(parents.iter().chain(parents).copied());
    for i in 0..out.len() {
        let [w, x, y, z] = out.rotations[i];
        let rotation = Quat::from_xyzw(x, y, z, w).normalize();
        let scale = out.log_scales[i].map(f32::exp);
        let local = Vec3::from_array(scale.map(|s| s * normal(rng) as f32));
        out.means[i] = (Vec3::from_array(out.means[i]) + rotation * local).to_array();
        out.log_scales[i] = scale.map(|s| (s / shrink).ln());
    }
    out
}

/// Lowers every opacity to at most the configured one and forgets the moments of opacities.
pub(crate) fn reset_opacities(splats: &mut Splats, adam: &mut SplatAdam, config: &DensifyConfig) {
    let top = logit(config.reset_opacity);
    splats.logit_opacities.iter_mut().for_each(|l| *l = l.min(top));
    adam.logit_opacities.clear();
}

/// Inverse of the sigmoid.
pub(crate) fn logit(p: f32) -> f32 {
    (p / (1.0 - p)).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    /// Small and moving, large and moving, faint, quiet, huge.
    fn scene() -> (Splats, SplatAdam, DensifyStats) {
        let scale = |s: f32| [s.ln(), (s / 2.0).ln(), (s / 3.0).ln()];
        let splats = Splats {
            means: (0..5).map(|i| [i as f32, 0.0, 0.0]).collect(),
            rotations: vec![[2.0, 0.0, 0.0, 0.0]; 5],
            log_scales: vec![scale(0.005), scale(0.05), scale(0.005), scale(0.005), scale(0.5)],
            logit_opacities: vec![logit(0.5), logit(0.5), logit(0.001), logit(0.5), logit(0.5)],
            sh_degree: 0,
            sh: (0..15).map(|v| v as f32).collect(),
        };
        let mut adam = SplatAdam::new(&splats);
        adam.means.first = (0..15).map(|v| v as f32).collect();
        let stats = DensifyStats {
            grad: vec![6e-4, 9e-4, 0.0, 1e-4, 0.0],
            count: vec![2, 3, 0, 1, 1],
            radius: vec![3.0, 4.0, 0.0, 21.0, 5.0],
        };
        (splats, adam, stats)
    }

    #[test]
    fn clones_splits_and_prunes_by_the_rules() {
        let (mut splats, mut adam, mut stats) = scene();
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let (report, origins) =
            densify(&mut splats, &mut adam, &mut stats, 1.0, 600, &DensifyConfig::paper(), &mut rng);
        assert_eq!(origins, [0, 3, 4, 0, 1, 1]);
        assert_eq!(report, DensifyReport { cloned: 1, split: 1, pruned: 1 });
        assert_eq!(splats.means[..4], [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 0.0, 0.0]]);
        assert_eq!(splats.len(), 6);
        assert_eq!(adam.means.first[..9], [0.0, 1.0, 2.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0]);
        assert_eq!(adam.means.first[9..], [0.0; 9]);
        for half in 4..6 {
            assert!((splats.log_scales[half][0] - (0.05_f32 / 1.6).ln()).abs() < 1e-6);
            assert!((splats.means[half][0] - 1.0).abs() < 0.25 && splats.means[half][0] != 1.0);
            assert_eq!(splats.sh[3 * half], 3.0);
        }
        assert_eq!(stats, DensifyStats::zeros(6));
    }

    #[test]
    fn late_steps_prune_the_large_and_a_full_set_does_not_grow() {
        let (mut splats, mut adam, mut stats) = scene();
        let config = DensifyConfig { max_gaussians: 6, prune_radius_px: 20.0, ..DensifyConfig::paper() };
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let (report, _) = densify(&mut splats, &mut adam, &mut stats, 1.0, 3100, &config, &mut rng);
        assert_eq!((report.cloned + report.split, report.pruned), (1, 3));
        assert!(splats.means.iter().all(|m| m[0] < 2.0), "faint, wide on screen and huge ones are gone");

        // As published, no footprint is too wide.
        let (mut splats, mut adam, mut stats) = scene();
        densify(&mut splats, &mut adam, &mut stats, 1.0, 3100, &DensifyConfig::paper(), &mut rng);
        assert!(splats.means.iter().any(|m| m[0] == 3.0) && splats.means.iter().all(|m| m[0] < 4.0));
    }

    #[test]
    fn resets_lower_opacities_only() {
        let (mut splats, mut adam, _) = scene();
        adam.logit_opacities.first = vec![1.0; 5];
        reset_opacities(&mut splats, &mut adam, &DensifyConfig::paper());
        assert!((splats.logit_opacities[0] - logit(0.01)).abs() < 1e-6);
        assert_eq!(splats.logit_opacities[2], logit(0.001));
        assert_eq!(adam.logit_opacities.first, [0.0; 5]);
    }

    #[test]
    fn acts_at_the_published_steps() {
        let c = DensifyConfig::paper();
        let steps: Vec<usize> = (0..20_000).filter(|&s| c.acts_at(s)).collect();
        assert_eq!((steps[0], steps[steps.len() - 1], steps.len()), (600, 14_900, 144));
        assert_eq!((0..10_001).filter(|&s| c.resets_at(s)).collect::<Vec<_>>(), [3000, 6000, 9000]);
    }
}
