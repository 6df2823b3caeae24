//! How heavy links are.

/// Settings of walls, masses and inertia; densities are options of an export.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassSettings {
    /// Thickness of walls of which one side was seen, a share of the object's diagonal, at most: those that were measured say whether they
    /// are thinner. Convex pieces are as thick where the solid behind them is thicker. Raising it makes parts heavier and pieces thicker.
    pub wall_share: f64,
    /// Share of a wall for which a surface of the base that only closes its mesh stands: hidden sides stand on a floor or at a
    /// wall, and some are the back of a wall that was seen. Those of movable parts stand for nothing, they are mostly hidden
    /// backs. Raising it makes bases heavier. Calibrated on ten procedural objects.
    pub closing_wall: f64,
    /// Largest thickness of a wall, in multiples of that of `wall_share`; beyond it begins an interior. Raising it makes thick panels solid.
    pub thickest: f64,
    /// Share of the seen surface of a part that walls of measured thickness must have, so that they say how thick its others are. Raising it
    /// trusts less in few measured walls.
    pub measured: f64,
    /// Share of the inertia of a wall across its thickness that a link has at least about each axis. Raising it makes thin links turn slower
    /// about axes within them.
    pub least_thickness: f64,
    /// Lowest mass of a link, kg: engines refuse less. Raising it makes small parts heavier.
    pub least_mass: f64,
}

impl MassSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        wall_share: 0.01,
        closing_wall: 0.5,
        thickest: 3.0,
        measured: 0.02,
        least_thickness: 0.1,
        least_mass: 0.01,
    };
}

impl Default for MassSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
