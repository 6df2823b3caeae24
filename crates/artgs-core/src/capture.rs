//! A capture: posed RGBA images, with or without depth, of one object in its observed states.

use crate::{Camera, DepthMap, FrameError, PerState, Rigid, Upward};
use glam::{DVec2, DVec3};
use std::borrow::Cow;

/// Least alpha of a pixel that shows the object.
pub const OBJECT_ALPHA: u8 = 128;

/// Alpha of a pixel that shows something else in front of the object, or of which nothing is known: the object may be there.
pub const HIDDEN_ALPHA: u8 = 1;

/// True for a pixel behind whose depth the object may be: it shows the object, something else hides the object there, or nothing is known.
pub const fn may_hold_object(pixel: &[u8; 4]) -> bool {
    pixel[3] >= OBJECT_ALPHA || pixel[3] == HIDDEN_ALPHA
}

/// One posed image.
#[derive(Clone, Debug)]
pub struct View {
    /// Path of the image relative to the capture, used in messages.
    pub name: String,
    /// Pose and intrinsics; its size is the size of the images.
    pub camera: Camera,
    /// Straight (un-premultiplied) RGBA, row-major, `[height * width]`; alpha is the object mask, see [`may_hold_object`].
    pub rgba: Vec<[u8; 4]>,
    /// Planar depth, `[height * width]`. Held-out views need none.
    pub depth: Option<DepthMap>,
    /// Depth of pixels without measured depth, of the object or of what is behind it, `[height * width]`, derived from photos and from
    /// surfaces that continue there; 0 elsewhere. Meshes and textures use it, the search for parts does not.
    pub derived: Option<DepthMap>,
}

impl View {
    /// A view with measured depth, or without; both of the size of the camera's images, row-major.
    pub fn new(name: impl Into<String>, camera: Camera, rgba: Vec<[u8; 4]>, depth: Option<DepthMap>) -> Self {
        Self { name: name.into(), camera, rgba, depth, derived: None }
    }

    /// Image width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.camera.intrinsics.width as usize, self.camera.intrinsics.height as usize)
    }

    /// Measured depth, and derived depth of the object where none was measured.
    pub fn any_depth(&self) -> Option<Cow<'_, DepthMap>> {
        let depth = self.depth.as_ref()?;
        let Some(derived) = &self.derived else { return Some(Cow::Borrowed(depth)) };
        let factor = depth.per_unit() / derived.per_unit();
        let count = |((own, derived), pixel): ((&u16, &u16), &[u8; 4])| match own {
            0 if pixel[3] >= OBJECT_ALPHA => match (f32::from(*derived) * factor).round() {
                count if count <= f32::from(u16::MAX) => count as u16,
                _ => 0,
            },
            own => *own,
        };
        let counts = depth.counts().iter().zip(derived.counts()).zip(&self.rgba).map(count);
        Some(Cow::Owned(DepthMap::new(counts.collect(), depth.per_unit())))
    }

    /// World points of all pixels that have depth, row-major; none for a view without depth.
    pub fn points(&self) -> impl Iterator<Item = DVec3> + '_ {
        let width = self.size().0;
        let depths = self.depth.iter().flat_map(|depth| depth.iter().enumerate());
        depths.filter(|(_, z)| *z > 0.0).map(move |(i, z)| {
            let pixel = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
            self.camera.unproject(pixel, f64::from(z))
        })
    }
}

/// All views of the object in one state.
#[derive(Clone, Debug, Default)]
pub struct StateViews {
    /// Training views.
    pub train: Vec<View>,
    /// Held-out views, used only for scores; may be empty.
    pub test: Vec<View>,
}

/// The states of one object in one world frame.
#[derive(Clone, Debug, Default)]
pub struct Capture {
    /// Views of every state.
    pub states: PerState<StateViews>,
    /// Motion from the world of each state's recording into the world of the capture, where the states were recorded in
    /// worlds of their own.
    pub frames: Option<PerState<Rigid>>,
    /// What these motions leave, because poses were refined one by one; none where that is unknown.
    pub frame_errors: Option<PerState<FrameError>>,
    /// Which way is up; none where nothing was found out about it.
    pub up: Option<Upward>,
    /// Warnings, one sentence each.
    pub warnings: Vec<String>,
}

impl Capture {
    /// A capture of training views that share one world.
    pub fn new(views: PerState<Vec<View>>) -> Self {
        let states = views.map(|train| StateViews { train, test: Vec::new() });
        Self { states, ..Self::default() }
    }

    /// True if every training view of every state has depth.
    pub fn has_depth(&self) -> bool {
        self.states.iter().all(|s| s.train.iter().all(|v| v.depth.is_some()))
    }

    /// Largest distance of a training camera of any state from the mean of all, scene units (ArtGS' `cameras_extent`).
    pub fn camera_extent(&self) -> f64 {
        let eyes: Vec<DVec3> = self.states.iter().flat_map(|s| &s.train).map(|v| v.camera.position()).collect();
        let mean = eyes.iter().sum::<DVec3>() / eyes.len().max(1) as f64;
        eyes.iter().map(|e| (*e - mean).length()).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Intrinsics;

    #[test]
    fn points_of_a_view_are_those_of_its_depths() {
        let k = Intrinsics { fx: 10.0, fy: 20.0, cx: 1.5, cy: 1.0, width: 3, height: 2 };
        let camera = Camera::look_at(k, DVec3::new(1.0, -2.0, 1.5), DVec3::ZERO, DVec3::Z);
        let depth = Some(DepthMap::nearest(&[0.0, 1.0, 0.0, 2.0, 0.0, 0.0]));
        let view = View::new("", camera, vec![[255; 4]; 6], depth);
        let points: Vec<DVec3> = view.points().collect();
        let expected = [((1.5, 0.5), 1.0), ((0.5, 1.5), 2.0)];
        assert_eq!(points.len(), expected.len());
        for (point, ((x, y), z)) in points.iter().zip(expected) {
            let (pixel, depth) = camera.project(*point);
            assert!(pixel.distance(DVec2::new(x, y)) < 1e-2 && (depth - z).abs() < 1e-3, "{pixel} {depth}");
        }
        assert_eq!(View { depth: None, ..view }.points().count(), 0);
    }

    #[test]
    fn derived_depth_fills_pixels_of_the_object_only() {
        let intrinsics = Intrinsics { fx: 1.0, fy: 1.0, cx: 2.0, cy: 0.5, width: 4, height: 1 };
        let camera = Camera { intrinsics, world_to_camera: Rigid::IDENTITY };
        let rgba = [255, 255, 0, HIDDEN_ALPHA].map(|alpha| [9, 9, 9, alpha]).to_vec();
        let depth = Some(DepthMap::new(vec![1000, 0, 0, 0], 1000.0));
        let derived = Some(DepthMap::new(vec![7, 200, 300, 400], 100.0));
        let view = View { name: String::new(), camera, rgba, depth, derived };
        assert_eq!(view.any_depth().unwrap().iter().collect::<Vec<_>>(), [1.0, 2.0, 0.0, 0.0]);
        let measured = View { derived: None, ..view };
        assert_eq!(measured.any_depth().as_deref(), measured.depth.as_ref());
    }
}
