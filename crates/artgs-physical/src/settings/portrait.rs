//! The picture of an exported object.

use glam::DVec3;

/// Settings of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PortraitSettings {
    /// Pixels of a side.
    pub side: u32,
    /// Field of view, degrees. Raising it shows a stronger perspective.
    pub view: f64,
    /// Direction from the object to the camera, object's frame: in front, from the right and above.
    pub from: DVec3,
    /// Distance of the dots that a mesh is drawn with, as a share of the diagonal of the object. Raising it is faster and opens gaps.
    pub spacing: f64,
    /// Standard deviation of a dot, in distances of dots.
    pub dot: f32,
    /// Opacity of a dot, its logit.
    pub opacity: f32,
    /// Grey of a mesh without colours, 0 to 1.
    pub grey: f32,
}

impl PortraitSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        side: 256,
        view: 30.0,
        from: DVec3::new(0.6, -1.0, 0.5),
        spacing: 0.006,
        dot: 0.6,
        opacity: 6.0,
        grey: 0.7,
    };
}

impl Default for PortraitSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
