//! Starts that look at neither motion nor surface: what the published ones are compared with.

use super::CanonicalError;
use crate::fit::RandomInit;
use crate::fit::init::random_cube;
use crate::fit::region::Region;
use crate::random::normal;
use crate::trimmed::trimmed_range;
use artgs_core::{PerState, Splats, State};
use glam::DVec3;
use rand_pcg::Pcg64Mcg;

/// Standard deviation of published random centres, half the object's longest side being 1, and of the logarithms of
/// their radii.
const SPREAD: f64 = 0.01;

/// Box around the opaque Gaussians of both states without the outermost 1 % on each side.
fn region(single: &PerState<Splats>) -> Region {
    let range = |axis: usize| {
        let of_state = |s: &Splats| -> Vec<f32> {
            (0..s.len()).filter(|&i| s.logit_opacities[i] > 0.0).map(|i| s.means[i][axis]).collect()
        };
        let mut xs: Vec<f32> = single.iter().flat_map(of_state).collect();
        if xs.is_empty() {
            xs = single.iter().flat_map(|s| s.means.iter().map(|p| p[axis])).collect();
        }
        trimmed_range(&mut xs, 100, f32::total_cmp).unwrap_or_default().map(f64::from)
    };
    let [x, y, z] = [range(0), range(1), range(2)];
    Region { low: DVec3::new(x[0], y[0], z[0]), high: DVec3::new(x[1], y[1], z[1]) }
}

/// Gaussians at random in a cube around both states of the object.
pub(super) fn random_gaussians(
    single: &PerState<Splats>,
    config: &RandomInit,
    rng: &mut Pcg64Mcg,
) -> Result<Splats, CanonicalError> {
    random_cube(&region(single), config, single[State::START].sh_degree, rng)
        .map_err(|e| CanonicalError::Random(e.to_string()))
}

/// Centres and radii, `[K]`, as published code draws them without a start: with half the object's longest side for 1 and
/// its middle for the origin, centres normal with deviation 0.01 and radii near 1.
pub(super) fn random_centres(single: &PerState<Splats>, parts: usize, rng: &mut Pcg64Mcg) -> (Vec<[f32; 3]>, Vec<f32>) {
    let region = region(single);
    let half = region.half_side().max(1e-12);
    let mut draw = || SPREAD * normal(rng);
    let one = |_| {
        let offset = DVec3::new(draw(), draw(), draw());
        ((region.centre() + half * offset).as_vec3().to_array(), (half * draw().exp()) as f32)
    };
    (0..parts).map(one).unzip()
}
