//! Random variates from uniform ones.

/// A standard normal variate (Box and Muller) from two independent uniform variates in [0, 1):
/// `sqrt(-2 ln(1 - u)) cos(2 pi v)`.
pub fn box_muller(u: f64, v: f64) -> f64 {
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}
