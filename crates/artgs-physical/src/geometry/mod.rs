//! Meshes, hulls and solids as every question needs them.

pub(crate) mod convert;
pub(crate) mod hull;
pub(crate) mod solid;
pub(crate) mod topology;
pub(crate) mod weld;

use glam::DVec3;

/// Whether a point of a mesh was observed. What was not, such as the inner side of a wall that was seen from one side, needs
/// no piece of its own, but floors do: things are put on them.
pub type Observed<'a> = dyn Fn(DVec3) -> bool + Sync + 'a;

/// Weights of two sides of a triangle for point number `n` of a sequence that covers it evenly: the additive recurrence of the plastic
/// number covers a square, whose other half is folded back.
pub(crate) fn in_triangle(n: f64) -> [f64; 2] {
    const STEPS: [f64; 2] = [0.754_877_666, 0.569_840_291];
    let [s, r] = STEPS.map(|step| (step * n).fract());
    if s + r > 1.0 { [1.0 - s, 1.0 - r] } else { [s, r] }
}
