//! What the errors of a state have in common against those of the other: of poses and of the alignment.

use super::energy::Problem;
use super::motion::Equation;
use crate::trimmed::median;
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
        // What is not the same surface in both states is farther away. Surfels that disagree by more than the noise take part, else the
        // noise would never be larger than it was.
        let gate = self.settings.gate * self.diagonal();
        // Of surfels of one region and direction: the shifts in that direction that they show, and their information.
        let mut regions: BTreeMap<[i32; 4], (Vec<f64>, f64)> = BTreeMap::new();
        for s in State::ALL {
            let cloud = self.clouds[s].cloud;
            let equations: Vec<Equation> =
                members[s].par_iter().map(|&i| residuals.equation(s, i, &Rigid::IDENTITY, gate)).collect();
            for (&i, row) in members[s].iter().zip(equations) {
                let (normal, cell) = (cloud.normals[i], (cloud.points[i] - lower) / size * REGIONS);
                let axis = normal.abs().max_position();
                let slope = row.slope[3 + axis];
                let information = row.information * slope * slope;
                if information > 0.0 {
                    let side = if normal[axis] < 0.0 { -1 - axis as i32 } else { 1 + axis as i32 };
                    let region = regions.entry([cell.x as i32, cell.y as i32, cell.z as i32, side]).or_default();
                    region.0.push(row.pull * slope / information);
                    region.1 += information;
                }
            }
        }
        let known = regions.into_values().filter(|(shifts, _)| shifts.len() >= LEAST);
        let (mut shifts, expected): (Vec<f64>, Vec<f64>) = known
            .filter_map(|(mut shifts, information)| {
                Some((median(&mut shifts)?.abs(), f64::from(self.shared) / information))
            })
            .unzip();
        let expected = expected.iter().sum::<f64>() / expected.len().max(1) as f64;
        let spread = 1.4826 * median(&mut shifts).unwrap_or(0.0);
        (spread.powi(2) - expected).max(0.0).sqrt() as f32
    }
}
