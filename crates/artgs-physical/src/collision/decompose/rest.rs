//! What is not flat: groups of surface points, split by planes until their hulls follow the surface.

use super::slabs::Slabs;
use super::union::stays_within;
use super::{DecomposeOptions, Pieces};
use crate::geometry::hull::Hull;
use crate::geometry::solid::{Sample, Solid};
use crate::settings::{DecomposeSettings, RestSettings, UnionSettings};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Covers what no piece is within `near` of, nor within `near` of the place that is `behind` it.
pub(super) fn add(
    solid: &Solid,
    axes: &[DVec3],
    [near, behind]: [f64; 2],
    options: &DecomposeOptions,
    pieces: &mut Pieces,
) {
    /// Distance of a sample from the surface that is rounding.
    const ROUNDING: f64 = 1e-4;
    let DecomposeSettings { rest: settings, union, .. } = &options.settings;
    let area: f64 =
        solid.mesh.triangles.iter().map(|t| 0.5 * crate::geometry::topology::cross(&solid.mesh, *t).length()).sum();
    let spacing = (settings.spacing * options.tolerance).max((area / union.surface).sqrt());
    let slabs = Slabs::new(pieces, near);
    let covered = |s: &Sample| slabs.cover(s.point) || behind > 0.0 && slabs.cover(s.point - s.normal * behind);
    let is_open = |s: &Sample| s.seen && !covered(s);
    let open: Vec<Sample> = solid.samples(spacing, true).into_par_iter().filter(is_open).collect();
    let stride = open.len().div_ceil(settings.open).max(1);
    let open: Vec<Sample> = open.into_iter().step_by(stride).collect();
    let spacing = spacing * (stride as f64).sqrt();
    let least = settings.speck * near * near / (spacing * spacing);
    for group in groups(&open, settings.group * spacing.max(options.tolerance)) {
        // Specks have a piece beside them.
        if (group.len() as f64) < least {
            continue;
        }
        let points = group.iter().flat_map(|s| {
            let depth = solid.thickness(s.point, s.normal, ROUNDING, options.skin);
            [s.point, s.point - s.normal * depth]
        });
        split(solid, points.collect(), axes, spacing, options, 0, pieces);
    }
}

/// Samples in connected cells of a grid.
fn groups(samples: &[Sample], cell: f64) -> Vec<Vec<Sample>> {
    let key = |p: DVec3| (p / cell).floor().as_i64vec3().to_array();
    let mut cells: BTreeMap<[i64; 3], Vec<Sample>> = BTreeMap::new();
    for s in samples {
        cells.entry(key(s.point)).or_default().push(*s);
    }
    let mut out = Vec::new();
    while let Some((first, found)) = cells.pop_first() {
        let (mut group, mut stack) = (found, vec![first]);
        while let Some([x, y, z]) = stack.pop() {
            for i in 0..27 {
                let next = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
                if let Some(found) = cells.remove(&next) {
                    group.extend(found);
                    stack.push(next);
                }
            }
        }
        out.push(group);
    }
    out
}

/// Adds the hull of points if it follows the surface, else those of two parts of them.
fn split(
    solid: &Solid,
    points: Vec<DVec3>,
    axes: &[DVec3],
    spacing: f64,
    options: &DecomposeOptions,
    depth: usize,
    pieces: &mut Pieces,
) {
    let DecomposeSettings { rest: RestSettings { deepest, useful, .. }, union: UnionSettings { far, .. }, .. } =
        options.settings;
    let Some(hull) = Hull::of(&points, options.thinnest) else { return };
    let stays_within = |most: f64| stays_within(&hull, solid, most, options);
    if stays_within(options.tolerance) {
        return pieces.push(hull);
    }
    let cut = if depth < deepest { best_cut(&points, axes, spacing, options) } else { None };
    match cut {
        Some((left, _)) if left > useful && stays_within(far * options.tolerance) => pieces.push(hull),
        Some((_, halves)) => {
            halves.into_iter().for_each(|half| split(solid, half, axes, spacing, options, depth + 1, pieces));
        }
        None if stays_within(far * options.tolerance) => pieces.push(hull),
        None => {}
    }
}

/// The cut across one of the axes that leaves the least volume in two hulls, of about equal size if possible: the share of the volume
/// that is left, and both halves.
fn best_cut(
    points: &[DVec3],
    axes: &[DVec3],
    spacing: f64,
    options: &DecomposeOptions,
) -> Option<(f64, [Vec<DVec3>; 2])> {
    /// Thickness below which a half counts as flat: it is rounding.
    const FLAT: f64 = 1e-6;
    let RestSettings { places, points: most, balance, largest, shortest, .. } = options.settings.rest;
    let overlap = options.settings.rest.overlap * spacing;
    let part = |points: &[DVec3], axis: DVec3, at: f64, sign: f64| -> Vec<DVec3> {
        points.iter().copied().filter(|p| sign * (p.dot(axis) - at) <= overlap).collect()
    };
    let stride = points.len().div_ceil(most);
    let few: Vec<DVec3> = points.iter().copied().step_by(stride).collect();
    let whole = Hull::of(&few, options.thinnest)?.volume();
    let mut best: Option<(f64, f64, DVec3, f64)> = None;
    for axis in axes {
        let along = || points.iter().map(|p| p.dot(*axis));
        let (low, high) = (along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max));
        if high - low < shortest * options.tolerance {
            continue;
        }
        for place in 1..=places {
            let at = low + (high - low) * place as f64 / (places + 1) as f64;
            let halves = [1.0, -1.0].map(|sign| part(&few, *axis, at, sign));
            if halves.iter().any(|half| half.len() as f64 > largest * few.len() as f64) {
                continue;
            }
            let volume: f64 = halves.iter().map(|half| Hull::of(half, FLAT).map_or(0.0, |h| h.volume())).sum();
            let cost = volume / whole + balance * (place as f64 / (places + 1) as f64 - 0.5).abs();
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, volume / whole, *axis, at));
            }
        }
    }
    let (_, left, axis, at) = best?;
    let halves = [1.0, -1.0].map(|sign| part(points, axis, at, sign));
    halves.iter().all(|h| h.len() < points.len()).then_some((left, halves))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::decompose::tests::OPTIONS;

    /// Points on a strip 1.1 m long with this profile, 6 mm apart.
    fn strip(profile: &[[f64; 2]]) -> Vec<DVec3> {
        (0..184).flat_map(|k| profile.iter().map(move |[x, y]| DVec3::new(*x, *y, 0.006 * f64::from(k)))).collect()
    }

    #[test]
    fn halves_of_narrow_strips_are_smaller_than_the_whole() {
        // Legs of 24 and 36 mm: at 12 mm, cuts between them leave nearly all points in one half, because halves overlap.
        let profile: Vec<[f64; 2]> =
            (0..5).map(|k| [0.006 * f64::from(k), 0.0]).chain((1..7).map(|k| [0.0, 0.006 * f64::from(k)])).collect();
        let points = strip(&profile);
        let (left, halves) = best_cut(&points, &[DVec3::X, DVec3::Y, DVec3::Z], 6e-3, &OPTIONS).unwrap();
        assert!(halves.iter().all(|half| (half.len() as f64) < 0.95 * points.len() as f64));
        assert!(left < 1.05, "{left}");
        // A cut across a straight strip leaves its volume.
        let straight = strip(&[[0.0, 0.0], [0.008, 0.0], [0.0, 0.008], [0.008, 0.008]]);
        let (left, _) = best_cut(&straight, &[DVec3::X, DVec3::Y, DVec3::Z], 6e-3, &OPTIONS).unwrap();
        assert!((1.0..1.05).contains(&left), "{left}");
    }
}
