//! Joins pieces whose common hull fills little that neither of them does.

use super::slabs::Slabs;
use super::{DecomposeOptions, Pieces};
use crate::geometry::hull::Hull;
use crate::geometry::solid::Solid;
use crate::settings::UnionSettings;
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Samples of the surface with their weights.
pub(super) struct Needed {
    samples: Vec<(DVec3, usize)>,
    /// Area for which each sample stands.
    area: f64,
}

impl Needed {
    pub(super) fn of(solid: &Solid, options: &DecomposeOptions) -> Self {
        let UnionSettings { surface, observed, .. } = options.settings.union;
        let area: f64 =
            solid.mesh.triangles.iter().map(|t| 0.5 * crate::geometry::topology::cross(&solid.mesh, *t).length()).sum();
        let spacing = options.tolerance.max((area / surface).sqrt());
        let samples = solid.samples(spacing, false).into_iter().map(|s| (s.point, if s.seen { observed } else { 1 }));
        Self { samples: samples.collect(), area: spacing * spacing }
    }

    /// Pieces without those that are needed for little: first those that alone cover next to nothing, then, as long as there are more
    /// than `most`, those that alone cover the least, up to the square of `speck`.
    pub(super) fn pruned(&self, hulls: Vec<Hull>, most: usize, speck: f64, options: &DecomposeOptions) -> Vec<Hull> {
        let UnionSettings { observed, few, .. } = options.settings.union;
        let mut pieces = Pieces::default();
        hulls.into_iter().for_each(|hull| pieces.push(hull));
        let slabs = Slabs::new(&pieces, options.tolerance);
        let covers: Vec<Vec<usize>> = self.samples.par_iter().map(|(p, _)| slabs.covering(*p).collect()).collect();
        // Samples that each piece covers, and how many of them no other piece covers.
        let mut of_piece: Vec<Vec<usize>> = vec![Vec::new(); pieces.hulls.len()];
        for (sample, by) in covers.iter().enumerate() {
            by.iter().for_each(|p| of_piece[*p].push(sample));
        }
        let mut times: Vec<usize> = covers.iter().map(Vec::len).collect();
        let mut kept = vec![true; pieces.hulls.len()];
        let mut count = kept.len();
        let most_alone = observed * (speck * speck / self.area).max(1.0) as usize;
        loop {
            let alone = |p: usize| -> usize {
                of_piece[p].iter().filter(|s| times[**s] == 1).map(|s| self.samples[*s].1).sum()
            };
            // Later pieces are smaller.
            let candidates = (0..kept.len()).rev().filter(|p| kept[*p]).map(|p| (alone(p), p));
            let Some((least, p)) = candidates.min_by_key(|(alone, _)| *alone) else { break };
            if least > few * observed && (count <= most || least > most_alone) {
                break;
            }
            kept[p] = false;
            count -= 1;
            of_piece[p].iter().for_each(|s| times[*s] -= 1);
        }
        pieces.hulls.into_iter().zip(kept).filter_map(|(hull, kept)| kept.then_some(hull)).collect()
    }
}

/// A pair of pieces that may be joined, ordered by what the join would add, least first.
struct Candidate {
    /// Volume of the join without those of the pieces; or how much the join sticks out, if there are too many pieces.
    cost: f64,
    /// False if the cost can be too low: it is then computed again before the join is made.
    exact: bool,
    pair: [usize; 2],
    both: Hull,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Candidate {}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        other.cost.total_cmp(&self.cost).then(other.pair.cmp(&self.pair))
    }
}

/// Pieces, joined as long as a join stays within the tolerance of the solid.
pub(super) fn joined(hulls: Vec<Hull>, solid: &Solid, options: &DecomposeOptions) -> Vec<Hull> {
    let mut alive: Vec<Option<Hull>> = hulls.into_iter().map(Some).collect();
    let fits =
        |both: &Hull| both.points().len() <= options.corners && stays_within(both, solid, options.tolerance, options);
    let added = |a: &Hull, b: &Hull, both: &Hull| both.volume() - a.volume() - b.volume();
    join(&mut alive, 1, options, (added, None::<fn(&Hull) -> f64>), fits);
    alive.into_iter().flatten().collect()
}

/// Pieces, joined until there are at most `options.most`, those first of which the join sticks out least.
pub(super) fn reduced(hulls: Vec<Hull>, solid: &Solid, options: &DecomposeOptions) -> Vec<Hull> {
    let UnionSettings { deep, deeply, size, outside: of_outside, samples: few, .. } = options.settings.union;
    let mut alive: Vec<Option<Hull>> = hulls.into_iter().map(Some).collect();
    let cost = |both: &Hull, samples: usize| {
        let samples = both.samples(samples);
        let outside: Vec<f64> = samples.iter().map(|p| solid.signed(*p)).filter(|d| *d > 0.0).collect();
        let far = outside.iter().filter(|d| **d > options.tolerance).count();
        let area = both.area() * far as f64 / samples.len().max(1) as f64;
        let farthest = outside.iter().copied().fold(0.0, f64::max);
        let deep = (farthest - deep * options.tolerance).max(0.0);
        farthest + deeply * deep + size * both.volume().cbrt() + of_outside * area.sqrt()
    };
    let coarse = |_: &Hull, _: &Hull, both: &Hull| cost(both, few);
    // Notches of thin sheets are narrower than the distance of few samples.
    let exact = |both: &Hull| cost(both, samples_of(both, options).max(few));
    join(&mut alive, options.most as usize, options, (coarse, Some(exact)), |_| true);
    let mut hulls: Vec<Hull> = alive.into_iter().flatten().collect();
    // Pieces that touch no other one cannot be joined: the largest stay.
    hulls.sort_by(|a, b| b.volume().total_cmp(&a.volume()));
    hulls.truncate(options.most as usize);
    hulls
}

/// True if no sample of the surface of a hull is outside the solid by more than `most`. Samples are as close as the tolerance asks for.
pub(super) fn stays_within(hull: &Hull, solid: &Solid, most: f64, options: &DecomposeOptions) -> bool {
    let first = options.settings.union.samples;
    let few = hull.samples(first);
    let count = samples_of(hull, options);
    few.into_iter().all(|p| solid.signed(p) <= most)
        && (count <= first || hull.samples(count).into_iter().all(|p| solid.signed(p) <= most))
}

/// Samples of the surface of a hull, a few tolerances apart.
fn samples_of(hull: &Hull, options: &DecomposeOptions) -> usize {
    let UnionSettings { spacing, most_samples, .. } = options.settings.union;
    let step = spacing * options.tolerance;
    (hull.area() / (step * step)).min(most_samples) as usize
}

/// Joins neighbours, those with the least cost first, as long as there are more than `most` and while `fits` is true for the join. The second
/// cost, which is at least the first one, is computed only for joins that are next.
fn join(
    alive: &mut Vec<Option<Hull>>,
    most: usize,
    options: &DecomposeOptions,
    (cost, exact): (impl Fn(&Hull, &Hull, &Hull) -> f64, Option<impl Fn(&Hull) -> f64>),
    fits: impl Fn(&Hull) -> bool,
) {
    let reach = options.settings.union.neighbours * options.tolerance;
    let near = |a: &Hull, b: &Hull| {
        let ([al, ah], [bl, bh]) = (a.bounds(), b.bounds());
        (al - reach).cmple(bh).all() && (bl - reach).cmple(ah).all()
    };
    let candidate = |alive: &[Option<Hull>], i: usize, j: usize| {
        let (a, b) = (alive[i].as_ref()?, alive[j].as_ref()?);
        if !near(a, b) {
            return None;
        }
        let points: Vec<_> = a.points().iter().chain(b.points()).copied().collect();
        let both = Hull::of(&points, options.thinnest)?;
        Some(Candidate { cost: cost(a, b, &both), exact: exact.is_none(), pair: [i, j], both })
    };
    let mut count = alive.iter().flatten().count();
    if count <= most {
        return;
    }
    let pairs = (0..alive.len()).flat_map(|i| (i + 1..alive.len()).map(move |j| [i, j]));
    let mut heap: BinaryHeap<Candidate> = pairs.filter_map(|[i, j]| candidate(alive, i, j)).collect();
    while let Some(Candidate { pair: [i, j], both, exact: is_exact, .. }) = heap.pop() {
        if count <= most {
            break;
        }
        if alive[i].is_none() || alive[j].is_none() {
            continue;
        }
        if let Some(exact) = exact.as_ref().filter(|_| !is_exact) {
            heap.push(Candidate { cost: exact(&both), exact: true, pair: [i, j], both });
            continue;
        }
        if !fits(&both) {
            continue;
        }
        (alive[i], alive[j]) = (None, None);
        alive.push(Some(both));
        count -= 1;
        let last = alive.len() - 1;
        heap.extend((0..last).filter_map(|k| candidate(alive, k, last)));
    }
}
