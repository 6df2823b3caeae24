//! Registration of colour to depth: recorders with two lenses store images whose pixels do not show what the depth there measures.
//! Measured from edges: where depth steps from one surface to another, brightness changes.

use super::frames::brightness;
use artgs_core::{DepthMap, Recording, View};
use glam::DVec2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Search for the registration of colour to depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ColorConfig {
    /// False: colours are used as they were recorded.
    pub enabled: bool,
    /// Largest shift, as a share of the image width.
    pub largest_shift: f64,
    /// Largest difference of the scale from 1.
    pub largest_scale: f64,
    /// Least gain of the alignment of edges, 0 to 1: colours with a smaller one stay as they are. Raising it trusts the recorder more.
    pub least_gain: f64,
}

impl Default for ColorConfig {
    fn default() -> Self {
        Self { enabled: true, largest_shift: 0.07, largest_scale: 0.16, least_gain: 0.05 }
    }
}

/// Where the colour of a depth pixel is: at `center + scale (pixel - center) + shift`, pixels of the image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ColorRegistration {
    /// Size of a pixel of the depth in pixels of the colour.
    pub scale: f64,
    /// Shift in pixels, along columns and rows.
    pub shift: [f64; 2],
}

impl ColorRegistration {
    /// One sentence.
    pub fn sentence(&self) -> String {
        let [x, y] = self.shift;
        format!(
            "colour was not registered to depth: edges agree when the colour is scaled by {:.3} and moved by {x:.0}, {y:.0} pixels, \
             which was done; record with the colour registered to the depth",
            1.0 / self.scale
        )
    }
}

/// Frames that are looked at, and edge cells of all of them together.
const FRAMES: usize = 24;
const EDGES: usize = 12_000;
/// Columns of the coarse images.
const COLUMNS: usize = 200;
/// Depth step at an edge between surfaces, as a share of the nearer depth: above the steps of oblique surfaces.
const EDGE: f32 = 0.06;
/// Edge cells that a frame needs to be counted.
const LEAST_EDGES: usize = 20;
/// Frames with edges that are needed: half of them find the registration, the others confirm it.
const LEAST_FRAMES: usize = 6;
/// Standard errors by which the frames that were not used must gain.
const LEAST_ERRORS: f64 = 4.0;
/// Step of the scale in the search.
const SCALE_STEP: f64 = 0.02;

/// Edges of the depth of a frame, and how strong the brightness changes at its cells.
struct Edges {
    size: [usize; 2],
    /// Cells at edges of the depth.
    cells: Vec<DVec2>,
    /// Rank of the change of brightness among all cells of the frame, 0 to 1, row-major.
    change: Vec<f32>,
}

/// A candidate in cells.
#[derive(Clone, Copy)]
struct Shift {
    scale: f64,
    by: DVec2,
}

impl Shift {
    const NONE: Self = Self { scale: 1.0, by: DVec2::ZERO };
}

/// The registration of the colours of a recording, if they are clearly better aligned with depth after it than as recorded.
pub fn color_registration(recording: &Recording, config: &ColorConfig) -> Option<ColorRegistration> {
    let with_depth: Vec<&View> = recording.frames.iter().map(|f| &f.view).filter(|v| v.depth.is_some()).collect();
    let step = with_depth.first()?.size().0.div_ceil(COLUMNS).max(1);
    let count = with_depth.len().min(FRAMES);
    let chosen: Vec<&View> = (0..count).map(|i| with_depth[i * with_depth.len() / count]).collect();
    let edges: Vec<Option<Edges>> = chosen.into_par_iter().map(|view| Edges::new(view, step)).collect();
    let mut edges: Vec<Edges> = edges.into_iter().flatten().collect();
    if edges.len() < LEAST_FRAMES {
        return None;
    }
    let share = edges.iter().map(|e| e.cells.len()).sum::<usize>().div_ceil(EDGES).max(1);
    edges.iter_mut().for_each(|e| e.cells = e.cells.iter().copied().step_by(share).collect());
    let half = |odd: usize| edges.iter().skip(odd).step_by(2).collect::<Vec<&Edges>>();
    let (finding, confirming) = (half(0), half(1));
    let found = search(&finding, config);
    let gains: Vec<f64> = confirming.iter().map(|e| e.score(found) - e.score(Shift::NONE)).collect();
    let (mean, error) = mean_and_error(&gains);
    if mean < config.least_gain || mean < LEAST_ERRORS * error {
        return None;
    }
    let all: Vec<&Edges> = edges.iter().collect();
    let best = refined(&all, search(&all, config));
    let by = best.by * step as f64;
    Some(ColorRegistration { scale: best.scale, shift: [by.x, by.y] })
}

/// Moves the colours of all frames to the pixels whose depth they belong to.
pub(super) fn apply(recording: &mut Recording, registration: &ColorRegistration) {
    recording.frames.par_iter_mut().for_each(|frame| {
        let (width, height) = frame.view.size();
        let center = 0.5 * DVec2::new(width as f64, height as f64);
        let source = &frame.view.rgba;
        let moved = (0..width * height).map(|i| {
            let pixel = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
            let at = center + registration.scale * (pixel - center) + DVec2::from_array(registration.shift);
            interpolated(source, [width, height], at)
        });
        frame.view.rgba = moved.collect();
    });
}

/// Colour at image coordinates; that of the border outside of the image. Alpha is that of the nearest pixel: it is a label.
fn interpolated(rgba: &[[u8; 4]], [width, height]: [usize; 2], at: DVec2) -> [u8; 4] {
    let (u, v) = ((at.x - 0.5).clamp(0.0, (width - 1) as f64), (at.y - 0.5).clamp(0.0, (height - 1) as f64));
    let (x, y) = (u as usize, v as usize);
    let (fx, fy) = (u - x as f64, v - y as f64);
    let pixel = |x: usize, y: usize| rgba[y.min(height - 1) * width + x.min(width - 1)];
    let corners = [pixel(x, y), pixel(x + 1, y), pixel(x, y + 1), pixel(x + 1, y + 1)];
    let weights = [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy];
    let mut out = pixel(u.round() as usize, v.round() as usize);
    for channel in 0..3 {
        let value: f64 = corners.iter().zip(weights).map(|(c, w)| w * f64::from(c[channel])).sum();
        out[channel] = value.round() as u8;
    }
    out
}

/// The candidate of the grid whose edges of depth lie on the strongest changes of brightness.
fn search(edges: &[&Edges], config: &ColorConfig) -> Shift {
    let columns = edges.first().map_or(0, |e| e.size[0]) as f64;
    let reach = (config.largest_shift * columns).round() as i32;
    let scales = (config.largest_scale / SCALE_STEP).floor() as i32;
    let candidates: Vec<Shift> = (-scales..=scales)
        .flat_map(|s| (-reach..=reach).flat_map(move |y| (-reach..=reach).map(move |x| (s, x, y))))
        .map(|(s, x, y)| Shift { scale: 1.0 + SCALE_STEP * f64::from(s), by: DVec2::new(x.into(), y.into()) })
        .collect();
    let scores: Vec<f64> = candidates.par_iter().map(|c| score(edges, *c)).collect();
    let best = (0..scores.len()).max_by(|&a, &b| scores[a].total_cmp(&scores[b]).then(b.cmp(&a)));
    best.map_or(Shift::NONE, |i| candidates[i])
}

/// The peak of the parabolas through the neighbours of a candidate.
fn refined(edges: &[&Edges], at: Shift) -> Shift {
    let here = score(edges, at);
    let peak = |low: f64, high: f64| {
        let bend = low + high - 2.0 * here;
        if bend < 0.0 { (0.5 * (low - high) / bend).clamp(-0.5, 0.5) } else { 0.0 }
    };
    let scaled = |by: f64| score(edges, Shift { scale: at.scale + by, ..at });
    let moved = |by: DVec2| score(edges, Shift { by: at.by + by, ..at });
    Shift {
        scale: at.scale + SCALE_STEP * peak(scaled(-SCALE_STEP), scaled(SCALE_STEP)),
        by: at.by + DVec2::new(peak(moved(-DVec2::X), moved(DVec2::X)), peak(moved(-DVec2::Y), moved(DVec2::Y))),
    }
}

/// Mean score of all edge cells.
fn score(edges: &[&Edges], shift: Shift) -> f64 {
    let (sum, count) = edges.iter().fold((0.0, 0), |(sum, count), e| {
        let (s, c) = e.sums(shift);
        (sum + s, count + c)
    });
    sum / f64::from(count.max(1))
}

fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len().max(2) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

impl Edges {
    /// None if depth has too few edges.
    fn new(view: &View, step: usize) -> Option<Self> {
        let size = [view.size().0 / step, view.size().1 / step];
        let cells = depth_edges(view.depth.as_ref()?, view.size().0, step, size);
        (cells.len() >= LEAST_EDGES).then(|| Self { size, cells, change: changes(view, step, size) })
    }

    /// Sum of the ranks at the edge cells, and their number. Cells outside of the image count as an average one: leaving edges
    /// out must not pay.
    fn sums(&self, shift: Shift) -> (f64, u32) {
        const AVERAGE: f64 = 0.5;
        let [columns, rows] = self.size;
        let center = 0.5 * DVec2::new(columns as f64, rows as f64);
        let rank = |cell: &DVec2| {
            let at = center + shift.scale * (*cell - center) + shift.by;
            let inside = at.x >= 0.0 && at.y >= 0.0 && at.x < columns as f64 && at.y < rows as f64;
            if inside { f64::from(self.change[at.y as usize * columns + at.x as usize]) } else { AVERAGE }
        };
        (self.cells.iter().map(rank).sum(), self.cells.len() as u32)
    }

    fn score(&self, shift: Shift) -> f64 {
        let (sum, count) = self.sums(shift);
        sum / f64::from(count.max(1))
    }
}

/// Centres of the cells beside which depth steps to another surface.
fn depth_edges(depth: &DepthMap, width: usize, step: usize, [columns, rows]: [usize; 2]) -> Vec<DVec2> {
    let at = |x: usize, y: usize| depth.at((y * step + step / 2) * width + x * step + step / 2);
    let steps = |a: f32, b: f32| a > 0.0 && b > 0.0 && (a - b).abs() > EDGE * a.min(b);
    let mut cells = Vec::new();
    for y in 0..rows.saturating_sub(1) {
        for x in 0..columns.saturating_sub(1) {
            if steps(at(x, y), at(x + 1, y)) {
                cells.push(DVec2::new(x as f64 + 1.0, y as f64 + 0.5));
            } else if steps(at(x, y), at(x, y + 1)) {
                cells.push(DVec2::new(x as f64 + 0.5, y as f64 + 1.0));
            }
        }
    }
    cells
}

/// Rank of the change of brightness of each cell among all cells, 0 to 1.
fn changes(view: &View, step: usize, [columns, rows]: [usize; 2]) -> Vec<f32> {
    let width = view.size().0;
    let mean = |cell: usize| {
        let (x, y) = (cell % columns * step, cell / columns * step);
        let mut sum = [0.0; 3];
        for i in 0..step * step {
            let pixel = view.rgba[(y + i / step) * width + x + i % step];
            sum.iter_mut().zip(pixel).for_each(|(sum, c)| *sum += f32::from(c));
        }
        brightness(sum.map(|sum| sum / (step * step) as f32))
    };
    let bright: Vec<f32> = (0..columns * rows).map(mean).collect();
    let strength = |cell: usize| {
        let (x, y) = (cell % columns, cell / columns);
        if x == 0 || y == 0 || x + 1 == columns || y + 1 == rows {
            return 0.0;
        }
        let (gx, gy) = (bright[cell + 1] - bright[cell - 1], bright[cell + columns] - bright[cell - columns]);
        gx.hypot(gy)
    };
    let strengths: Vec<f32> = (0..columns * rows).map(strength).collect();
    let mut order: Vec<usize> = (0..strengths.len()).collect();
    order.sort_by(|&a, &b| strengths[a].total_cmp(&strengths[b]));
    let mut ranks = vec![0.0; strengths.len()];
    let last = (order.len().max(2) - 1) as f32;
    order.into_iter().enumerate().for_each(|(rank, cell)| ranks[cell] = rank as f32 / last);
    ranks
}
