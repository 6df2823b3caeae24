//! What the errors of a state have in common against those of the other: of poses and of the alignment.

use super::energy::Problem;
use super::motion::Equation;
use artgs_core::{Rigid, State};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

impl Problem<'_> {
    /// Standard deviation of the distance by which the states disagree where nothing moved, beyond what independent errors of depth explain,
    /// scene units: errors of poses and of the alignment, which all surfels of a region share. What moved is seen elsewhere, or is the
    /// smaller part.
    pub(super) fn common_error(&self) -> f32 {
        /// Regions along each axis of the bounding box.
        const REGIONS: f32 = 4.0;
        /// Fewer surfels of a region that face one way are left out.
        const LEAST: usize = 30;
        let members = self.surfels().map(|count| (0..count).collect());
        let residuals = self.residuals(&members);
        let (lower, upper) = self.scene.bounds();
        let size = (upper - lower).max(Vec3::splat(f32::MIN_POSITIVE));
        // Of surfels of one region and direction: their number, information and pull of a shift in that direction.
        let mut regions: BTreeMap<[i32; 4], (usize, f64, f64)> = BTreeMap::new();
        for s in State::ALL {
            let cloud = self.clouds[s].cloud;
            let equations: Vec<Equation> =
                members[s].par_iter().map(|&i| residuals.equation(s, i, &Rigid::IDENTITY, 0.0)).collect();
            for (&i, row) in members[s].iter().zip(equations) {
                let (normal, cell) = (cloud.normals[i], (cloud.points[i] - lower) / size * REGIONS);
                let axis = normal.abs().max_position();
                let slope = row.slope[3 + axis];
                let side = if normal[axis] < 0.0 { -1 - axis as i32 } else { 1 + axis as i32 };
                let region = regions.entry([cell.x as i32, cell.y as i32, cell.z as i32, side]).or_default();
                *region = (region.0 + 1, region.1 + row.information * slope * slope, region.2 + row.pull * slope);
            }
        }
        let known = regions.into_values().filter(|r| r.0 >= LEAST && r.1 > 0.0);
        let (shifts, expected): (Vec<f64>, Vec<f64>) = known
            .map(|(_, information, pull)| ((pull / information).abs(), f64::from(self.shared) / information))
            .unzip();
        let count = expected.len().max(1) as f64;
        let expected = expected.iter().sum::<f64>() / count;
        let mut shifts = shifts;
        let spread = 1.4826 * crate::trimmed::median(&mut shifts).unwrap_or(0.0);
        (spread.powi(2) - expected).max(0.0).sqrt() as f32
    }
}
