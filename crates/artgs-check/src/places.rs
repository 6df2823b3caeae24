//! Flat places on which things can be put: drawer floors, shelves, tops.

use crate::model::Link;
use crate::observed::Observed;
use artgs_core::Rigid;
use glam::DVec3;
use std::collections::BTreeMap;

/// Edge of a cell.
const CELL: f64 = 0.01;
/// Neighbouring cells of one place differ by less than this in height.
const STEP: f64 = 0.006;
/// Least side of a place, in cells.
const LEAST: usize = 10;

/// A flat place that faces up.
pub(crate) struct Place {
    /// Points in its middle and about it, at least 5 cm from its border, object's frame.
    pub(crate) points: Vec<DVec3>,
    cells: BTreeMap<[i64; 2], f64>,
}

impl Place {
    /// Height of the place under a point; none beside it.
    pub(crate) fn below(&self, p: DVec3) -> Option<f64> {
        self.cells.get(&cell(p)).copied()
    }
}

fn cell(p: DVec3) -> [i64; 2] {
    [p.x, p.y].map(|v| (v / CELL).floor() as i64)
}

/// Places on the observed surface of a link that is at `pose`, widest first.
pub(crate) fn of(link: &Link, pose: &Rigid, observed: Option<&Observed>) -> Vec<Place> {
    /// Cosine of the largest slope.
    const LEVEL: f64 = 0.95;
    let mut heights: BTreeMap<[i64; 2], Vec<f64>> = BTreeMap::new();
    for shape in &link.visuals {
        let points: Vec<DVec3> = shape.points.iter().map(|p| pose.apply(*p)).collect();
        for t in &shape.triangles {
            let own = t.map(|i| shape.points[i as usize]);
            let [a, b, c] = t.map(|i| points[i as usize]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            if normal.z >= LEVEL && observed.is_none_or(|o| o.holds(own.iter().sum::<DVec3>() / 3.0)) {
                fill([a, b, c], &mut heights);
            }
        }
    }
    // Triangles of one surface meet in a cell at about the same height.
    for levels in heights.values_mut() {
        levels.sort_by(f64::total_cmp);
        levels.dedup_by(|a, b| (*a - *b).abs() < STEP);
    }
    let mut out: Vec<(usize, Place)> = Vec::new();
    while let Some((first, level)) = heights.iter().find_map(|(at, levels)| Some((*at, *levels.last()?))) {
        let cells = component(&mut heights, first, level);
        let (side, points) = points(&cells);
        if side >= LEAST {
            out.push((side, Place { points, cells }));
        }
    }
    out.sort_by_key(|(side, _)| std::cmp::Reverse(*side));
    out.into_iter().map(|(_, place)| place).collect()
}

/// Adds the heights of a triangle at the centres of cells.
fn fill([a, b, c]: [DVec3; 3], heights: &mut BTreeMap<[i64; 2], Vec<f64>>) {
    let area = (b - a).truncate().perp_dot((c - a).truncate());
    let ([x0, y0], [x1, y1]) = (cell(a.min(b).min(c)), cell(a.max(b).max(c)));
    for x in x0..=x1 {
        for y in y0..=y1 {
            let p = (DVec3::new(x as f64, y as f64, 0.0) + 0.5) * CELL;
            let weight = |q: DVec3, r: DVec3| (q - p).truncate().perp_dot((r - p).truncate()) / area;
            let weights = [weight(b, c), weight(c, a), weight(a, b)];
            if weights.iter().all(|w| *w >= -1e-9) {
                let z = weights[0] * a.z + weights[1] * b.z + weights[2] * c.z;
                heights.entry([x, y]).or_default().push(z);
            }
        }
    }
}

/// Takes the cells that connect with a level of a cell.
fn component(heights: &mut BTreeMap<[i64; 2], Vec<f64>>, first: [i64; 2], level: f64) -> BTreeMap<[i64; 2], f64> {
    let mut out = BTreeMap::new();
    let mut stack = vec![(first, level)];
    while let Some((at, level)) = stack.pop() {
        let Some(levels) = heights.get_mut(&at) else { continue };
        let Some(found) = levels.iter().position(|z| (z - level).abs() < STEP) else { continue };
        if out.contains_key(&at) {
            continue;
        }
        let z = levels.remove(found);
        out.insert(at, z);
        let [x, y] = at;
        stack.extend([[x - 1, y], [x + 1, y], [x, y - 1], [x, y + 1]].map(|next| (next, z)));
    }
    out
}

/// Side of the largest square of cells, and points in its middle and far from it, half of [`LEAST`] from the border.
fn points(cells: &BTreeMap<[i64; 2], f64>) -> (usize, Vec<DVec3>) {
    const MOST: usize = 4;
    let mut squares: BTreeMap<[i64; 2], usize> = BTreeMap::new();
    for [x, y] in cells.keys() {
        let at = |x: i64, y: i64| squares.get(&[x, y]).copied().unwrap_or(0);
        let side = 1 + at(x - 1, *y).min(at(*x, y - 1)).min(at(x - 1, y - 1));
        squares.insert([*x, *y], side);
    }
    let Some((_, side)) = squares.iter().max_by_key(|(_, side)| **side).map(|(at, side)| (*at, *side)) else {
        return (0, Vec::new());
    };
    // Squares of the least side, by their middles.
    let half = LEAST as i64 / 2;
    let middles: Vec<DVec3> = squares
        .iter()
        .filter(|(_, side)| **side >= LEAST)
        .filter_map(|([x, y], _)| {
            let at = [x - half, y - half];
            let z = cells.get(&at)?;
            Some(DVec3::new((at[0] as f64 + 0.5) * CELL, (at[1] as f64 + 0.5) * CELL, *z))
        })
        .collect();
    let mean = middles.iter().sum::<DVec3>() / middles.len().max(1) as f64;
    let mut out: Vec<DVec3> = Vec::new();
    let nearest = middles.iter().copied().min_by(|a, b| a.distance(mean).total_cmp(&b.distance(mean)));
    out.extend(nearest);
    while out.len() < MOST {
        let far = |p: &DVec3| out.iter().map(|q| q.distance(*p)).fold(f64::INFINITY, f64::min);
        match middles.iter().copied().max_by(|a, b| far(a).total_cmp(&far(b))).filter(|p| far(p) > 0.05) {
            Some(p) => out.push(p),
            None => break,
        }
    }
    (side, out)
}
