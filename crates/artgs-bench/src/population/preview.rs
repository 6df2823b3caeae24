//! A small picture of an object: of each state a photo, the true parts and the found ones. A found part has the colour of the true part
//! that it covers.

use super::overlap::TrueSurface;
use super::truth::{diagonal, middle};
use artgs::discover::Discovery;
use artgs_core::{Camera, Joint, JointKind, PerState, State, View};
use artgs_io::GroundTruth;
use glam::{DVec2, DVec3};

/// Width and height of a tile, pixels.
const TILE: [usize; 2] = [200, 150];
/// Tiles side by side, and of both states.
const TILES: [usize; 2] = [3, 2];
/// Only every so many-th true point is drawn to choose a view.
const CHOICE_STEP: usize = 40;
/// Pixels of a tile per pixel of the picture by which a view is chosen.
const CHOICE_SCALE: f64 = 0.2;
/// Free part of a tile beside the object, share of its size.
const MARGIN: f64 = 0.08;
const BACKGROUND: [u8; 3] = [30, 30, 32];
const STATIC: [u8; 3] = [166, 166, 173];
const AXIS: [u8; 3] = [255, 255, 50];
/// Colours of true movable parts, repeated when they run out.
const PALETTE: [[u8; 3]; 8] = [
    [230, 74, 59],
    [51, 140, 217],
    [77, 179, 89],
    [242, 179, 38],
    [26, 191, 191],
    [140, 115, 77],
    [153, 204, 51],
    [140, 102, 204],
];
/// Colours of found parts that cover no true one.
const EXTRA: [[u8; 3]; 3] = [[255, 0, 255], [255, 140, 220], [160, 0, 120]];

/// What a picture shows.
pub(super) struct Shown<'a> {
    /// Views of the object in the world of the run.
    pub(super) views: PerState<&'a [View]>,
    /// The truth in the same world.
    pub(super) truth: &'a GroundTruth,
    /// Its surfaces.
    pub(super) surfaces: &'a PerState<TrueSurface>,
    /// The result, and for each found part the true part that it covers; none if the run has no result.
    pub(super) found: Option<(&'a Discovery, &'a [Option<usize>])>,
}

/// An opaque picture.
pub(super) struct Picture {
    /// Pixels per row.
    pub(super) width: usize,
    /// Rows.
    pub(super) height: usize,
    /// sRGB, row-major, `[height * width]`.
    pub(super) rgb: Vec<[u8; 3]>,
}

/// Draws the picture; a state without views has empty tiles.
pub(super) fn draw(shown: &Shown<'_>) -> Picture {
    let mut picture = Picture::new(TILES[0] * TILE[0], TILES[1] * TILE[1]);
    for state in State::ALL {
        let Some((view, window)) = best_view(shown.views[state], &shown.surfaces[state]) else { continue };
        let row = state.index() * TILE[1];
        let photo = Tile::photo(view, &window);
        picture.paste(0, row, &photo.colors);
        let mut truth = Tile::new();
        let surface = &shown.surfaces[state];
        for (point, part) in surface.points.iter().zip(&surface.parts) {
            truth.point(view, &window, DVec3::from_array(*point), 1, true_color(*part));
        }
        truth.shade(&photo);
        if state == State::START {
            for (joint, mesh) in shown.truth.joints.iter().zip(&shown.truth.movable) {
                truth.axis(view, &window, joint, middle(&mesh[state]), 0.6 * diagonal(&mesh[state]));
            }
        }
        picture.paste(TILE[0], row, &truth.colors);
        if let Some((found, pairs)) = shown.found {
            picture.paste(2 * TILE[0], row, &found_tile(found, pairs, state, view, &window, &photo).colors);
        }
    }
    picture
}

fn found_tile(
    found: &Discovery,
    pairs: &[Option<usize>],
    state: State,
    view: &View,
    window: &Window,
    photo: &Tile,
) -> Tile {
    let mut tile = Tile::new();
    for (point, label) in found.clouds[state].points.iter().zip(&found.labels[state]) {
        let point = point.as_dvec3();
        let depth = view.camera.project(point).1.max(1e-9);
        let reach = 0.6 * found.spacing * view.camera.intrinsics.fx / depth * window.scale;
        tile.point(view, window, point, reach.round().clamp(1.0, 5.0) as i64, found_color(usize::from(*label), pairs));
    }
    tile.shade(photo);
    for (index, part) in found.parts.iter().enumerate().filter(|_| state == State::START) {
        let centre = found.middle(index + 1, state);
        let joint = Joint::from_motion(part.kind, &part.motion).with_origin_near(centre);
        tile.axis(view, window, &joint, centre, 0.25 * found.diagonal);
    }
    tile
}

fn true_color(part: usize) -> [u8; 3] {
    if part == 0 { STATIC } else { PALETTE[(part - 1) % PALETTE.len()] }
}

fn found_color(label: usize, pairs: &[Option<usize>]) -> [u8; 3] {
    match label.checked_sub(1) {
        None => STATIC,
        Some(k) => pairs.get(k).copied().flatten().map_or(EXTRA[k % EXTRA.len()], |truth| true_color(truth + 1)),
    }
}

/// The part of an image that a tile shows.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Window {
    /// Pixel of the image at the upper left corner of the tile.
    corner: DVec2,
    /// Pixels of the tile per pixel of the image.
    scale: f64,
}

impl Window {
    /// Around what a camera sees of points, with the shape of a tile; none if it sees none of them.
    fn around(points: impl Iterator<Item = DVec3>, camera: &Camera) -> Option<Self> {
        let seen = points.map(|p| camera.project(p)).filter(|(_, depth)| *depth > 0.0);
        let image = DVec2::new(camera.intrinsics.width.into(), camera.intrinsics.height.into());
        let (low, high) = seen.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), (pixel, _)| {
            let pixel = pixel.clamp(DVec2::ZERO, image);
            (low.min(pixel), high.max(pixel))
        });
        let size = (high - low) * (1.0 + 2.0 * MARGIN);
        let tile = DVec2::new(TILE[0] as f64, TILE[1] as f64);
        let scale = (tile / size).min_element();
        (low.is_finite() && scale.is_finite()).then(|| Self { corner: 0.5 * (low + high) - 0.5 * tile / scale, scale })
    }

    /// Where a world point is in the tile, and its depth; none behind the camera.
    fn place(&self, camera: &Camera, point: DVec3) -> Option<(DVec2, f64)> {
        let (pixel, depth) = camera.project(point);
        (depth > 0.0).then(|| ((pixel - self.corner) * self.scale, depth))
    }
}

/// The view that shows most of the movable parts, and the window around the object in it.
fn best_view<'v>(views: &'v [View], surface: &TrueSurface) -> Option<(&'v View, Window)> {
    let points = || surface.points.iter().step_by(CHOICE_STEP).map(|p| DVec3::from_array(*p));
    let shown = |view: &View| {
        let Some(window) = Window::around(points(), &view.camera) else { return 0 };
        let small = Window { scale: window.scale * CHOICE_SCALE, ..window };
        let mut tile = Tile::new();
        for (point, part) in points().zip(surface.parts.iter().step_by(CHOICE_STEP)) {
            tile.point(view, &small, point, 0, if *part > 0 { AXIS } else { STATIC });
        }
        tile.colors.iter().filter(|color| **color == AXIS).count()
    };
    // The first of equally good views, and the first view if none shows a movable part.
    let best = views.iter().rev().max_by_key(|view| shown(view))?;
    Some((best, Window::around(points(), &best.camera)?))
}

/// A tile while it is drawn.
struct Tile {
    colors: Vec<[u8; 3]>,
    depths: Vec<f64>,
}

impl Tile {
    fn new() -> Self {
        let count = TILE[0] * TILE[1];
        Self { colors: vec![BACKGROUND; count], depths: vec![f64::INFINITY; count] }
    }

    fn photo(view: &View, window: &Window) -> Self {
        let (mut tile, (width, height)) = (Self::new(), view.size());
        for (i, color) in tile.colors.iter_mut().enumerate() {
            let at = DVec2::new((i % TILE[0]) as f64 + 0.5, (i / TILE[0]) as f64 + 0.5) / window.scale + window.corner;
            if at.cmplt(DVec2::ZERO).any() || at.x >= width as f64 || at.y >= height as f64 {
                continue;
            }
            let [r, g, b, a] = view.rgba[at.y as usize * width + at.x as usize];
            let mix = |c: u8, behind: u8| {
                ((u32::from(c) * u32::from(a) + u32::from(behind) * u32::from(255 - a)) / 255) as u8
            };
            *color = [mix(r, BACKGROUND[0]), mix(g, BACKGROUND[1]), mix(b, BACKGROUND[2])];
        }
        tile
    }

    /// A square of `2 reach + 1` pixels, where nothing nearer was drawn.
    fn point(&mut self, view: &View, window: &Window, point: DVec3, reach: i64, color: [u8; 3]) {
        let Some((at, depth)) = window.place(&view.camera, point) else { return };
        let (x, y) = (at.x.floor() as i64, at.y.floor() as i64);
        for (x, y) in (y - reach..=y + reach).flat_map(|y| (x - reach..=x + reach).map(move |x| (x, y))) {
            if (0..TILE[0] as i64).contains(&x) && (0..TILE[1] as i64).contains(&y) {
                let i = y as usize * TILE[0] + x as usize;
                if depth < self.depths[i] {
                    (self.depths[i], self.colors[i]) = (depth, color);
                }
            }
        }
    }

    /// Darker where the photo is, so that shapes stay readable.
    fn shade(&mut self, photo: &Self) {
        for ((color, depth), seen) in self.colors.iter_mut().zip(&self.depths).zip(&photo.colors) {
            if depth.is_finite() {
                let luminance = 0.3 * f64::from(seen[0]) + 0.6 * f64::from(seen[1]) + 0.1 * f64::from(seen[2]);
                *color = color.map(|c| (f64::from(c) * (0.55 + 0.6 * luminance / 255.0)) as u8);
            }
        }
    }

    /// The axis of a joint: both ways from the middle of its part, or from there along the slide.
    fn axis(&mut self, view: &View, window: &Window, joint: &Joint, centre: DVec3, reach: f64) {
        let near = joint.with_origin_near(centre).origin;
        let ends = match joint.kind {
            JointKind::Prismatic => [near, near + joint.axis * joint.state_values[State::END]],
            _ => [near - joint.axis * reach, near + joint.axis * reach],
        };
        let [Some((from, _)), Some((to, _))] = ends.map(|end| window.place(&view.camera, end)) else { return };
        let steps = (to - from).abs().max_element().min(4.0 * TILE[0] as f64) as usize + 1;
        for i in 0..=steps {
            let p = from.lerp(to, i as f64 / steps as f64);
            if p.cmpge(DVec2::ZERO).all() && p.x < TILE[0] as f64 && p.y < TILE[1] as f64 {
                self.colors[p.y as usize * TILE[0] + p.x as usize] = AXIS;
            }
        }
    }
}

impl Picture {
    fn new(width: usize, height: usize) -> Self {
        Self { width, height, rgb: vec![BACKGROUND; width * height] }
    }

    fn paste(&mut self, x: usize, y: usize, tile: &[[u8; 3]]) {
        for (row, pixels) in tile.chunks(TILE[0]).enumerate() {
            self.rgb[(y + row) * self.width + x..][..TILE[0]].copy_from_slice(pixels);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::population::testing::{cupboard, found_as};
    use artgs_core::Intrinsics;

    fn view(eye: DVec3) -> View {
        let intrinsics = Intrinsics { fx: 100.0, fy: 100.0, cx: 60.0, cy: 50.0, width: 120, height: 100 };
        let camera = Camera::look_at(intrinsics, eye, DVec3::new(1.0, 0.5, 0.5), DVec3::Z);
        View { name: "a".into(), camera, rgba: vec![[200, 200, 200, 255]; 12_000], depth: None, derived: None }
    }

    fn count(picture: &Picture, tile: usize, like: [u8; 3]) -> usize {
        // Shading keeps the ratios of the channels.
        let sum = |c: &[u8; 3]| c.iter().map(|v| f64::from(*v)).sum::<f64>();
        let same = |c: &[u8; 3]| {
            let factor = sum(c) / sum(&like);
            factor > 0.5 && (0..3).all(|i| (f64::from(c[i]) - factor * f64::from(like[i])).abs() < 2.5)
        };
        let row = |y: usize| &picture.rgb[y * picture.width + tile * TILE[0]..][..TILE[0]];
        (0..TILE[1]).map(|y| row(y).iter().filter(|c| same(c)).count()).sum()
    }

    #[test]
    fn found_parts_have_the_colours_of_the_true_ones() {
        let truth = cupboard();
        let surfaces = PerState::from_fn(|state| TrueSurface::new(&truth, state));
        let found = found_as(&truth, &[2, 1]);
        // The first camera sees the back plate, the second the fronts.
        let views = [view(DVec3::new(1.0, 5.0, 0.5)), view(DVec3::new(1.0, -4.0, 0.5))];
        let shown = |pairs: &[Option<usize>]| {
            draw(&Shown {
                views: PerState::new(&views[..], &views[..]),
                truth: &truth,
                surfaces: &surfaces,
                found: Some((&found, pairs)),
            })
        };
        let picture = shown(&[Some(1), Some(0)]);
        assert_eq!((picture.width, picture.height, picture.rgb.len()), (600, 300, 180_000));
        for color in [PALETTE[0], PALETTE[1]] {
            let (own, wanted) = (count(&picture, 2, color), count(&picture, 1, color));
            assert!(wanted > 3000 && own.abs_diff(wanted) < wanted / 5, "{own} {wanted}");
        }
        let extra = shown(&[Some(1), None]);
        assert_eq!(count(&extra, 2, PALETTE[0]), 0);
        assert!(count(&extra, 2, EXTRA[1]) > 3000);
    }

    #[test]
    fn without_views_or_result_tiles_are_empty() {
        let truth = cupboard();
        let surfaces = PerState::from_fn(|state| TrueSurface::new(&truth, state));
        let views = [view(DVec3::new(1.0, -4.0, 0.5))];
        let shown = Shown { views: PerState::new(&views[..], &[]), truth: &truth, surfaces: &surfaces, found: None };
        let picture = draw(&shown);
        let tile = |x: usize, y: usize| picture.rgb[(y * TILE[1] + 75) * picture.width + x * TILE[0] + 100];
        assert!(tile(0, 0) != BACKGROUND && tile(1, 0) != BACKGROUND);
        assert!([tile(2, 0), tile(0, 1), tile(1, 1)].iter().all(|color| *color == BACKGROUND));
    }
}
