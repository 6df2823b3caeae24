//! Views of a part: colours of surface points with weights.

use super::BakeOptions;
use super::gains::Gain;
use super::photo::Photo;
use crate::settings::BakeSettings;
use artgs_core::Camera;
use glam::{DMat3, DVec3, Vec3};

/// A photo seen from the frame of a part.
#[derive(Clone)]
pub(crate) struct BakeView<'a> {
    photo: &'a Photo<'a>,
    /// Camera in the frame of the mesh: that of the photo, moved with the part ([`Camera::moved_with`]).
    pub(crate) camera: Camera,
    /// What the colours are divided by.
    pub(crate) gain: Gain,
    eye: DVec3,
    rotation: DMat3,
    translation: DVec3,
}

/// Colour of a surface point in one view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// sRGB in [0, 255].
    pub(super) color: Vec3,
    /// Weight.
    pub(super) weight: f32,
    /// True if the pixel is not adjacent to an edge.
    pub(super) clear: bool,
}

/// Where a view sees a point.
pub(super) struct Sight {
    index: usize,
    at: [f64; 2],
    /// Pixels to the nearest edge, at least 1.
    pub(super) clear: u8,
    /// Cosine between the normal and the direction to the camera.
    cosine: f64,
    /// Scene units per pixel.
    footprint: f64,
}

impl<'a> BakeView<'a> {
    /// A photo with its camera in the frame of the mesh; colours stay as they are.
    pub(crate) fn new(photo: &'a Photo<'a>, camera: Camera) -> Self {
        let pose = camera.world_to_camera;
        Self {
            photo,
            camera,
            gain: Gain::default(),
            eye: camera.position(),
            rotation: pose.matrix(),
            translation: pose.translation,
        }
    }

    /// Index of the pixel in which a point is, its place in the image and its depth; none outside of the image.
    fn pixel(&self, point: DVec3) -> Option<(usize, [f64; 2], f64)> {
        let k = &self.photo.intrinsics;
        let p = self.rotation * point + self.translation;
        if p.z <= 0.0 {
            return None;
        }
        let (x, y) = (k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy);
        let inside = x >= 0.0 && y >= 0.0 && x < f64::from(k.width) && y < f64::from(k.height);
        inside.then(|| (y as usize * k.width as usize + x as usize, [x, y], p.z))
    }

    /// Where this view sees a point with a unit normal; none if it does not.
    pub(super) fn sight(&self, point: DVec3, normal: DVec3, options: &BakeOptions) -> Option<Sight> {
        let ray = self.eye - point;
        let along = normal.dot(ray);
        if along <= 0.0 {
            return None;
        }
        let cosine = along / ray.length();
        if cosine < options.settings.facing {
            return None;
        }
        let (index, at, depth) = self.pixel(point)?;
        let clear = self.photo.clear[index];
        if clear == 0 {
            return None;
        }
        // The depth of an inclined surface changes within a pixel.
        let footprint = depth / self.photo.intrinsics.fx;
        let slope = (1.0 - cosine * cosine).sqrt() / cosine;
        if (f64::from(self.photo.depth.at(index)) - depth).abs() > options.tolerance + footprint * slope {
            return None;
        }
        Some(Sight { index, at, clear, cosine, footprint })
    }

    /// True if this view sees a point by a depth that was measured, false if by one that was derived; none if it does not see it.
    pub(crate) fn measures(&self, point: DVec3, normal: DVec3, options: &BakeOptions) -> Option<bool> {
        let sight = self.sight(point, normal, options)?;
        Some(self.photo.is_measured(sight.index))
    }

    /// True if this view measures something behind a point, clear of edges.
    pub(crate) fn looks_through(&self, point: DVec3, options: &BakeOptions) -> bool {
        self.pixel(point).is_some_and(|(index, _, depth)| {
            self.photo.clear[index] > 1
                && self.photo.is_measured(index)
                && f64::from(self.photo.depth.at(index)) > depth + options.tolerance
        })
    }

    /// True if some of the depth of this view was derived.
    pub(crate) fn has_derived(&self) -> bool {
        self.photo.derived.is_some()
    }

    /// The colour in the photo.
    pub(super) fn color(&self, sight: &Sight) -> Vec3 {
        let [x, y] = sight.at;
        if sight.clear >= 2 { self.photo.bilinear(x, y) } else { self.photo.pixel(sight.index) }
    }

    /// Equalised colour of a point with a unit normal, if this view sees it.
    pub(super) fn sample(&self, point: DVec3, normal: DVec3, options: &BakeOptions) -> Option<Sample> {
        let sight = self.sight(point, normal, options)?;
        let settings = &options.settings;
        let weight = sight.cosine.powf(settings.sharpness) / (sight.footprint * sight.footprint);
        let (color, share) = self.gain.removed(self.color(&sight), normal, &settings.gains);
        Some(Sample { color, weight: weight as f32 * trust(sight.clear, settings) * share, clear: sight.clear > 1 })
    }
}

/// Weight by distance from edges: almost zero at edges, smoothly rising beyond two pixels.
fn trust(clear: u8, settings: &BakeSettings) -> f32 {
    match clear {
        0 => 0.0,
        1 => settings.edge_trust[0],
        2 => settings.edge_trust[1],
        _ => {
            let t = f32::from(clear - 2) / f32::from(settings.full_trust - 2);
            t * t
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trust_grows_with_the_distance_from_edges() {
        let full = BakeSettings::DEFAULT.full_trust;
        let trust = |clear: u8| trust(clear, &BakeSettings::DEFAULT);
        assert!((0..full).all(|d| trust(d) < trust(d + 1)) && trust(full) == 1.0);
    }
}
