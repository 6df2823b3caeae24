//! How joints are driven, and what holds them.

use artgs_core::ContactMaterial;

/// Settings of the effort, speed, damping and friction of joints. Metres, kilograms, seconds, radians, newtons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DynamicsSettings {
    /// Least effort of a slide, its force limit, N. Raising it lets motors of drawers push harder.
    pub force: f64,
    /// Least effort of a hinge, N m. Raising it lets motors of doors push harder.
    pub torque: f64,
    /// Effort at least, in multiples of what holds the weight of the part, of hinges at its far end. Raising it lets motors lift heavy parts.
    pub weights: f64,
    /// Largest speed of a slide, m/s.
    pub speed: f64,
    /// Largest speed of a hinge, rad/s.
    pub turn_rate: f64,
    /// Time constant of free motion, s: damping is inertia divided by it. Raising it lets parts that were pushed move longer.
    pub settle: f64,
    /// Dry friction as a share of the part's weight (slides), or of its weight at `lever` (hinges). Raising it makes parts stop earlier.
    pub friction: f64,
    /// Distance from the axis at which the weight of a hinged part makes friction, a share of its width. Raising it makes doors stop
    /// earlier.
    pub lever: f64,
    /// Error of the upright direction, rad, at which friction still holds a door or a drawer where it is put. Raising it makes parts stiffer.
    pub holds: f64,
    /// Largest force at the far end of a part, N, that overcomes its friction, and that overcomes its damping at `hand_speed`: a hand moves
    /// every part. Raising it lets heavy parts be stiffer.
    pub hand: f64,
    /// Speed of a hand at the far end of a part, m/s. Raising it makes damping of heavy parts less.
    pub hand_speed: f64,
    /// Contact of all surfaces.
    pub contact: ContactMaterial,
}

impl Default for DynamicsSettings {
    fn default() -> Self {
        Self {
            force: 100.0,
            torque: 50.0,
            weights: 3.0,
            speed: 1.0,
            turn_rate: 3.0,
            settle: 0.5,
            friction: 0.02,
            lever: 0.1,
            holds: 3.0 * std::f64::consts::PI / 180.0,
            hand: 5.0,
            hand_speed: 0.5,
            contact: ContactMaterial::default(),
        }
    }
}
