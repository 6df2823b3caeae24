//! Which found part is which true part: by the surface points that both have.

use artgs::discover::Discovery;
use artgs::evaluate::{hungarian, sample_surface};
use artgs_core::{Mesh, PerState, State};
use artgs_io::GroundTruth;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

/// Samples of the surfaces of an object in one state: about 4 mm apart on a wardrobe.
const SAMPLES: usize = 200_000;
/// Fewest samples of a part, so that small ones are not missed.
const LEAST_SAMPLES: usize = 2_000;
/// A found and a true part are the same from this intersection over union on.
pub(super) const LEAST_OVERLAP: f64 = 0.5;

/// Points on the true surfaces of one state, with the part of each: 0 is the static part, `k` the movable part `k - 1`.
#[derive(Clone, Debug, Default)]
pub(super) struct TrueSurface {
    /// World frame of the run.
    pub(super) points: Vec<[f64; 3]>,
    /// `[points]`.
    pub(super) parts: Vec<usize>,
}

impl TrueSurface {
    /// Samples the meshes of all parts evenly.
    pub(super) fn new(truth: &GroundTruth, state: State) -> Self {
        let meshes: Vec<&Mesh> =
            std::iter::once(&truth.fixed[state]).chain(truth.movable.iter().map(|part| &part[state])).collect();
        let areas: Vec<f64> = meshes.iter().map(|mesh| area(mesh)).collect();
        let whole = areas.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let mut surface = Self::default();
        for (part, (mesh, area)) in meshes.into_iter().zip(areas).enumerate() {
            let count = ((SAMPLES as f64 * area / whole) as usize).max(LEAST_SAMPLES);
            let points = sample_surface(mesh, count, &mut Pcg64Mcg::seed_from_u64(part as u64));
            surface.parts.extend(std::iter::repeat_n(part, points.len()));
            surface.points.extend(points);
        }
        surface
    }

    /// The part whose surface is nearest to each point; 0 without any surface.
    pub(super) fn nearest(&self, points: impl Iterator<Item = [f64; 3]>) -> Vec<usize> {
        let Ok(tree) = ImmutableKdTree::<f64, 3>::new_from_slice(&self.points) else {
            return points.map(|_| 0).collect();
        };
        let nearest = |p: [f64; 3]| tree.query(&p).nearest_one::<SquaredEuclidean<f64>>().execute().item as usize;
        points.map(|p| self.parts.get(nearest(p)).copied().unwrap_or(0)).collect()
    }
}

fn area(mesh: &Mesh) -> f64 {
    let corner = |i: u32| mesh.vertices.get(i as usize).map(|v| glam::DVec3::from_array(v.map(f64::from)));
    let of = |t: &[u32; 3]| {
        let [a, b, c] = [corner(t[0])?, corner(t[1])?, corner(t[2])?];
        Some(0.5 * (b - a).cross(c - a).length()).filter(|area| area.is_finite())
    };
    mesh.triangles.iter().filter_map(of).sum()
}

/// Surface points of both states, counted by the found and the true part that they are of; 0 is the static part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Confusion {
    /// `[found][true]`.
    counts: Vec<Vec<u64>>,
}

impl Confusion {
    /// Counts the labelled points of a result; `surfaces` are the true ones.
    pub(super) fn of(found: &Discovery, surfaces: &PerState<TrueSurface>, movable: usize) -> Self {
        let mut all = Self { counts: vec![vec![0; movable + 1]; found.parts.len() + 1] };
        for (state, surface) in surfaces.enumerate() {
            let points = found.clouds[state].points.iter().map(|p| p.as_dvec3().to_array());
            all.add(&found.labels[state], &surface.nearest(points));
        }
        all
    }

    /// Counts points with the labels of a result and the true ones. Labels that no part has are left out.
    fn add(&mut self, labels: &[u16], truth: &[usize]) {
        for (label, part) in labels.iter().zip(truth) {
            if let Some(count) = self.counts.get_mut(usize::from(*label)).and_then(|row| row.get_mut(*part)) {
                *count += 1;
            }
        }
    }

    /// Intersection over union of a found and a true movable part, from 0 in their orders.
    pub(super) fn overlap(&self, found: usize, truth: usize) -> f64 {
        let both = self.counts[found + 1][truth + 1];
        let own: u64 = self.counts[found + 1].iter().sum();
        let true_points: u64 = self.counts.iter().map(|row| row[truth + 1]).sum();
        let either = own + true_points - both;
        if either == 0 { 0.0 } else { both as f64 / either as f64 }
    }

    /// Overlaps `[found][true]` of movable parts.
    pub(super) fn overlaps(&self) -> Vec<Vec<f64>> {
        let truths = self.counts[0].len() - 1;
        (0..self.counts.len() - 1).map(|k| (0..truths).map(|j| self.overlap(k, j)).collect()).collect()
    }
}

/// For every found part the true part that it covers: one to one, with the largest sum of overlaps; pairs below
/// [`LEAST_OVERLAP`] do not count.
pub(super) fn pairs(overlaps: &[Vec<f64>], truths: usize) -> Vec<Option<usize>> {
    let costs: Vec<Vec<f64>> = overlaps.iter().map(|row| row.iter().map(|overlap| 1.0 - overlap).collect()).collect();
    let assigned = hungarian(&costs, truths).into_iter().enumerate();
    assigned.map(|(k, truth)| truth.filter(|j| overlaps[k][*j] >= LEAST_OVERLAP)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::population::testing::{cupboard, found_as};

    fn confusion(labels: &[u16], truth: &[usize], found: usize, movable: usize) -> Confusion {
        let mut all = Confusion { counts: vec![vec![0; movable + 1]; found + 1] };
        all.add(labels, truth);
        all
    }

    #[test]
    fn overlaps_are_intersections_over_unions() {
        let counts = confusion(&[1, 1, 1, 0, 0, 2, 9], &[1, 1, 0, 1, 0, 2, 1], 2, 2);
        assert_eq!(counts.overlaps(), [[0.5, 0.0], [0.0, 1.0]]);
        let none = confusion(&[0, 0], &[0, 0], 1, 1);
        assert_eq!(none.overlaps(), [[0.0]]);
        assert!(confusion(&[0], &[1], 0, 1).overlaps().is_empty());
    }

    #[test]
    fn parts_are_paired_by_the_largest_sum() {
        assert_eq!(pairs(&[vec![0.8, 0.7], vec![0.75, 0.1]], 2), [Some(1), Some(0)]);
        assert_eq!(pairs(&[vec![0.49]], 1), [None]);
        assert_eq!(pairs(&[vec![0.5], vec![0.4]], 1), [Some(0), None]);
        assert_eq!(pairs(&[vec![0.2, 0.9]], 2), [Some(1)]);
        assert_eq!(pairs(&[vec![], vec![]], 0), [None, None]);
    }

    #[test]
    fn points_belong_to_the_nearest_true_part() {
        let truth = cupboard();
        let surfaces = PerState::from_fn(|state| TrueSurface::new(&truth, state));
        let found = found_as(&truth, &[1, 2]);
        let overlaps = Confusion::of(&found, &surfaces, 2).overlaps();
        assert!(overlaps[0][0] > 0.99 && overlaps[1][1] > 0.99 && overlaps[0][1] < 0.01, "{overlaps:?}");
        let swapped = Confusion::of(&found_as(&truth, &[2, 1]), &surfaces, 2).overlaps();
        assert_eq!(pairs(&swapped, 2), [Some(1), Some(0)]);
        assert_eq!(TrueSurface::default().nearest([[0.0; 3]].into_iter()), [0]);
    }
}
