//! Targets of the Chamfer term on the device, in uniform grids.

use crate::constants::{CHAMFER, GROUP};
use crate::kernels::Kernels;
use crate::published::membership::constant;
use crate::scene::{Gaussians, Program, Size, StepBuffers};
use crate::shared::shared_struct;
use crate::step::Step;
use crate::{Gpu, GpuError};
use artgs::fit::{Articulated, ChamferTargets};
use artgs_core::State;
use std::sync::Arc;
use wgpu::Buffer;

/// Cells per target: most are empty because targets lie on surfaces.
const CELLS_PER_POINT: f64 = 4.0;
/// Most cells along an axis.
const MAX_CELLS: f32 = 512.0;

shared_struct! {
    /// A uniform grid around the targets of a state.
    pub(crate) struct Grid {
        origin: [f32; 3],
        /// Edge of a cell, scene units.
        side: f32,
        size: [u32; 3],
        /// Where the cells of the state begin.
        begin: u32,
        /// Number of points.
        count: u32,
        pad_a: u32,
        pad_b: u32,
        pad_c: u32,
    }
}

/// Targets of both states.
#[derive(Clone, Debug)]
pub(crate) struct Targets {
    of: Arc<ChamferTargets>,
    grids: Buffer,
    cells: Buffer,
    points: Buffer,
}

/// Targets, and sums of the term over workgroups.
#[derive(Debug)]
pub(crate) struct Chamfer {
    targets: Targets,
    squares: Buffer,
}

/// Sets the fields of step `number` that the term needs.
pub(crate) fn set_fields(step: &mut Step, articulated: &Articulated, number: usize) {
    let config = articulated.config();
    let [after, before] = config.chamfer_steps;
    if articulated.targets().is_some() && number > after && number < before {
        step.flags |= CHAMFER;
        step.chamfer_share = (config.chamfer / config.length_unit.powi(2) / f64::from(step.n)) as f32;
    }
}

/// A grid around the points. Appends the points, sorted by cell, to `sorted`, and the index in `sorted` of the first point
/// of each cell to `cells`.
fn sort_into_cells(points: &[[f32; 3]], cells: &mut Vec<u32>, sorted: &mut Vec<[f32; 4]>) -> Grid {
    let begin = cells.len() as u32;
    if points.is_empty() {
        return Grid { side: 1.0, size: [1; 3], begin, ..Grid::default() };
    }
    let bound = |a: usize, pick: fn(f32, f32) -> f32| points.iter().map(|p| p[a]).reduce(pick).unwrap_or(0.0);
    let origin: [f32; 3] = std::array::from_fn(|a| bound(a, f32::min));
    let extent: [f32; 3] = std::array::from_fn(|a| bound(a, f32::max) - origin[a]);
    let longest = extent.iter().fold(1e-12_f32, |m, &e| m.max(e));
    // A minimum thickness of flat and thin clouds, so that cells do not become too small.
    let volume: f64 = extent.iter().map(|&e| f64::from(e.max(0.01 * longest))).product();
    let side = (volume / (CELLS_PER_POINT * points.len() as f64)).cbrt() as f32;
    let side = side.max(longest / MAX_CELLS);
    let size = extent.map(|e| (e / side) as u32 + 1);
    let cell_of = |p: &[f32; 3]| {
        let [x, y, z]: [u32; 3] = std::array::from_fn(|a| (((p[a] - origin[a]) / side) as u32).min(size[a] - 1));
        ((z * size[1] + y) * size[0] + x) as usize
    };
    let mut starts = vec![0_u32; size.iter().product::<u32>() as usize + 1];
    points.iter().for_each(|p| starts[cell_of(p) + 1] += 1);
    for c in 1..starts.len() {
        starts[c] += starts[c - 1];
    }
    let base = sorted.len();
    let mut next = starts.clone();
    sorted.resize(base + points.len(), [0.0; 4]);
    for p in points {
        let at = &mut next[cell_of(p)];
        sorted[base + *at as usize] = [p[0], p[1], p[2], 0.0];
        *at += 1;
    }
    cells.extend(starts.iter().map(|&s| base as u32 + s));
    Grid { origin, side, size, begin, count: points.len() as u32, ..Grid::default() }
}

impl Targets {
    fn new(gpu: &Gpu, of: &Arc<ChamferTargets>) -> Result<Self, GpuError> {
        let (mut cells, mut points) = (Vec::new(), Vec::new());
        let grids = State::ALL.map(|state| sort_into_cells(of.points(state), &mut cells, &mut points));
        Ok(Self {
            of: of.clone(),
            grids: constant(gpu, "grids of targets", &grids),
            cells: gpu.array_of("cells of targets", &cells)?,
            points: gpu.array_of("targets", &points)?,
        })
    }
}

impl Chamfer {
    /// For `n` Gaussians; reuses the targets of `old` if they are the same.
    pub(crate) fn new(gpu: &Gpu, n: usize, of: &Arc<ChamferTargets>, old: Option<&Self>) -> Result<Self, GpuError> {
        let same = old.filter(|old| old.is_for(of)).map(|old| old.targets.clone());
        let targets = same.map_or_else(|| Targets::new(gpu, of), Ok)?;
        Ok(Self { targets, squares: gpu.array("squared distances from targets", n.div_ceil(GROUP as usize), 4)? })
    }

    /// Whether these are its targets.
    pub(crate) fn is_for(&self, of: &Arc<ChamferTargets>) -> bool {
        Arc::ptr_eq(&self.targets.of, of)
    }

    /// Adds to the gradients with respect to the motions of all Gaussians; `motions` are those that they are rendered with.
    pub(crate) fn program(
        &self,
        gpu: &Gpu,
        k: &Kernels,
        g: &Gaussians,
        motions: &Buffer,
        step_buffers: &StepBuffers,
    ) -> Program {
        let arrays = [
            &step_buffers.steps,
            &g.params,
            &g.labels,
            motions,
            &self.targets.grids,
            &self.targets.cells,
            &self.targets.points,
            &g.d_motions,
            &self.squares,
            &step_buffers.part_terms,
        ];
        vec![
            (k.chamfer.on(gpu, &arrays), Size::Grid([g.n.div_ceil(GROUP as usize) as u32, 1, 1])),
            (k.sum_chamfer.on(gpu, &arrays), Size::Count(1)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_in_its_cell_also_of_flat_clouds() {
        let flat: Vec<[f32; 3]> = (0..300).map(|i| [(i % 17) as f32, (i / 17) as f32, 2.0]).collect();
        let one = vec![[1.0, 2.0, 3.0]];
        let (mut cells, mut sorted) = (Vec::new(), Vec::new());
        for points in [&flat, &one, &Vec::new()] {
            let (at, base) = (cells.len(), sorted.len());
            let grid = sort_into_cells(points, &mut cells, &mut sorted);
            assert_eq!((grid.begin as usize, grid.count as usize), (at, points.len()));
            assert!(grid.size.iter().product::<u32>() < 10_000, "{grid:?}");
            let mut seen = 0;
            for (c, range) in cells[at..].windows(2).enumerate() {
                for p in &sorted[range[0] as usize..range[1] as usize] {
                    let place: [u32; 3] = std::array::from_fn(|a| ((p[a] - grid.origin[a]) / grid.side) as u32);
                    assert_eq!(c as u32, (place[2] * grid.size[1] + place[1]) * grid.size[0] + place[0]);
                    seen += 1;
                }
            }
            assert_eq!((seen, sorted.len() - base), (points.len(), points.len()));
        }
    }
}
