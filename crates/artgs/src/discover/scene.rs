//! Both states as discovery looks at them: depth maps at a useful size, surface points, lengths.

use super::label::{AtRest, Pair};
use super::observe::{Cloud, DepthView, Observation, Sightings, surface_points};
use super::propose::Scales;
use super::register::Searchable;
use super::{DiscoverConfig, DiscoverError};
use crate::fit::images::COVERED;
use artgs_core::{Camera, DepthMap, View};
use glam::{DVec2, Vec3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Bounding box of both clouds without the outermost 0.1 % of points.
fn bounds(clouds: [&Cloud; 2]) -> (Vec3, Vec3) {
    let range = |axis: usize| {
        let mut xs: Vec<f32> = clouds.iter().flat_map(|c| c.points.iter().map(|p| p[axis])).collect();
        xs.sort_unstable_by(f32::total_cmp);
        (xs[xs.len() / 1000], xs[xs.len() - 1 - xs.len() / 1000])
    };
    let (x, y, z) = (range(0), range(1), range(2));
    (Vec3::new(x.0, y.0, z.0), Vec3::new(x.1, y.1, z.1))
}

/// A view with its depth map, measured or rendered.
#[derive(Clone, Copy, Debug)]
pub struct DepthPicture<'a> {
    /// Camera, colours and mask.
    pub view: &'a View,
    /// Planar depth, `[height * width]`, 0 where there is none.
    pub depth: &'a DepthMap,
}

impl<'a> DepthPicture<'a> {
    fn kept(&self, step: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = self.view.size();
        (0..height / step).flat_map(move |y| (0..width / step).map(move |x| y * step * width + x * step))
    }

    /// Depth of every `step`-th pixel of every `step`-th row, and a camera with just these pixels.
    pub fn thinned_depth(&self, step: usize) -> (Camera, DepthMap) {
        if step == 1 {
            return (self.view.camera, self.depth.clone());
        }
        (self.view.camera.thinned(step), self.depth.select(self.kept(step)))
    }

    /// Colours of the same pixels.
    pub fn thinned_colors(&self, step: usize) -> Cow<'a, [[u8; 4]]> {
        if step == 1 {
            return Cow::Borrowed(&self.view.rgba);
        }
        Cow::Owned(self.kept(step).map(|i| self.view.rgba[i]).collect())
    }

    /// Ready for looking things up, and some of its surface points.
    fn prepared(&self, step: usize) -> (DepthView, Cloud) {
        let ((camera, depth), rgba) = (self.thinned_depth(step), self.thinned_colors(step));
        let mask: Vec<bool> = rgba.iter().map(|p| p[3] >= COVERED).collect();
        let view = DepthView::new(camera, depth, &mask);
        let rough = surface_points(&view, &rgba, 5);
        (view, rough)
    }

    /// Some of the surface, in world coordinates, and sizes of a pixel there.
    fn glance(&self) -> Vec<(Vec3, f32)> {
        let width = self.view.size().0;
        let seen = self.depth.iter().enumerate().step_by(GLANCE).filter(|(_, z)| *z > 0.0);
        seen.map(|(i, z)| {
            let pixel = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
            let point = self.view.camera.unproject(pixel, z.into()).as_vec3();
            (point, z / self.view.camera.intrinsics.fx as f32)
        })
        .collect()
    }
}

/// Pixels per pixel looked at in a glance; odd, so that it does not keep to a column.
const GLANCE: usize = 331;

/// How many pixels one can go on in each direction and still see every distance of `length`, a fraction of the object's
/// diagonal: what lies between costs time and memory and tells hardly more. At least 1.
pub fn pixel_step(pictures: [&[DepthPicture<'_>]; 2], length: f64) -> usize {
    let glances: Vec<(Vec3, f32)> = pictures.concat().par_iter().flat_map_iter(DepthPicture::glance).collect();
    if glances.is_empty() {
        return 1;
    }
    let (points, mut sizes): (Vec<Vec3>, Vec<f32>) = glances.into_iter().unzip();
    let cloud = Cloud { points, ..Cloud::default() };
    let (lower, upper) = bounds([&cloud, &Cloud::default()]);
    let middle = sizes.len() / 2;
    let pixel = *sizes.select_nth_unstable_by(middle, f32::total_cmp).1;
    ((length as f32 * lower.distance(upper) / pixel) as usize).max(1)
}

/// Views of one state, and some of its surface points.
fn prepare(pictures: &[DepthPicture<'_>], step: usize) -> (Vec<DepthView>, Cloud) {
    let (views, clouds): (Vec<DepthView>, Vec<Cloud>) = pictures.par_iter().map(|p| p.prepared(step)).unzip();
    let mut rough = Cloud::default();
    clouds.iter().for_each(|cloud| rough.append(cloud));
    (views, rough)
}

/// Both states prepared for discovery.
pub struct Scene {
    /// Start and end.
    pub states: [Observation; 2],
    /// Lengths in scene units.
    pub scales: Scales,
    /// Depth tolerance, scene units.
    pub tolerance: f32,
    pub(super) lower: Vec3,
    pub(super) upper: Vec3,
}

impl Scene {
    /// Back-projects both states.
    pub fn new(pictures: [&[DepthPicture<'_>]; 2], config: &DiscoverConfig) -> Result<Self, DiscoverError> {
        let step = pixel_step(pictures, 0.5 * config.spacing);
        let [(start, rough_start), (end, rough_end)] = pictures.map(|p| prepare(p, step));
        let rough = [rough_start, rough_end];
        for s in 0..2 {
            if rough[s].len() < 50 {
                return Err(DiscoverError::NoSurface(artgs_core::STATE_NAMES[s]));
            }
        }
        let (lower, upper) = bounds([&rough[0], &rough[1]]);
        let diagonal = lower.distance(upper);
        let observe = |(views, pictures): (Vec<DepthView>, &[DepthPicture<'_>])| {
            let voxel = (config.spacing as f32 * diagonal).max(Observation::pixel_size(&views));
            Observation::new(views, |i| pictures[i].thinned_colors(step), voxel)
        };
        let states = [(start, pictures[0]), (end, pictures[1])].map(observe);
        let pixel = Observation::pixel_size(&states[0].views).max(Observation::pixel_size(&states[1].views));
        let noise = states[0].depth_noise().max(states[1].depth_noise());
        let spacing = (config.spacing as f32 * diagonal).max(pixel);
        let tolerance = (4.0 * noise).max(0.5 * pixel);
        Ok(Self { states, scales: Scales { spacing, diagonal }, tolerance, lower, upper })
    }

    /// What the other state says about each point of a state.
    pub fn at_rest(&self, state: usize) -> Vec<AtRest> {
        let (own, other) = (&self.states[state].cloud, &self.states[1 - state].views);
        let judge = |seen: Sightings| match (seen.is_empty_space(), seen.is_surface()) {
            (true, _) => AtRest::Gone,
            (_, true) => AtRest::Seen,
            _ => AtRest::Unseen,
        };
        Sightings::of_all(other, &own.points, self.tolerance).into_iter().map(judge).collect()
    }

    /// Looks from one state into the other.
    pub(super) fn pair<'a>(&'a self, search: &'a [Searchable<'a>; 2], state: usize) -> Pair<'a> {
        Pair {
            own: &search[state],
            other: &search[1 - state],
            other_views: &self.states[1 - state].views,
            tolerance: self.tolerance,
            spacing: self.scales.spacing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};

    #[test]
    fn only_fine_pictures_are_thinned_and_hardly_change_what_is_known() {
        let capture =
            |size: u32| cabinet_capture(&CabinetOptions { views: 6, size, ..CabinetOptions::default() }).unwrap().0;
        let config = DiscoverConfig { spacing: 1.0 / 40.0, ..DiscoverConfig::default() };
        let look = |size: u32| {
            let capture = capture(size);
            let pictures = [0, 1].map(|s| {
                let picture = |view| DepthPicture { view, depth: view.depth.as_ref().unwrap() };
                capture.states[s].train.iter().map(picture).collect::<Vec<_>>()
            });
            let pictures = [&pictures[0][..], &pictures[1][..]];
            let scene = Scene::new(pictures, &config).unwrap();
            (
                pixel_step(pictures, 0.5 * config.spacing),
                scene.states[0].views[0].depth.len(),
                scene.states[0].cloud.len(),
            )
        };
        let (coarse, fine) = (look(96), look(288));
        assert_eq!(coarse.0, 1);
        assert!(fine.0 >= 2 && fine.1 == (288 / fine.0).pow(2), "{fine:?}");
        assert!((fine.2 as f64 / coarse.2 as f64 - 1.0).abs() < 0.15, "{coarse:?} {fine:?}");
    }
}
