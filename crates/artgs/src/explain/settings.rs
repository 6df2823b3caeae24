//! Every number that the energy depends on and that is not measured.

/// Settings of the energy. Lengths are fractions of the object's diagonal unless stated otherwise.
#[derive(Clone, Copy, Debug)]
pub struct ExplainSettings {
    /// Distance of surfels, spacings of the scene. Raising it makes all faster and misses small parts.
    pub spacing: f32,
    /// Nats for a surfel that founded surface hides. Raising it makes surfaces that a part hides by moving, such as the inside of a
    /// drawer, look for another explanation.
    pub hidden: f32,
    /// Nats for a surfel that faces no view of the other state.
    pub unseen: f32,
    /// What so many views say about a surfel is believed by half: single views err at edges. Raising it makes what few views show count
    /// less.
    pub views: f32,
    /// Nats of a surfel at most: it may be wrong itself. Raising it makes single surfels count more.
    pub most: f32,
    /// Share of a part that the other state shows on the part's own surface, from which on its hidden surfels are cheap and its seen
    /// ones are believed. Raising it removes parts that hide what nothing explains, and parts of which little is seen.
    pub supported: f32,
    /// Most distance between the two faces of a plate, such as a door, of which the states show different ones. Raising it believes parts whose
    /// faces are farther apart.
    pub thickness: f32,
    /// Nats for a cut through a smooth surface between two surfels. Raising it makes borders shorter.
    pub border: f32,
    /// Error of a motion where it has been registered: depth differences below it say nothing.
    pub motion_error: f32,
    /// Residuals up to this many standard deviations are of the predicted surface.
    pub hit: f32,
    /// Least cosine between normal and line of sight of a surfel that a view can see.
    pub facing: f32,
    /// Differences up to this are used to measure the noise.
    pub gate: f32,
}

impl ExplainSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        spacing: 2.0,
        hidden: 0.05,
        unseen: 1.0,
        views: 1.5,
        most: 3.0,
        supported: 0.1,
        thickness: 0.04,
        border: 3.0,
        motion_error: 5e-4,
        hit: 4.0,
        facing: 0.15,
        gate: 0.02,
    };
}

impl Default for ExplainSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
