//! Thresholds of the check.

use serde::{Deserialize, Serialize};

/// Thresholds of the check. Lengths in metres, angles in radians.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CheckOptions {
    /// Largest distance from a limit at which a slide has reached it.
    pub length: f64,
    /// Largest angle from a limit at which a hinge has reached it.
    pub angle: f64,
    /// Largest allowed penetration of hulls of two links, at any tested pose.
    pub penetration: f64,
    /// Poses per joint at which penetration is tested, both limits included: 20, and four between each two of those.
    pub poses: usize,
    /// Largest difference between formats: absolute for lengths and angles, relative for masses, moments and forces.
    pub agreement: f64,
    /// Penetration that does not stop a joint: engines are less accurate, and touching hulls would block the joint.
    pub touch: f64,
    /// Driving force, relative to the force that weight, friction, damping and inertia need.
    pub reserve: f64,
    /// Seconds from one limit to the other.
    pub travel: f64,
    /// Seconds for which a joint is held at a limit.
    pub hold: f64,
    /// Coefficient of friction between hulls.
    pub friction: f64,
    /// Seconds per step of the engine.
    pub step: f64,
    /// Least and largest plausible mass per volume of the box around a link, kg/m^3.
    pub density: [f64; 2],
    /// Distance within which hulls and visual mesh match, at most a hundredth of the link's diagonal.
    pub cover: f64,
    /// Least share of both surfaces that has to match.
    pub covered: f64,
    /// Largest width of a hole, and depth of hulls where nothing is drawn; at most a fiftieth of the link's diagonal.
    pub hole: f64,
    /// Depth behind an observed surface at which a point is inside of a link, as a share of the object's diagonal.
    pub deep: f64,
    /// Largest share of the surface of a link that may be inside of another one at a limit of its joint.
    pub inside: f64,
    /// Points on each surface that are compared.
    pub samples: usize,
}

impl Default for CheckOptions {
    fn default() -> Self {
        Self {
            length: 2e-3,
            angle: 0.5_f64.to_radians(),
            penetration: 2e-3,
            poses: 96,
            agreement: 1e-4,
            touch: 1e-3,
            reserve: 2.0,
            travel: 2.0,
            hold: 1.0,
            friction: 0.3,
            step: 1.0 / 240.0,
            density: [0.5, 25_000.0],
            cover: 5e-3,
            covered: 0.98,
            hole: 0.01,
            deep: 0.015,
            inside: 0.03,
            samples: 20_000,
        }
    }
}
