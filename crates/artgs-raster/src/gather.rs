//! Sums the gradients of the intersections per Gaussian and computes the gradients of its parameters.

use crate::bin::Bins;
use crate::blend::Cell;
use crate::project::{Flat, Gradient, View};
use crate::{Colors, SplatGrads, SplatView};
use rayon::prelude::*;

/// Gaussians handled by one task at least.
const GRAIN: usize = 256;
/// Gaussians whose intersections are fetched together, so that their loads overlap.
const BATCH: usize = 32;

/// The gradients of consecutive Gaussians.
struct Part<'a> {
    first: usize,
    sh_stride: usize,
    means: &'a mut [[f32; 3]],
    rotations: &'a mut [[f32; 4]],
    log_scales: &'a mut [[f32; 3]],
    logit_opacities: &'a mut [f32],
    sh: &'a mut [f32],
    mean2d: &'a mut [f32],
    radii: &'a mut [f32],
}

/// Overwrites `grads`. Every sum is in the order of the tiles on any number of threads.
pub(crate) fn gather(
    view: &View,
    splats: &SplatView<'_>,
    flats: &[Flat],
    bins: &Bins,
    cells: &[Cell],
    grads: &mut SplatGrads,
) {
    let all = Part::new(splats, grads);
    rayon::iter::split(all, Part::split).for_each(|part| part.fill(view, splats, flats, bins, cells));
}

impl<'a> Part<'a> {
    fn new(splats: &SplatView<'_>, grads: &'a mut SplatGrads) -> Self {
        let n = splats.means.len();
        let sh_stride = match splats.colors {
            Colors::Sh { degree, .. } => 3 * (degree + 1) * (degree + 1),
            Colors::Fixed(_) => 0,
        };
        grads.means.resize(n, [0.0; 3]);
        grads.rotations.resize(n, [0.0; 4]);
        grads.log_scales.resize(n, [0.0; 3]);
        grads.logit_opacities.resize(n, 0.0);
        grads.sh.resize(n * sh_stride, 0.0);
        grads.mean2d.resize(n, 0.0);
        grads.radii.resize(n, 0.0);
        Self {
            first: 0,
            sh_stride,
            means: &mut grads.means,
            rotations: &mut grads.rotations,
            log_scales: &mut grads.log_scales,
            logit_opacities: &mut grads.logit_opacities,
            sh: &mut grads.sh,
            mean2d: &mut grads.mean2d,
            radii: &mut grads.radii,
        }
    }

    fn split(self) -> (Self, Option<Self>) {
        let n = self.means.len();
        if n < 2 * GRAIN {
            return (self, None);
        }
        let at = n / 2;
        let (means, means_rest) = self.means.split_at_mut(at);
        let (rotations, rotations_rest) = self.rotations.split_at_mut(at);
        let (log_scales, log_scales_rest) = self.log_scales.split_at_mut(at);
        let (logit_opacities, logit_opacities_rest) = self.logit_opacities.split_at_mut(at);
        let (sh, sh_rest) = self.sh.split_at_mut(at * self.sh_stride);
        let (mean2d, mean2d_rest) = self.mean2d.split_at_mut(at);
        let (radii, radii_rest) = self.radii.split_at_mut(at);
        let (first, sh_stride) = (self.first, self.sh_stride);
        let left = Self { first, sh_stride, means, rotations, log_scales, logit_opacities, sh, mean2d, radii };
        let right = Self {
            first: first + at,
            sh_stride,
            means: means_rest,
            rotations: rotations_rest,
            log_scales: log_scales_rest,
            logit_opacities: logit_opacities_rest,
            sh: sh_rest,
            mean2d: mean2d_rest,
            radii: radii_rest,
        };
        (left, Some(right))
    }

    fn fill(mut self, view: &View, splats: &SplatView<'_>, flats: &[Flat], bins: &Bins, cells: &[Cell]) {
        for start in (0..self.means.len()).step_by(BATCH) {
            let count = BATCH.min(self.means.len() - start);
            let mut hits: [&[[u32; 2]]; BATCH] = [&[]; BATCH];
            for (k, hits) in hits[..count].iter_mut().enumerate() {
                *hits = bins.hits(self.first + start + k);
            }
            let mut totals = [Cell::default(); BATCH];
            for (total, hits) in totals.iter_mut().zip(&hits[..count]) {
                for hit in *hits {
                    total.add(&cells[hit[0] as usize]);
                }
            }
            for k in 0..count {
                let at = start + k;
                if hits[k].is_empty() {
                    self.write(at, Gradient::default());
                    self.sh[at * self.sh_stride..(at + 1) * self.sh_stride].fill(0.0);
                } else {
                    let i = self.first + at;
                    let d_sh = &mut self.sh[at * self.sh_stride..(at + 1) * self.sh_stride];
                    let gradient = view.adjoint(splats, i, &totals[k].sums(), &flats[i], d_sh);
                    self.write(at, gradient);
                }
            }
        }
    }

    #[inline(always)]
    fn write(&mut self, at: usize, gradient: Gradient) {
        self.means[at] = gradient.mean;
        self.rotations[at] = gradient.rotation;
        self.log_scales[at] = gradient.log_scale;
        self.logit_opacities[at] = gradient.logit_opacity;
        self.mean2d[at] = gradient.mean2d;
        self.radii[at] = gradient.radius;
    }
}
