//! `preview.png`: both states, photo beside rendering beside parts in colours with their axes and numbers.

use super::lettering::lettered;
use crate::articulation::{Posed, Trained};
use artgs_core::{Camera, Capture, Joint, JointEstimate, JointKind, State, View};
use artgs_io::FileError;
use artgs_raster::Rasterizer;
use glam::{DVec2, DVec3};
use std::path::Path;

/// Colours of parts, repeated when they run out; the static part is grey.
const PALETTE: [[f32; 3]; 8] = [
    [0.90, 0.29, 0.23],
    [0.20, 0.55, 0.85],
    [0.30, 0.70, 0.35],
    [0.95, 0.70, 0.15],
    [0.60, 0.35, 0.75],
    [0.10, 0.75, 0.75],
    [0.90, 0.45, 0.70],
    [0.55, 0.45, 0.30],
];
const STATIC: [f32; 3] = [0.65, 0.65, 0.68];
const AXIS: [f32; 3] = [1.0, 1.0, 0.2];
const LETTERS: [f32; 3] = [0.85, 0.85, 0.85];
const BEHIND_LETTERS: [f32; 3] = [0.05, 0.05, 0.05];
const BACKGROUND: f32 = 0.12;

/// Colour of a part.
fn part_color(part: usize) -> [f32; 3] {
    if part == 0 { STATIC } else { PALETTE[(part - 1) % PALETTE.len()] }
}

/// An image while it is drawn, sRGB in [0, 1].
struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
}

impl Canvas {
    fn new(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![[BACKGROUND; 3]; width * height] }
    }

    fn put(&mut self, x: usize, y: usize, color: [f32; 3]) {
        if x < self.width && y < self.height {
            self.pixels[y * self.width + x] = color;
        }
    }

    fn line(&mut self, tile: (usize, usize), from: DVec2, to: DVec2, size: DVec2, color: [f32; 3]) {
        let steps = (to - from).abs().max_element().min(4.0 * size.max_element()) as usize + 1;
        for i in 0..=steps {
            let p = from.lerp(to, i as f64 / steps as f64);
            if p.cmpge(DVec2::ZERO).all() && p.cmplt(size - 1.0).all() {
                for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    self.put(tile.0 + p.x as usize + dx, tile.1 + p.y as usize + dy, color);
                }
            }
        }
    }
}

/// An opaque image: two views of each state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Preview {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// sRGB, row-major from the top, `[height * width]`.
    pub rgb: Vec<[u8; 3]>,
}

impl Preview {
    /// Renders two views of each state.
    pub(super) fn new(capture: &Capture, trained: &Trained, found: &[JointEstimate], rotate_sh: bool) -> Self {
        let views = |state: State| &capture.states[state].train;
        let sizes = State::ALL.into_iter().flat_map(views).map(View::size);
        let (w, h) = sizes.fold((0, 0), |a, b| (a.0.max(b.0), a.1.max(b.1)));
        let mut canvas = Canvas::new(6 * w, 2 * h);
        let mut rasterizer = Rasterizer::new();
        for state in State::ALL {
            let posed = trained.posed(state);
            for (column, pick) in best_views(&posed, views(state), &mut rasterizer).into_iter().enumerate() {
                let view = &views(state)[pick];
                let at = |tile: usize| ((3 * column + tile) * w, state.index() * h);
                photo(&mut canvas, at(0), view);
                rendering(&mut canvas, at(1), view, &posed, rotate_sh, &mut rasterizer);
                parts(&mut canvas, at(2), view, &posed, &mut rasterizer);
                axes(&mut canvas, at(2), &view.camera, (trained, found), state);
                numbers(&mut canvas, at(2), view, &posed);
                for (tile, panel) in ["PHOTO", "RENDERED", "PARTS"].into_iter().enumerate() {
                    label(&mut canvas, at(tile), &format!("{} {panel}", state.name().to_uppercase()), w);
                }
            }
        }
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        let rgb = canvas.pixels.iter().map(|p| p.map(byte)).collect();
        Self { width: canvas.width as u32, height: canvas.height as u32, rgb }
    }

    /// Writes it as PNG.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        artgs_io::image_io::write_rgb(path, self.width, self.height, &self.rgb)
    }
}

/// The view that shows the movable parts best, and the one from another side that adds most to it: a large part does not outweigh a small one that
/// is hidden.
fn best_views(posed: &Posed<'_>, views: &[View], rasterizer: &mut Rasterizer) -> Vec<usize> {
    /// Views that are compared, evenly spaced.
    const COMPARED: usize = 32;
    let step = views.len().div_ceil(COMPARED).max(1);
    let shown: Vec<(usize, Vec<f32>)> =
        (0..views.len()).step_by(step).map(|i| (i, shown_areas(posed, &views[i].camera, rasterizer))).collect();
    let best = |beside: &[f32], allowed: &dyn Fn(usize) -> bool| {
        let score = |areas: &[f32]| -> f32 {
            areas.iter().enumerate().map(|(k, a)| a.max(beside.get(k).copied().unwrap_or(0.0)).sqrt()).sum()
        };
        let scored = shown.iter().filter(|(i, _)| allowed(*i)).map(|(i, areas)| (score(areas), *i, areas));
        scored.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))).map(|(_, i, areas)| (i, areas))
    };
    let Some((first, areas)) = best(&[], &|_| true) else { return Vec::new() };
    let eye = |i: usize| views[i].camera.position();
    let centre = views.iter().map(|v| v.camera.position()).sum::<DVec3>() / views.len() as f64;
    let apart = |i: usize| i != first && (eye(i) - eye(first)).length() > 0.5 * (eye(first) - centre).length();
    std::iter::once(first).chain(best(areas, &apart).map(|second| second.0)).collect()
}

/// Pixels that each movable part covers in a camera, part 1 first.
fn shown_areas(posed: &Posed<'_>, camera: &Camera, rasterizer: &mut Rasterizer) -> Vec<f32> {
    let parts = usize::from(posed.labels.iter().copied().max().unwrap_or(0));
    let mut areas = Vec::with_capacity(parts);
    // Each channel shows one part.
    for first in (1..=parts).step_by(3) {
        let channel = |label: u16, c: usize| f32::from(u8::from(usize::from(label) == first + c));
        let colors: Vec<[f32; 3]> = posed.labels.iter().map(|l| [0, 1, 2].map(|c| channel(*l, c))).collect();
        let frame = posed.render_fixed(rasterizer, camera, &colors);
        let pixels = frame.alpha.len();
        areas.extend((0..3.min(parts + 1 - first)).map(|c| frame.rgb[c * pixels..][..pixels].iter().sum::<f32>()));
    }
    areas
}

fn photo(canvas: &mut Canvas, tile: (usize, usize), view: &View) {
    let w = view.size().0;
    for (i, p) in view.rgba.iter().enumerate() {
        let a = f32::from(p[3]) / 255.0;
        let mix = |c: u8| f32::from(c) / 255.0 * a + BACKGROUND * (1.0 - a);
        canvas.put(tile.0 + i % w, tile.1 + i / w, [mix(p[0]), mix(p[1]), mix(p[2])]);
    }
}

fn paste(canvas: &mut Canvas, tile: (usize, usize), frame: &artgs_raster::Frame) {
    let n = frame.alpha.len();
    for i in 0..n {
        let behind = BACKGROUND * (1.0 - frame.alpha[i]);
        let color = [0, 1, 2].map(|c| frame.rgb[c * n + i] + behind);
        canvas.put(tile.0 + i % frame.width, tile.1 + i / frame.width, color);
    }
}

fn rendering(
    canvas: &mut Canvas,
    tile: (usize, usize),
    view: &View,
    posed: &Posed<'_>,
    rotate_sh: bool,
    rasterizer: &mut Rasterizer,
) {
    paste(canvas, tile, posed.render(rasterizer, &view.camera, rotate_sh));
}

fn parts(canvas: &mut Canvas, tile: (usize, usize), view: &View, posed: &Posed<'_>, rasterizer: &mut Rasterizer) {
    // Shaded by the luminance of the photo, so that shapes stay readable.
    let colors: Vec<[f32; 3]> = posed.labels.iter().map(|l| part_color(usize::from(*l))).collect();
    let frame = posed.render_fixed(rasterizer, &view.camera, &colors);
    let mut shaded = frame.clone();
    let n = shaded.alpha.len();
    for (i, p) in view.rgba.iter().enumerate() {
        let luminance = (0.3 * f32::from(p[0]) + 0.6 * f32::from(p[1]) + 0.1 * f32::from(p[2])) / 255.0;
        (0..3).for_each(|c| shaded.rgb[c * n + i] *= 0.55 + 0.6 * luminance);
    }
    paste(canvas, tile, &shaded);
}

/// Words in the corner of a tile, as large as leaves most of it free; none where they do not fit.
fn label(canvas: &mut Canvas, tile: (usize, usize), text: &str, width: usize) {
    let scale = (width / 240).max(1);
    let pixels = lettered(text);
    if pixels.iter().any(|(x, _)| (x + 3) * scale > width) {
        return;
    }
    for (x, y) in pixels {
        for (dx, dy) in (0..scale).flat_map(|dy| (0..scale).map(move |dx| (dx, dy))) {
            canvas.put(tile.0 + (x + 2) * scale + dx, tile.1 + (y + 2) * scale + dy, LETTERS);
        }
    }
}

/// The number of every movable part on its middle, dark around the digits so that they are readable on any colour.
fn numbers(canvas: &mut Canvas, tile: (usize, usize), view: &View, posed: &Posed<'_>) {
    let (w, h) = view.size();
    let scale = (w / 160).max(1);
    let parts = posed.labels.iter().copied().max().unwrap_or(0);
    for part in 1..=parts {
        let Some(middle) = middle_pixel(posed, part, &view.camera) else { continue };
        let pixels = lettered(&part.to_string());
        let right = pixels.iter().map(|(x, _)| x + 1).max().unwrap_or(0);
        let size = DVec2::new((right * scale) as f64, (7 * scale) as f64);
        let corner = middle - 0.5 * size;
        let edge = DVec2::splat(scale as f64);
        if corner.cmplt(edge).any() || (corner + size + edge).cmpgt(DVec2::new(w as f64, h as f64)).any() {
            continue;
        }
        let corner = (tile.0 + corner.x as usize, tile.1 + corner.y as usize);
        for around in [true, false] {
            let (low, high, color) = if around { (0, 3, BEHIND_LETTERS) } else { (1, 2, LETTERS) };
            for (x, y) in &pixels {
                for (dx, dy) in
                    (low * scale..high * scale).flat_map(|dy| (low * scale..high * scale).map(move |dx| (dx, dy)))
                {
                    canvas.put(corner.0 + x * scale + dx - scale, corner.1 + y * scale + dy - scale, color);
                }
            }
        }
    }
}

/// Where the middle of a part is in an image, pixels; none without Gaussians or behind the camera.
fn middle_pixel(posed: &Posed<'_>, part: u16, camera: &Camera) -> Option<DVec2> {
    let own = posed.labels.iter().zip(&posed.splats.means).filter(|(label, _)| **label == part);
    let (sum, count) = own.fold((DVec3::ZERO, 0usize), |(sum, n), (_, p)| (sum + DVec3::from(p.map(f64::from)), n + 1));
    let (pixel, depth) = camera.project(sum / count.max(1) as f64);
    (count > 0 && depth > 0.0).then_some(pixel)
}

/// Axes of the joints: through the hinge, or from the part's centre along the slide.
fn axes(
    canvas: &mut Canvas,
    tile: (usize, usize),
    camera: &Camera,
    object: (&Trained, &[JointEstimate]),
    state: State,
) {
    let (trained, found) = object;
    let posed = trained.at_state(state);
    for (k, part) in found.iter().enumerate() {
        let points: Vec<DVec3> =
            trained.members(k + 1).map(|i| DVec3::from_array(posed.means[i].map(f64::from))).collect();
        if points.is_empty() {
            continue;
        }
        let centre = points.iter().sum::<DVec3>() / points.len() as f64;
        let joint = Joint::from_motion(part.kind, &part.motion).with_origin_near(centre);
        let along = |p: &DVec3| (*p - joint.origin).dot(joint.axis);
        let (lo, hi) =
            points.iter().map(along).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let margin = 0.15 * (hi - lo);
        let (from, to) = match joint.kind {
            JointKind::Prismatic => (0.0, joint.state_values[State::END]),
            _ => (lo - margin, hi + margin),
        };
        let ends = [from, to].map(|x| camera.project(joint.origin + joint.axis * x));
        if ends.iter().all(|e| e.1 > 0.0) {
            let size = DVec2::new(camera.intrinsics.width.into(), camera.intrinsics.height.into());
            canvas.line(tile, ends[0].0, ends[1].0, size, AXIS);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{Intrinsics, Splats};

    /// A large part before a static wall, and a small one behind it.
    #[test]
    fn a_small_part_that_a_large_one_outweighs_is_shown_by_one_of_the_views() {
        let mut splats = Splats::empty(0);
        let mut labels = Vec::new();
        let mut patch = |label: u16, y: f32, half: i16| {
            for (i, j) in (-half..=half).flat_map(|i| (-half..=half).map(move |j| (i, j))) {
                splats.means.push([0.05 * f32::from(i), y, 0.05 * f32::from(j)]);
                splats.rotations.push([1.0, 0.0, 0.0, 0.0]);
                splats.log_scales.push([0.025f32.ln(); 3]);
                splats.logit_opacities.push(8.0);
                splats.sh.extend([0.0; 3]);
                labels.push(label);
            }
        };
        patch(0, 0.0, 12);
        patch(1, -0.1, 10);
        patch(2, 0.6, 2);
        let posed = Posed { splats, labels: &labels, world_to_part: Vec::new() };
        let intrinsics = Intrinsics { fx: 64.0, fy: 64.0, cx: 32.0, cy: 32.0, width: 64, height: 64 };
        let view = |x: f64, y: f64| {
            let camera = Camera::look_at(intrinsics, DVec3::new(x, y, 0.0), DVec3::ZERO, DVec3::Z);
            View::new("", camera, vec![[255; 4]; 64 * 64], None)
        };
        let views = [view(0.0, -2.0), view(1.5, -1.4), view(-1.5, -1.4), view(0.0, 3.0)];
        let areas: Vec<Vec<f32>> =
            views.iter().map(|v| shown_areas(&posed, &v.camera, &mut Rasterizer::new())).collect();
        assert!(areas[..3].iter().all(|a| a[0] > 2.0 * areas[3].iter().sum::<f32>() && a[1] < 1.0), "{areas:?}");
        assert!(areas[3][1] > 10.0, "{areas:?}");
        let mut best = best_views(&posed, &views, &mut Rasterizer::new());
        best.sort_unstable();
        assert_eq!(best, [0, 3]);
    }
}
