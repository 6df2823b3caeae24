//! Everything physical that a capture does not tell. The only place where such defaults are.

use glam::DQuat;

/// Which axis of the capture points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    /// +Z, as in exports.
    #[default]
    Z,
    /// +Y; the replica is turned so that +Z is.
    Y,
}

impl Up {
    /// From the capture's frame to one with +Z up.
    pub fn upright(self) -> DQuat {
        match self {
            Self::Z => DQuat::IDENTITY,
            Self::Y => DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2),
        }
    }
}

/// How parts collide.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Collision {
    /// Convex pieces from V-HACD, cut so that no part is in another's way.
    #[default]
    Hulls,
    /// Nothing collides.
    None,
}

/// Settings of [`crate::build()`]. Lengths ending in `_share` are shares of the object's diagonal, so that they fit a
/// stapler as well as a fridge; everything else is in metres, kilograms, seconds and radians.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalConfig {
    /// Metres per unit of the capture.
    pub scale: f64,
    /// Upward axis of the capture.
    pub up: Up,
    /// Density of what parts are made of, kg/m^3: that of particle board.
    pub density: f64,
    /// Thickness of walls: what is open or hollow weighs as a shell of it.
    pub wall_share: f64,
    /// How parts collide.
    pub collision: Collision,
    /// Voxel of the convex decomposition.
    pub hull_voxel_share: f64,
    /// Greatest concavity that a convex piece may hide, as V-HACD measures it.
    pub concavity: f64,
    /// Most convex pieces of a link.
    pub most_hulls: u32,
    /// Distance that convex pieces of different links keep from each other: engines put margins around them.
    pub gap_share: f64,
    /// What may be missing of that distance.
    pub contact_share: f64,
    /// Convex pieces thinner than this go: engines see contacts at slivers where there are none.
    pub thinnest_share: f64,
    /// Lowest mass of a link, kg.
    pub least_mass: f64,
    /// Extend limits beyond the observed values until something is touched or support is lost.
    pub extend_limits: bool,
    /// A hinge is extended by this much at each end at most, radians.
    pub most_turn: f64,
    /// A hinge's whole range is extended to this much at most, radians.
    pub widest_turn: f64,
    /// A slide is extended at each end by this share of what was observed at most.
    pub most_slide: f64,
    /// Share of a sliding part's length that must stay within what it slides in.
    pub least_support: f64,
    /// Share of an extension that is given back as a margin before contact.
    pub margin: f64,
    /// Greatest force of a slide (N).
    pub force: f64,
    /// Greatest torque of a hinge (N m).
    pub torque: f64,
    /// Greatest speed of a slide (m/s).
    pub speed: f64,
    /// Greatest speed of a hinge (rad/s).
    pub turn_rate: f64,
    /// Seconds after which a free part has lost most of its speed: damping is inertia over it.
    pub settle: f64,
    /// Dry friction as a share of the part's weight (slides), or of its weight at a tenth of the diagonal (hinges).
    pub friction: f64,
    /// Triangles of a link that are drawn, at most.
    pub triangles: usize,
    /// Texels along the object's diagonal.
    pub texels: f64,
    /// Greatest side of a texture, pixels.
    pub texture_side: u32,
}

impl Default for PhysicalConfig {
    fn default() -> Self {
        Self {
            scale: 1.0,
            up: Up::Z,
            density: 650.0,
            wall_share: 0.01,
            collision: Collision::Hulls,
            hull_voxel_share: 1.0 / 110.0,
            concavity: 0.004,
            most_hulls: 40,
            gap_share: 2e-3,
            contact_share: 2e-4,
            thinnest_share: 1e-3,
            least_mass: 0.01,
            extend_limits: true,
            most_turn: std::f64::consts::FRAC_PI_4,
            widest_turn: std::f64::consts::PI,
            most_slide: 0.5,
            least_support: 0.25,
            margin: 0.1,
            force: 100.0,
            torque: 50.0,
            speed: 1.0,
            turn_rate: 3.0,
            settle: 0.5,
            friction: 0.02,
            triangles: 20_000,
            texels: 900.0,
            texture_side: 4096,
        }
    }
}
