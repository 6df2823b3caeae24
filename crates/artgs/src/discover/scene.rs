//! Both states as discovery sees them: depth maps at a useful size, surface points, lengths.

use super::cloud::{Cloud, IndexedCloud, surface_points};
use super::cube_votes::CubeVotes;
use super::denoise::{pixel_noise, smoothed};
use super::flatten::flattened;
use super::landing::StatePair;
use super::paired_mean::PairedMean;
use super::visibility::{DepthLookup, Occupancy, ViewVotes};
use super::{DiscoverConfig, DiscoverError};
use artgs_core::capture::may_hold_object;
use artgs_core::{Camera, DepthMap, PerState, Rigid, State, View};
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Lengths of a scene, scene units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lengths {
    /// Distance between neighbouring points.
    pub(crate) spacing: f32,
    /// Diagonal of the object.
    pub(crate) diagonal: f32,
}

/// The ball around the middle of the object that axes of hinges pass through. Its radius is a diagonal of the object, twice that of the ball around
/// its box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HingeBall {
    /// Scene frame.
    pub(crate) middle: DVec3,
    /// Scene units.
    pub(crate) radius: f64,
}

impl HingeBall {
    /// True if a slide or a hinge can move a part so. What turns a little about an axis farther away slides: its turn is an error, or that of several
    /// parts which slide nearly alike.
    pub(crate) fn can_move(&self, motion: &Rigid) -> bool {
        let screw = motion.screw();
        screw.angle == 0.0 || (self.middle - screw.origin).cross(screw.axis).length() < self.radius
    }
}

/// Bounding box of some points without the outermost 0.1 % along each axis.
fn bounds<'a>(clouds: impl Iterator<Item = &'a Cloud> + Clone) -> (Vec3, Vec3) {
    let range = |axis: usize| {
        let mut xs: Vec<f32> = clouds.clone().flat_map(|c| c.points.iter().map(|p| p[axis])).collect();
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

    /// Depth of every `step`-th pixel of every `step`-th row, averaged over those of the pixels at most `radius` from it in both
    /// directions that show the same surface, and a camera with just these pixels.
    pub fn thinned_depth(&self, step: usize, radius: usize) -> (Camera, DepthMap) {
        if step == 1 && radius == 0 {
            return (self.view.camera, self.depth.clone());
        }
        let window = PairedMean::new(self.depth, self.view.size(), self.view.camera.intrinsics.fx as f32, radius);
        let depths: Vec<f32> = self.kept(step).map(|i| window.depth(i)).collect();
        (self.view.camera.thinned(step), DepthMap::nearest(&depths))
    }

    /// Colours of the same pixels.
    pub fn thinned_colors(&self, step: usize) -> Cow<'a, [[u8; 4]]> {
        if step == 1 {
            return Cow::Borrowed(&self.view.rgba);
        }
        Cow::Owned(self.kept(step).map(|i| self.view.rgba[i]).collect())
    }

    /// Derived depth of the same pixels, scene units; none where the view has none.
    pub fn thinned_derived(&self, step: usize) -> Option<Vec<f32>> {
        let derived = self.view.derived.as_ref()?;
        Some(self.kept(step).map(|i| derived.at(i)).collect())
    }

    /// Its lookup, and some of its surface points.
    fn prepared(&self, step: usize, radius: usize) -> (DepthLookup, Cloud) {
        /// Every so many pixels and rows give a point: enough for the object's size.
        const STRIDE: usize = 5;
        let ((camera, depth), rgba) = (self.thinned_depth(step, radius), self.thinned_colors(step));
        let mut mask: Vec<bool> = rgba.iter().map(may_hold_object).collect();
        // What was only derived shows no room to be empty.
        if let Some(derived) = self.thinned_derived(step) {
            mask.iter_mut().zip(derived).for_each(|(may, z)| *may |= z > 0.0);
        }
        let smooth = smoothed(&depth, camera.intrinsics.width as usize, camera.intrinsics.fx as f32);
        let view = DepthLookup::new(camera, smooth.unwrap_or(depth), &mask);
        let rough = surface_points(&view, &rgba, STRIDE);
        (view, rough)
    }

    /// Some surface points in world coordinates, and the size of a pixel there.
    fn sample(&self) -> Vec<(Vec3, f32)> {
        let width = self.view.size().0;
        let pixels = self.depth.iter().enumerate().step_by(SAMPLE_STRIDE).filter(|(_, z)| *z > 0.0);
        pixels
            .map(|(i, z)| {
                let pixel = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
                let point = self.view.camera.unproject(pixel, z.into()).as_vec3();
                (point, z / self.view.camera.intrinsics.fx as f32)
            })
            .collect()
    }
}

/// Every so many pixels are sampled to measure the object; odd, so that the samples are not in one column.
const SAMPLE_STRIDE: usize = 331;

/// Largest step between pixels, in each direction, that is still no longer than `length`, a fraction of the object's
/// diagonal: pixels in between cost time and memory and add almost nothing. At least 1.
pub fn pixel_step(pictures: PerState<&[DepthPicture<'_>]>, length: f64) -> usize {
    (pixels_along(pictures, length) as usize).max(1)
}

/// Number of pixels along `length`, a fraction of the object's diagonal; 0 where nothing is seen.
fn pixels_along(pictures: PerState<&[DepthPicture<'_>]>, length: f64) -> f32 {
    let all: Vec<DepthPicture<'_>> = pictures.into_iter().flatten().copied().collect();
    let samples: Vec<(Vec3, f32)> = all.par_iter().flat_map_iter(DepthPicture::sample).collect();
    if samples.is_empty() {
        return 0.0;
    }
    let (points, mut sizes): (Vec<Vec3>, Vec<f32>) = samples.into_iter().unzip();
    let cloud = Cloud { points, ..Cloud::default() };
    let (lower, upper) = bounds(std::iter::once(&cloud));
    let middle = sizes.len() / 2;
    let pixel = *sizes.select_nth_unstable_by(middle, f32::total_cmp).1;
    length as f32 * lower.distance(upper) / pixel
}

/// Step between pixels, and radius of the windows in which depth is averaged, pixels.
fn sampling(pictures: PerState<&[DepthPicture<'_>]>, spacing: f64) -> (usize, usize) {
    /// Largest step, spacings: a larger one loses detail where depth is noisy.
    const STEP: f32 = 1.0 / 3.0;
    /// Largest window, spacings: averages over it keep the detail that points can show.
    const WINDOW: f32 = 0.75;
    let pixels = pixels_along(pictures, spacing);
    ((STEP * pixels).max(1.0) as usize, (0.5 * (WINDOW * pixels - 1.0)).max(0.0) as usize)
}

/// Noise of single pixels in sizes of a pixel, the median of some pictures; 0 if none shows enough.
fn single_noise(pictures: PerState<&[DepthPicture<'_>]>) -> f32 {
    /// Pictures of each state that are measured.
    const SAMPLES: usize = 8;
    let some = |pictures: &[DepthPicture<'_>]| -> Vec<f32> {
        let sampled: Vec<_> = pictures.iter().step_by(pictures.len().div_ceil(SAMPLES).max(1)).collect();
        let noise = |p: &&DepthPicture<'_>| pixel_noise(p.depth, p.view.size().0, p.view.camera.intrinsics.fx as f32);
        sampled.par_iter().filter_map(noise).collect()
    };
    let all: Vec<f32> = pictures.into_iter().flat_map(some).collect();
    crate::trimmed::quantile(all, 0.5).unwrap_or(0.0)
}

/// Lookups of one state, and some of its surface points.
fn prepare(pictures: &[DepthPicture<'_>], step: usize, radius: usize) -> (Vec<DepthLookup>, Cloud) {
    let (views, clouds): (Vec<DepthLookup>, Vec<Cloud>) = pictures.par_iter().map(|p| p.prepared(step, radius)).unzip();
    let mut rough = Cloud::default();
    clouds.iter().for_each(|cloud| rough.append(cloud));
    (views, rough)
}

/// All views of one state: depth maps and their thinned points.
pub(crate) struct Observation {
    /// Depth maps.
    pub(crate) views: Vec<DepthLookup>,
    /// Back-projected points, one per cube of the sampling distance.
    pub(crate) cloud: Cloud,
}

impl Observation {
    /// Back-projects all views and thins the points to one per `voxel`. `colors` are the pixels of a view.
    fn new<'c>(views: Vec<DepthLookup>, colors: impl Fn(usize) -> Cow<'c, [[u8; 4]]> + Sync, voxel: f32) -> Self {
        let points = |(i, view): (usize, &DepthLookup)| surface_points(view, &colors(i), 1).thinned(voxel);
        let clouds: Vec<Cloud> = views.par_iter().enumerate().map(points).collect();
        let mut cloud = Cloud::default();
        clouds.iter().for_each(|c| cloud.append(c));
        Self { views, cloud: cloud.thinned(voxel) }
    }

    /// The points that views of the same state do not look through.
    fn without_strays(&self, tolerance: f32) -> Cloud {
        let votes = ViewVotes::of_all(&self.views, &self.cloud.points, tolerance);
        let kept: Vec<usize> = (0..votes.len()).filter(|&i| !votes[i].is_empty_space()).collect();
        self.cloud.select(&kept)
    }

    /// Median size of a pixel on the object, scene units.
    fn pixel_size(views: &[DepthLookup]) -> f32 {
        /// Every so many pixels are measured.
        const STRIDE: usize = 37;
        let mut sizes: Vec<f32> = views
            .iter()
            .flat_map(|v| {
                let fx = v.camera.intrinsics.fx as f32;
                v.depth.iter().step_by(STRIDE).filter(|d| *d > 0.0).map(move |d| d / fx)
            })
            .collect();
        sizes.sort_unstable_by(f32::total_cmp);
        sizes.get(sizes.len() / 2).copied().unwrap_or(0.0)
    }

    /// Typical disagreement between views about the depth of the same point: the median over surfaces that face the
    /// view of the distance along the normal between a point and the surface that another view shows at its pixel.
    fn depth_noise(&self) -> f32 {
        let errors = self.disagreements(&self.views);
        errors.get(errors.len() / 2).copied().unwrap_or(0.0)
    }

    /// The same against views of the other state, of what did not move; `own` is the noise within the states.
    fn noise_against(&self, other: &Self, own: f32) -> f32 {
        median_of_still(&self.disagreements(&other.views), own)
    }

    /// These distances for some of the points, in ascending order.
    fn disagreements(&self, views: &[DepthLookup]) -> Vec<f32> {
        /// Number of points measured.
        const SAMPLES: usize = 2000;
        /// Least cosine between normal and line of sight.
        const FACING: f32 = 0.5;
        /// Larger differences are another surface, footprints of a pixel.
        const OTHER_SURFACE: f32 = 20.0;
        let stride = (self.cloud.len() / SAMPLES).max(1);
        let mut errors: Vec<f32> = (0..self.cloud.len())
            .step_by(stride)
            .flat_map(|i| {
                let (p, n) = (self.cloud.points[i], self.cloud.normals[i]);
                views.iter().filter_map(move |v| {
                    let (pixel, z) = v.locate(p)?;
                    let d = v.depth.at(pixel);
                    let towards = (v.camera.position().as_vec3() - p).normalize();
                    let cosine = towards.dot(n);
                    let footprint = z / v.camera.intrinsics.fx as f32;
                    (d > 0.0 && cosine > FACING && (d - z).abs() < OTHER_SURFACE * footprint)
                        .then(|| (d - z).abs() * cosine)
                })
            })
            .collect();
        errors.sort_unstable_by(f32::total_cmp);
        errors
    }
}

/// Median of absolute differences, in ascending order, of what did not move. Their smaller values give an estimate that motion makes
/// too large; it counts up to a little more than `own`, the median within a state. Larger medians are those of the differences
/// below three standard deviations: most of what moved differs by more.
fn median_of_still(errors: &[f32], own: f32) -> f32 {
    /// Share of the differences that is surely not motion.
    const STILL: f32 = 0.3;
    /// Median of absolute values of a normal distribution, relative to their 30th percentile.
    const TO_MEDIAN: f32 = 0.6745 / 0.3853;
    /// Three standard deviations, medians of absolute values.
    const LARGEST: f32 = 3.0 / 0.6745;
    /// Views of one state share errors: between states they can be that much larger.
    const SHARED: f32 = 1.25;
    const ROUNDS: usize = 10;
    let rough = TO_MEDIAN * errors.get((STILL * errors.len() as f32) as usize).copied().unwrap_or(0.0);
    let mut median = rough;
    for _ in 0..ROUNDS {
        let kept = errors.partition_point(|e| *e <= LARGEST * median);
        median = errors.get(kept / 2).copied().unwrap_or(0.0).min(median);
    }
    median.max(rough.min(SHARED * own))
}

/// Both states prepared for discovery.
pub struct Scene {
    pub(crate) states: PerState<Observation>,
    pub(crate) lengths: Lengths,
    /// Depth tolerance, scene units.
    pub(crate) tolerance: f32,
    /// True if the tolerance follows from depth noise, false if it follows from the size of a pixel.
    pub(crate) noisy: bool,
    /// True if depth noise spreads points across surfaces, rather than the size of a pixel.
    pub(crate) spreading: bool,
    pub(super) lower: Vec3,
    pub(super) upper: Vec3,
    /// Cubes about which all views of a state agree.
    pub(super) cubes: PerState<CubeVotes>,
}

impl Scene {
    /// Back-projects both states.
    pub fn new(pictures: PerState<&[DepthPicture<'_>]>, config: &DiscoverConfig) -> Result<Self, DiscoverError> {
        /// A state with fewer surface points, one of 25 pixels, shows nothing.
        const LEAST_POINTS: usize = 50;
        /// Depths that differ by more than this many times the noise are different.
        const TOLERANCE_PER_NOISE: f32 = 4.0;
        /// The same in pixels on the object: depth is not known better where a surface is oblique.
        const TOLERANCE_PER_PIXEL: f32 = 0.5;
        /// The cubes reach past the object by this fraction of its diagonal.
        const MARGIN: f32 = 0.1;
        /// Edge of a cube, spacings.
        const CUBE: f32 = 1.5;
        /// Noise spreads points across surfaces if its tolerance is larger than this many spacings,
        const SPREADING: f32 = 0.4;
        /// and views of one state disagree by more than this many sizes of a pixel. Exact depth reaches 0.25 pixels where 24
        /// views of 200 pixels are compared, noise of 1 cm at 3 m 0.24 to 0.35 once it is averaged, a simulated phone 0.38.
        const DISAGREEING: f32 = 0.32;
        /// Or single pixels are noisier than this many sizes of a pixel: averages hide that, but not at edges. Exact depth in
        /// millimetres has at most 0.1, noise of 1 cm at 3 m at least 0.9.
        const NOISY_PIXELS: f32 = 0.5;
        let (step, radius) = sampling(pictures, config.spacing);
        let prepared = pictures.map(|p| prepare(p, step, radius));
        for (state, (_, rough)) in prepared.enumerate() {
            if rough.len() < LEAST_POINTS {
                return Err(DiscoverError::NoSurface(state.name()));
            }
        }
        let (lower, upper) = bounds(prepared.iter().map(|(_, rough)| rough));
        let diagonal = lower.distance(upper);
        let mut states = prepared.zip(pictures).map(|((views, _), pictures)| {
            let voxel = (config.spacing as f32 * diagonal).max(Observation::pixel_size(&views));
            Observation::new(views, |i| pictures[i].thinned_colors(step), voxel)
        });
        let largest = |value: &dyn Fn(&Observation) -> f32| states.iter().map(value).fold(0.0, f32::max);
        let pixel = largest(&|state| Observation::pixel_size(&state.views));
        let own_noise = largest(&Observation::depth_noise);
        let spacing = (config.spacing as f32 * diagonal).max(pixel);
        let noisy = TOLERANCE_PER_NOISE * own_noise > TOLERANCE_PER_PIXEL * pixel;
        let across = PerState::from_fn(|s| states[s].noise_against(&states[s.other()], own_noise));
        // Exact depth has no errors that the states do not share.
        let noise = if noisy { across.iter().fold(own_noise, |a, b| a.max(*b)) } else { own_noise };
        let tolerance = (TOLERANCE_PER_NOISE * noise).max(TOLERANCE_PER_PIXEL * pixel);
        // Single pixels are measured last: exact depth does not need it.
        let spreading = noisy
            && tolerance > SPREADING * spacing
            && (own_noise > DISAGREEING * pixel || single_noise(pictures) > NOISY_PIXELS);
        if spreading {
            states
                .iter_mut()
                .for_each(|state| state.cloud = flattened(&state.without_strays(tolerance), spacing, tolerance));
        }
        let pad = Vec3::splat(MARGIN * diagonal);
        let cubes = states
            .as_ref()
            .map(|state| CubeVotes::new(&state.views, lower - pad, upper + pad, CUBE * spacing, tolerance));
        let lengths = Lengths { spacing, diagonal };
        Ok(Self { states, lengths, tolerance, noisy, spreading, lower, upper, cubes })
    }

    /// Where hinges of the object can be.
    pub(crate) fn hinges(&self) -> HingeBall {
        HingeBall { middle: (0.5 * (self.lower + self.upper)).as_dvec3(), radius: self.lengths.diagonal.into() }
    }

    /// Opposite corners of the box of the object.
    pub(crate) fn bounds(&self) -> (Vec3, Vec3) {
        (self.lower, self.upper)
    }

    /// What the other state shows at the place of each point of a state.
    pub(crate) fn occupancy_elsewhere(&self, state: State) -> Vec<Occupancy> {
        let (own, other) = (&self.states[state].cloud, &self.states[state.other()].views);
        ViewVotes::of_all(other, &own.points, self.tolerance).into_iter().map(ViewVotes::occupancy).collect()
    }

    /// Points that seem to have moved in thin strips among points that did not are depth errors, mostly along edges: a part
    /// that moved leaves whole surfaces empty. They count as surface. Points next to a whole surface stay moved.
    pub(crate) fn without_speckles(&self, state: State, occupancy: &mut [Occupancy]) {
        /// Neighbours asked at most.
        const NEIGHBOURS: usize = 200;
        /// Distance of neighbours, spacings.
        const REACH: f32 = 5.0;
        /// Share of the neighbours of a point of a whole surface that have moved, too.
        const LEAST: f32 = 0.5;
        let cloud = IndexedCloud::new(&self.states[state].cloud);
        let limit = (REACH * self.lengths.spacing).powi(2);
        let moved: Vec<usize> = (0..occupancy.len()).filter(|&i| occupancy[i] == Occupancy::Empty).collect();
        let whole = |&&i: &&usize| {
            let (mut empty, mut total) = (0, 0);
            cloud.nearest_n(cloud.cloud.points[i], NEIGHBOURS, limit, |j, _| {
                if occupancy[j] != Occupancy::Unseen {
                    total += 1;
                    empty += usize::from(occupancy[j] == Occupancy::Empty);
                }
            });
            empty as f32 >= LEAST * total as f32
        };
        let cores: Vec<usize> = moved.par_iter().filter(whole).copied().collect();
        let cores = self.states[state].cloud.select(&cores);
        let cores = IndexedCloud::new(&cores);
        for i in moved {
            if cores.nearest_within(cloud.cloud.points[i], limit).is_none() {
                occupancy[i] = Occupancy::Surface;
            }
        }
    }

    /// The points of every state with search trees.
    pub(crate) fn indexed_clouds(&self) -> PerState<IndexedCloud<'_>> {
        self.states.as_ref().map(|state| IndexedCloud::gridded(&state.cloud, self.lengths.spacing))
    }

    /// Points of a state with what is needed to look them up in the other one.
    pub(super) fn pair<'a>(&'a self, clouds: &'a PerState<IndexedCloud<'a>>, state: State) -> StatePair<'a> {
        /// Views that look through a surface by mistake where depth is noisy.
        const STRAY_VIEWS: u32 = 2;
        StatePair {
            own: &clouds[state],
            other: &clouds[state.other()],
            other_views: &self.states[state.other()].views,
            view_step: 1,
            other_cubes: &self.cubes[state.other()],
            tolerance: self.tolerance,
            stray_views: if self.spreading { STRAY_VIEWS } else { 0 },
            spacing: self.lengths.spacing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::test_scene::cabinet_scene;
    use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};

    #[test]
    fn only_fine_pictures_are_thinned_and_almost_nothing_is_lost() {
        let capture =
            |size: u32| cabinet_capture(&CabinetOptions { views: 6, size, ..CabinetOptions::default() }).unwrap().0;
        let config = DiscoverConfig { spacing: 1.0 / 40.0, ..DiscoverConfig::default() };
        let measure = |size: u32| {
            let capture = capture(size);
            let pictures = PerState::from_fn(|s| {
                let picture = |view| DepthPicture { view, depth: view.depth.as_ref().unwrap() };
                capture.states[s].train.iter().map(picture).collect::<Vec<_>>()
            });
            let pictures = pictures.as_ref().map(Vec::as_slice);
            let scene = Scene::new(pictures, &config).unwrap();
            let first = &scene.states[State::START];
            (sampling(pictures, config.spacing).0, first.views[0].depth.len(), first.cloud.len())
        };
        let (coarse, fine) = (measure(96), measure(288));
        assert_eq!(coarse.0, 1);
        assert!(fine.0 >= 2 && fine.1 == (288 / fine.0).pow(2), "{fine:?}");
        assert!((fine.2 as f64 / coarse.2 as f64 - 1.0).abs() < 0.15, "{coarse:?} {fine:?}");
    }

    #[test]
    fn pixels_of_derived_depth_are_unknown_and_others_without_depth_are_empty() {
        let options = CabinetOptions { views: 1, size: 32, ..CabinetOptions::default() };
        let mut view = cabinet_capture(&options).unwrap().0.states[State::START].train.remove(0);
        let depth = view.depth.take().unwrap();
        let background = (0..depth.len()).find(|i| depth.at(*i) == 0.0 && !may_hold_object(&view.rgba[*i])).unwrap();
        let is_unknown = |view: &View| DepthPicture { view, depth: &depth }.prepared(1, 0).0.is_unknown(background);
        assert!(!is_unknown(&view));
        view.derived = Some(DepthMap::new((0..depth.len()).map(|i| u16::from(i == background)).collect(), 1.0));
        assert!(is_unknown(&view));
    }

    #[test]
    fn the_noise_of_what_is_still_is_found_among_moved_surfaces() {
        // Absolute values of a normal distribution of median 1, by its quantiles, and differences of moved surfaces.
        let quantiles = [0.1, 0.25, 0.37, 0.5, 0.64, 0.78, 0.92, 1.09, 1.25, 1.44, 1.71, 2.05, 2.44, 2.91];
        let found = |moved: usize| {
            let still = quantiles.iter().cycle().take(1400).copied();
            let mut errors: Vec<f32> = still.chain((0..moved).map(|i| 20.0 * i as f32 / moved as f32)).collect();
            errors.sort_unstable_by(f32::total_cmp);
            [0.0, 1.3].map(|own| median_of_still(&errors, own))
        };
        let ([none, _], [half, with_own], [most, _]) = (found(0), found(1400), found(2000));
        assert!((0.9..1.1).contains(&none) && half < 1.25 * none && most < 1.4 * none, "{none} {half} {most}");
        assert!((with_own - 1.25 * 1.3).abs() < 1e-5, "{half} {with_own}");
        assert_eq!(median_of_still(&[], 0.0), 0.0);
    }

    #[test]
    fn cubes_agree_with_the_views() {
        use crate::discover::cube_votes::Cube;
        let scene = cabinet_scene(12, 96);
        let size = scene.upper - scene.lower;
        let place = |i: usize| {
            let t = i as f32;
            scene.lower + size * Vec3::new((0.618 * t).fract(), (0.755 * t).fract(), (0.57 * t).fract())
        };
        let places: Vec<Vec3> = (0..4000).map(place).collect();
        let votes = ViewVotes::of_all(&scene.states[State::START].views, &places, scene.tolerance);
        let (mut empty, mut hidden, mut wrong) = (0, 0, 0);
        for (p, votes) in places.iter().zip(votes) {
            match scene.cubes[State::START].at(*p) {
                Cube::Empty => (empty, wrong) = (empty + 1, wrong + usize::from(!votes.is_empty_space())),
                Cube::Hidden => (hidden, wrong) = (hidden + 1, wrong + usize::from(votes.through + votes.surface > 0)),
                Cube::Mixed => {}
            }
        }
        assert!(empty > 400 && hidden > 100 && wrong * 100 < empty + hidden, "{empty} {hidden} {wrong}");
        assert_eq!(scene.cubes[State::START].at(scene.upper + 10.0 * size), Cube::Mixed);
    }

    #[test]
    fn strips_of_moved_points_are_speckles_and_whole_surfaces_are_not() {
        let scene = cabinet_scene(12, 96);
        let cloud = &scene.states[State::START].cloud;
        // Left of the middle all points have moved; right of it those of a strip of one spacing.
        let middle = 0.5 * (scene.lower.x + scene.upper.x);
        let strip = 0.5 * (scene.lower.z + scene.upper.z);
        let near_strip = |p: &Vec3| (p.z - strip).abs() < 0.5 * scene.lengths.spacing;
        let far_right = middle + 0.2 * (scene.upper.x - scene.lower.x);
        let moved = |p: &Vec3| p.x < middle || near_strip(p);
        let given: Vec<Occupancy> =
            cloud.points.iter().map(|p| if moved(p) { Occupancy::Empty } else { Occupancy::Surface }).collect();
        let mut found = given.clone();
        scene.without_speckles(State::START, &mut found);
        let kept = |which: &dyn Fn(&Vec3) -> bool| {
            let chosen = || (0..cloud.len()).filter(|&i| which(&cloud.points[i]) && given[i] == Occupancy::Empty);
            chosen().filter(|&i| found[i] == Occupancy::Empty).count() as f64 / chosen().count().max(1) as f64
        };
        let left = kept(&|p| p.x < middle - scene.lengths.spacing);
        let right = kept(&|p| p.x > far_right && near_strip(p));
        assert!(left > 0.99 && right < 0.05, "{left} {right}");
    }
}
