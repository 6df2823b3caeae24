//! Joins pieces whose common hull fills little that neither of them does.

use super::solid::Solid;
use super::{DecomposeOptions, Pieces};
use crate::hull::Hull;

/// Pieces without those that are needed for little: first those that cover nothing alone, then, as long as there are too many,
/// those that alone cover the least, up to a small area.
pub(super) fn pruned(pieces: Pieces, solid: &Solid, options: &DecomposeOptions) -> Vec<Hull> {
    /// Samples of the whole surface at most.
    const MOST: f64 = 30_000.0;
    /// Side of the area that may stay uncovered, in tolerances.
    const SPECK: f64 = 3.0;
    let area: f64 = solid.mesh.triangles.iter().map(|t| 0.5 * crate::topology::cross(&solid.mesh, *t).length()).sum();
    let spacing = options.tolerance.max((area / MOST).sqrt());
    let samples = solid.samples(spacing, false).into_iter();
    let covers: Vec<Vec<usize>> = samples.map(|s| pieces.covering(s.point, options.tolerance)).collect();
    // Samples that each piece covers, and how many of them no other piece covers.
    let mut of_piece: Vec<Vec<usize>> = vec![Vec::new(); pieces.hulls.len()];
    for (sample, by) in covers.iter().enumerate() {
        by.iter().for_each(|p| of_piece[*p].push(sample));
    }
    let mut times: Vec<usize> = covers.iter().map(Vec::len).collect();
    let mut kept = vec![true; pieces.hulls.len()];
    let mut count = kept.len();
    let most_alone = (SPECK * options.tolerance / spacing).powi(2).max(1.0) as usize;
    loop {
        let alone = |p: usize| of_piece[p].iter().filter(|s| times[**s] == 1).count();
        // Later pieces are smaller.
        let candidates = (0..kept.len()).rev().filter(|p| kept[*p]).map(|p| (alone(p), p));
        let Some((least, p)) = candidates.min_by_key(|(alone, _)| *alone) else { break };
        if least > 0 && (count <= options.most as usize || least > most_alone) {
            break;
        }
        kept[p] = false;
        count -= 1;
        of_piece[p].iter().for_each(|s| times[*s] -= 1);
    }
    pieces.hulls.into_iter().zip(kept).filter_map(|(hull, kept)| kept.then_some(hull)).collect()
}

/// Pieces, joined where the union is nearly convex, and further until there are at most `options.most`.
pub(super) fn joined(mut hulls: Vec<Hull>, solid: &Solid, options: &DecomposeOptions) -> Vec<Hull> {
    /// Volume that a join may add, as a share.
    const ADDED: f64 = 0.02;
    const SAMPLES: usize = 100;
    let near = |a: &Hull, b: &Hull, by: f64| {
        let ([al, ah], [bl, bh]) = (a.bounds(), b.bounds());
        (al - by).cmple(bh).all() && (bl - by).cmple(ah).all()
    };
    let join = |a: &Hull, b: &Hull| {
        let points: Vec<_> = a.points().iter().chain(b.points()).copied().collect();
        Hull::of(&points, options.thinnest)
    };
    let mut changed = true;
    while changed {
        changed = false;
        let mut i = 0;
        while i < hulls.len() {
            let found = (i + 1..hulls.len()).filter(|j| near(&hulls[i], &hulls[*j], 1e-4)).find_map(|j| {
                let both = join(&hulls[i], &hulls[j])?;
                // Overlap counts twice here, so a join can only fill less than this.
                let sum = hulls[i].volume() + hulls[j].volume();
                let fits = both.volume() <= (1.0 + ADDED) * sum && both.points().len() <= options.corners;
                (fits && solid.protrusion(&both, SAMPLES) <= options.tolerance).then_some((j, both))
            });
            match found {
                Some((j, both)) => {
                    hulls.swap_remove(j);
                    hulls[i] = both;
                    changed = true;
                }
                None => i += 1,
            }
        }
    }
    // The join that sticks out least, as long as there are too many.
    let mut costs: Vec<(f64, usize, usize)> = Vec::new();
    let cost = |a: &Hull, b: &Hull| {
        let both = join(a, b)?;
        Some(solid.protrusion(&both, SAMPLES) + 0.05 * both.volume().cbrt())
    };
    if hulls.len() > options.most as usize {
        for i in 0..hulls.len() {
            for j in i + 1..hulls.len() {
                if near(&hulls[i], &hulls[j], 2.0 * options.tolerance) {
                    costs.extend(cost(&hulls[i], &hulls[j]).map(|c| (c, i, j)));
                }
            }
        }
    }
    let mut alive: Vec<Option<Hull>> = hulls.into_iter().map(Some).collect();
    let mut count = alive.len();
    while count > options.most as usize {
        let Some(best) = (0..costs.len()).min_by(|a, b| costs[*a].0.total_cmp(&costs[*b].0)) else { break };
        let (_, i, j) = costs[best];
        let both = match (&alive[i], &alive[j]) {
            (Some(a), Some(b)) => join(a, b),
            _ => None,
        };
        costs.retain(|(_, a, b)| ![i, j].contains(a) && ![i, j].contains(b));
        let Some(both) = both else { continue };
        (alive[i], alive[j]) = (None, None);
        for (k, other) in alive.iter().enumerate() {
            if let Some(other) = other.as_ref().filter(|o| near(&both, o, 2.0 * options.tolerance)) {
                costs.extend(cost(&both, other).map(|c| (c, k, alive.len())));
            }
        }
        alive.push(Some(both));
        count -= 1;
    }
    let mut hulls: Vec<Hull> = alive.into_iter().flatten().collect();
    // Pieces that touch no other one cannot be joined: the largest stay.
    hulls.sort_by(|a, b| b.volume().total_cmp(&a.volume()));
    hulls.truncate(options.most as usize);
    hulls
}
