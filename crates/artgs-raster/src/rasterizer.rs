//! The rasteriser: its workspaces and the order of its passes.

use crate::bin::{Bins, Grid, NOT_DRAWN};
use crate::blend::{self, Cell, TilePixels};
use crate::gather::gather;
use crate::limits::TILE;
use crate::project::{Flat, View};
use crate::{Colors, Frame, FrameGrad, RenderOptions, SplatGrads, SplatView};
use artgs_core::Camera;
use rayon::prelude::*;
use std::time::Instant;

/// Gaussians projected by one task at least.
const GRAIN: usize = 256;

/// Wall time of each pass of the last rendering and of the last backward pass, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PassSeconds {
    /// Projection of Gaussians, colours included.
    pub project: f64,
    /// Sorting and listing per tile.
    pub bin: f64,
    /// Blending pixels.
    pub blend: f64,
    /// Copying tiles into planes.
    pub assemble: f64,
    /// Adjoint of blending.
    pub blend_back: f64,
    /// Summing per Gaussian, and adjoint of projection.
    pub gather: f64,
}

/// Renders Gaussians and computes their gradients. Owns every workspace: once they have grown, a step allocates nothing.
/// Runs on the current rayon pool; results do not depend on the number of threads.
#[derive(Debug, Default)]
pub struct Rasterizer {
    frame: Frame,
    flats: Vec<Flat>,
    keys: Vec<u32>,
    grid: Grid,
    bins: Bins,
    /// Pixels of the active tiles.
    tiles: Vec<TilePixels>,
    /// Gradients of the intersections, in the order of the tiles' lists.
    cells: Vec<Cell>,
    seconds: PassSeconds,
    evaluations: usize,
}

/// Cells of consecutive active tiles, to be split among threads.
struct TileRun<'a> {
    bins: &'a Bins,
    active: &'a [u32],
    cells: &'a mut [Cell],
}

impl Rasterizer {
    /// A rasteriser with empty workspaces.
    pub fn new() -> Self {
        Self::default()
    }

    /// The last rendering.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// Intersections of Gaussians with 16 x 16 tiles in the last rendering.
    pub fn intersections(&self) -> usize {
        self.bins.total()
    }

    /// Times of the passes of the last rendering and of the last backward pass.
    pub fn seconds(&self) -> PassSeconds {
        self.seconds
    }

    /// How often the last rendering evaluated a Gaussian in a pixel, whether it reached that pixel or not. The backward
    /// pass makes as many evaluations.
    pub fn evaluations(&self) -> usize {
        self.evaluations
    }

    /// Renders the Gaussians as the camera sees them. Gaussians with parameters that are not finite are ignored.
    ///
    /// # Panics
    /// If the arrays of `splats` differ in length.
    pub fn forward(&mut self, splats: SplatView<'_>, camera: &Camera, options: &RenderOptions) -> &Frame {
        check(&splats);
        let view = View::new(camera, options);
        let mut clock = Instant::now();
        self.project(&splats, &view);
        self.seconds.project = lap(&mut clock);
        self.grid = Grid::new(view.size);
        self.bins.fill(&self.grid, &self.flats, &self.keys);
        self.seconds.bin = lap(&mut clock);
        let Self { bins, grid, flats, tiles, evaluations, .. } = self;
        if tiles.len() < bins.active.len() {
            tiles.resize_with(bins.active.len(), TilePixels::default);
        }
        let blend = |(&tile, pixels): (&u32, &mut TilePixels)| {
            blend::forward(flats, bins.list(tile), grid.origin(tile as usize), options.background, pixels)
        };
        *evaluations = bins.active.par_iter().zip(tiles.par_iter_mut()).map(blend).sum();
        self.seconds.blend = lap(&mut clock);
        self.assemble(view.size, options.background);
        self.seconds.assemble = lap(&mut clock);
        &self.frame
    }

    fn project(&mut self, splats: &SplatView<'_>, view: &View) {
        let n = splats.means.len();
        self.flats.resize(n, Flat::default());
        self.keys.resize(n, NOT_DRAWN);
        let targets = self.flats.par_iter_mut().zip(self.keys.par_iter_mut()).enumerate().with_min_len(GRAIN);
        targets.for_each(|(i, (flat, key))| {
            *key = NOT_DRAWN;
            if let Some(projected) = view.project(splats, i) {
                // Positive floats are ordered as their bits are.
                (*flat, *key) = (projected, projected.depth.to_bits());
            }
        });
    }

    /// Copies the tiles into the planes of the frame, the background where there is no tile.
    fn assemble(&mut self, [width, height]: [usize; 2], background: [f32; 3]) {
        let Self { frame, bins, grid, tiles, .. } = self;
        let size = width * height;
        (frame.width, frame.height) = (width, height);
        frame.rgb.resize(3 * size, 0.0);
        frame.depth.resize(size, 0.0);
        frame.alpha.resize(size, 0.0);
        if size == 0 {
            return;
        }
        let (red, rest) = frame.rgb.split_at_mut(size);
        let (green, blue) = rest.split_at_mut(size);
        let [r, g, b] = background;
        let planes = [(red, r), (green, g), (blue, b), (&mut frame.depth[..], 0.0), (&mut frame.alpha[..], 0.0)];
        planes.into_par_iter().enumerate().for_each(|(plane, (pixels, empty))| {
            pixels.par_chunks_mut(width * TILE).enumerate().for_each(|(tile_row, band)| {
                band.fill(empty);
                let first = bins.active.partition_point(|&t| (t as usize) < tile_row * grid.tiles[0]);
                let last = bins.active.partition_point(|&t| (t as usize) < (tile_row + 1) * grid.tiles[0]);
                for (&tile, pixels) in bins.active[first..last].iter().zip(&tiles[first..last]) {
                    let left = grid.origin(tile as usize)[0];
                    let right = width.min(left + TILE);
                    for (row, line) in band.chunks_mut(width).enumerate() {
                        pixels.copy_row(plane, row, &mut line[left..right]);
                    }
                }
            });
        });
    }

    /// Computes the gradients of every parameter from the gradient of a loss with respect to the last rendering, overwriting
    /// `grads`.
    /// Must follow a [`forward`](Self::forward) with the same arguments.
    ///
    /// # Panics
    /// If the sizes of `splats`, `camera` or `d_frame` are not those of the last rendering.
    pub fn backward(
        &mut self,
        splats: SplatView<'_>,
        camera: &Camera,
        options: &RenderOptions,
        d_frame: &FrameGrad,
        grads: &mut SplatGrads,
    ) {
        check(&splats);
        let view = View::new(camera, options);
        let size = self.frame.width * self.frame.height;
        assert_eq!(view.size, [self.frame.width, self.frame.height], "backward follows a forward of the same camera");
        assert_eq!(splats.means.len(), self.flats.len(), "backward follows a forward of the same Gaussians");
        let sizes = [d_frame.rgb.len(), d_frame.depth.len(), d_frame.alpha.len()];
        assert_eq!(sizes, [3 * size, size, size], "the gradient has the layout of the frame");
        let Self { frame, flats, grid, bins, cells, seconds, .. } = self;
        let mut clock = Instant::now();
        if cells.len() < bins.total() {
            cells.resize(bins.total(), Cell::default());
        }
        let all = TileRun { bins, active: &bins.active, cells: &mut cells[..bins.total()] };
        rayon::iter::split(all, TileRun::split).for_each(|run| {
            run.for_each(|tile, cells| {
                blend::backward(flats, bins.list(tile), grid.origin(tile as usize), frame, d_frame, cells);
            });
        });
        seconds.blend_back = lap(&mut clock);
        gather(&view, &splats, flats, bins, cells, grads);
        seconds.gather = lap(&mut clock);
    }
}

impl TileRun<'_> {
    /// In two parts of about the same number of intersections.
    fn split(self) -> (Self, Option<Self>) {
        let Some((&first, _)) = self.active.split_first() else { return (self, None) };
        if self.active.len() < 2 {
            return (self, None);
        }
        let start = self.bins.start(first);
        let middle = start + self.cells.len() / 2;
        let at = self.active.partition_point(|&t| self.bins.start(t) < middle).clamp(1, self.active.len() - 1);
        let (left, right) = self.active.split_at(at);
        let (first_cells, other_cells) = self.cells.split_at_mut(self.bins.start(right[0]) - start);
        let part = |active, cells| Self { bins: self.bins, active, cells };
        (part(left, first_cells), Some(part(right, other_cells)))
    }

    fn for_each(self, mut visit: impl FnMut(u32, &mut [Cell])) {
        let mut cells = self.cells;
        for &tile in self.active {
            let (own, rest) = cells.split_at_mut(self.bins.list(tile).len());
            visit(tile, own);
            cells = rest;
        }
    }
}

/// Seconds since the last lap.
fn lap(clock: &mut Instant) -> f64 {
    let seconds = clock.elapsed().as_secs_f64();
    *clock = Instant::now();
    seconds
}

fn check(splats: &SplatView<'_>) {
    let n = splats.means.len();
    let lens = [splats.rotations.len(), splats.log_scales.len(), splats.logit_opacities.len()];
    assert_eq!(lens, [n; 3], "one rotation, scale and opacity per Gaussian");
    match splats.colors {
        Colors::Fixed(c) => assert_eq!(c.len(), n, "one colour per Gaussian"),
        Colors::Sh { sh, degree, frames } => {
            assert!(degree <= 3, "harmonics of degree 0 to 3");
            assert_eq!(sh.len(), n * 3 * (degree + 1) * (degree + 1), "one set of harmonics per Gaussian");
            assert!(frames.is_none_or(|f| f.index.len() == n), "one frame per Gaussian");
        }
    }
}
