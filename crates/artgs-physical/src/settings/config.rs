//! What an export is asked for.

use super::Settings;
use artgs_core::PartClass;
use glam::{DQuat, DVec3};
use std::fmt;
use std::str::FromStr;

/// Which way is up in the frame of the capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Up(DVec3);

impl Default for Up {
    /// +Z, the upward axis of exports.
    fn default() -> Self {
        Self::Z
    }
}

impl Up {
    /// +Z, the upward axis of exports.
    pub const Z: Self = Self(DVec3::Z);
    /// +Y.
    pub const Y: Self = Self(DVec3::Y);

    /// Up in this direction, which needs no length of 1; none if it has no direction.
    pub fn towards(direction: DVec3) -> Option<Self> {
        direction.try_normalize().map(Self)
    }

    /// Unit vector.
    pub fn direction(self) -> DVec3 {
        self.0
    }

    /// The smallest turn from the capture's frame to one with +Z up.
    pub fn upright(self) -> DQuat {
        match self.0 {
            DVec3::Z => DQuat::IDENTITY,
            DVec3::Y => DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2),
            DVec3::NEG_Z => DQuat::from_rotation_x(std::f64::consts::PI),
            direction => DQuat::from_rotation_arc(direction, DVec3::Z),
        }
    }
}

/// Names of the axes, in the order of [`axes`].
const AXES: [&str; 6] = ["x", "-x", "y", "-y", "z", "-z"];

fn axes() -> [DVec3; 6] {
    [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z]
}

impl fmt::Display for Up {
    /// An axis such as `-x`, or three numbers.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match axes().iter().position(|axis| *axis == self.0) {
            Some(axis) => f.write_str(AXES[axis]),
            None => write!(f, "{},{},{}", self.0.x, self.0.y, self.0.z),
        }
    }
}

impl FromStr for Up {
    type Err = String;

    /// An axis with or without a sign, or three numbers separated by commas.
    fn from_str(text: &str) -> Result<Self, String> {
        let bare = text.strip_prefix('+').unwrap_or(text);
        if let Some(axis) = AXES.iter().position(|name| *name == bare) {
            return Ok(Self(axes()[axis]));
        }
        let numbers: Option<Vec<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
        let vector = numbers.and_then(|v| <[f64; 3]>::try_from(v).ok()).map(DVec3::from_array);
        let usable = vector.filter(|v| v.is_finite()).and_then(Self::towards);
        usable.ok_or_else(|| {
            format!("`{text}` is no direction; give x, -x, y, -y, z, -z or three numbers such as 0.1,0,0.99")
        })
    }
}

/// Where the front of the object is, which is along -Y in exports.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Front {
    /// Where drawers come out and doors open to; if no part shows it, the object is not turned.
    #[default]
    Found,
    /// In this horizontal direction of the upright capture (+Z up).
    Towards(DVec3),
    /// The frame of the capture stays as it is: neither turned nor moved.
    Captured,
}

/// A class that a person gave a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GivenClass {
    /// The part, its place in the replica.
    pub part: usize,
    /// What it is.
    pub class: PartClass,
}

/// How parts collide.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Collision {
    /// Convex pieces, cut so that parts do not collide.
    #[default]
    Hulls,
    /// No collision shapes.
    None,
}

/// What an export was asked for, and the settings of everything else. Metres and kilograms.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalConfig {
    /// Metres per unit of the capture.
    pub scale: f64,
    /// Which way is up in the frame of the capture.
    pub up: Up,
    /// Front of the object.
    pub front: Front,
    /// Links keep the names of the parts of the replica instead of names by their classes.
    pub part_names: bool,
    /// Classes that a person gave.
    pub classes: Vec<GivenClass>,
    /// Density of the material, kg/m^3; the default is that of particle board.
    pub density: f64,
    /// Densities of parts by their names in the exports, kg/m^3.
    pub densities: Vec<(String, f64)>,
    /// Mass of all parts together, kilograms; none to leave what follows from the densities.
    pub mass: Option<f64>,
    /// How parts collide.
    pub collision: Collision,
    /// Largest number of convex pieces of a link.
    pub most_hulls: u32,
    /// Extend limits beyond the observed values until a contact or the loss of support.
    pub extend_limits: bool,
    /// Largest number of visual triangles of a link.
    pub triangles: usize,
    /// Edge of a texel, metres; none for the resolution of the photos.
    pub texel: Option<f64>,
    /// What no option gives.
    pub settings: Settings,
}

impl Default for PhysicalConfig {
    fn default() -> Self {
        Self {
            scale: 1.0,
            up: Up::Z,
            front: Front::Found,
            part_names: false,
            classes: Vec::new(),
            density: 650.0,
            densities: Vec::new(),
            mass: None,
            collision: Collision::Hulls,
            most_hulls: 400,
            extend_limits: true,
            triangles: 20_000,
            texel: None,
            settings: Settings::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_is_any_axis_or_direction() {
        for (text, axis) in AXES.into_iter().zip(axes()) {
            let up: Up = text.parse().unwrap();
            assert_eq!((up.direction(), up.to_string().as_str()), (axis, text));
            assert!((up.upright() * axis).distance(DVec3::Z) < 1e-12, "{text}");
            assert!((up.upright().length() - 1.0).abs() < 1e-12);
        }
        assert_eq!("+x".parse(), Ok(Up(DVec3::X)));
        let leaning: Up = "0, 3,4".parse().unwrap();
        assert!((leaning.upright() * DVec3::new(0.0, 0.6, 0.8)).distance(DVec3::Z) < 1e-12);
        assert_eq!(leaning.to_string().parse::<Up>().unwrap().direction(), leaning.direction());
        for text in ["", "w", "--x", "0,0,0", "1,2", "1,2,nan", "inf,0,0"] {
            assert!(text.parse::<Up>().unwrap_err().contains("-x"), "{text}");
        }
    }
}
