//! Random variates of the generator that all stages use.

use artgs_core::random::box_muller;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// A standard normal variate.
pub(crate) fn normal(rng: &mut Pcg64Mcg) -> f64 {
    let (u, v) = (rng.random(), rng.random());
    box_muller(u, v)
}
