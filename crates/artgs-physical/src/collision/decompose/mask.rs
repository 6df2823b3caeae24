//! Cells of a plane, covered by convex polygons.

use crate::settings::SheetSettings;
use glam::DVec2;

/// A grid of cells.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mask {
    /// Columns and rows.
    pub(crate) size: [usize; 2],
    /// Cell `column * rows + row`.
    pub(crate) cells: Vec<bool>,
}

impl Mask {
    pub(crate) fn new(size: [usize; 2]) -> Self {
        Self { size, cells: vec![false; size[0] * size[1]] }
    }

    fn at(&self, x: usize, y: usize) -> bool {
        self.cells[x * self.size[1] + y]
    }

    fn is_empty(&self) -> bool {
        !self.cells.contains(&true)
    }

    /// Chessboard distance of every cell to the nearest set one, at most `most`.
    pub(crate) fn distances(&self, most: usize) -> Vec<usize> {
        let [columns, rows] = self.size;
        let mut out: Vec<usize> = self.cells.iter().map(|c| if *c { 0 } else { most }).collect();
        let mut pass = |order: &mut dyn Iterator<Item = usize>, back: [[isize; 2]; 4]| {
            for i in order {
                let (x, y) = ((i / rows) as isize, (i % rows) as isize);
                for [dx, dy] in back {
                    let (u, v) = (x + dx, y + dy);
                    if u >= 0 && v >= 0 && (u as usize) < columns && (v as usize) < rows {
                        out[i] = out[i].min(out[u as usize * rows + v as usize] + 1);
                    }
                }
            }
        };
        pass(&mut (0..columns * rows), [[-1, -1], [-1, 0], [-1, 1], [0, -1]]);
        pass(&mut (0..columns * rows).rev(), [[1, 1], [1, 0], [1, -1], [0, 1]]);
        out
    }

    /// Sets the cells of gaps not wider than `2 * radius`.
    pub(crate) fn closed(&self, radius: usize) -> Self {
        let most = radius + 2;
        let grown = self.distances(most).into_iter().map(|d| d <= radius).collect::<Vec<_>>();
        let outside = Self { size: self.size, cells: grown.iter().map(|c| !c).collect() };
        let inside = outside.distances(most);
        let cells = inside.iter().zip(&self.cells).map(|(d, own)| *own || *d > radius);
        Self { size: self.size, cells: cells.collect() }
    }

    /// Side of the largest square of set cells.
    fn widest(&self) -> usize {
        let rows = self.size[1];
        let (mut before, mut widest) = (vec![0_usize; rows + 1], 0);
        for column in self.cells.chunks(rows) {
            let mut now = vec![0; rows + 1];
            for (y, _) in column.iter().enumerate().filter(|(_, m)| **m) {
                now[y + 1] = 1 + before[y].min(before[y + 1]).min(now[y]);
                widest = widest.max(now[y + 1]);
            }
            before = now;
        }
        widest
    }

    /// Connected components, corners included.
    fn components(&self) -> Vec<Self> {
        let [columns, rows] = self.size;
        let (mut left, mut out) = (self.cells.clone(), Vec::new());
        for first in 0..left.len() {
            if !left[first] {
                continue;
            }
            let mut one = Self::new(self.size);
            let mut stack = vec![first];
            left[first] = false;
            while let Some(i) = stack.pop() {
                one.cells[i] = true;
                let (x, y) = (i / rows, i % rows);
                for u in x.saturating_sub(1)..(x + 2).min(columns) {
                    for v in y.saturating_sub(1)..(y + 2).min(rows) {
                        let j = u * rows + v;
                        if left[j] {
                            left[j] = false;
                            stack.push(j);
                        }
                    }
                }
            }
            out.push(one);
        }
        out
    }

    /// Largest rectangle of set cells: low and high corner, the latter exclusive.
    fn largest_rectangle(&self) -> [usize; 4] {
        let [columns, rows] = self.size;
        let (mut heights, mut best, mut area) = (vec![0_usize; rows], [0; 4], 0);
        for x in 0..columns {
            for (y, height) in heights.iter_mut().enumerate() {
                *height = if self.at(x, y) { *height + 1 } else { 0 };
            }
            let mut open: Vec<(usize, usize)> = Vec::new();
            for y in 0..=rows {
                let height = if y < rows { heights[y] } else { 0 };
                let mut from = y;
                while let Some((start, tall)) = open.last().copied().filter(|(_, tall)| *tall > height) {
                    open.pop();
                    if tall * (y - start) > area {
                        area = tall * (y - start);
                        best = [x + 1 - tall, start, x + 1, y];
                    }
                    from = start;
                }
                if height > 0 && open.last().is_none_or(|(_, tall)| *tall < height) {
                    open.push((from, height));
                }
            }
        }
        best
    }

    /// The rectangle grown in all directions while each further row or column is near set cells everywhere, by their
    /// `distances`, and on at least half of its length.
    fn grown(&self, [mut x0, mut y0, mut x1, mut y1]: [usize; 4], distances: &[usize], slack: usize) -> [usize; 4] {
        let [columns, rows] = self.size;
        let joins = |cells: &mut dyn Iterator<Item = (usize, usize)>| {
            let (mut set, mut all) = (0, 0);
            for (x, y) in cells {
                if distances[x * rows + y] > slack {
                    return false;
                }
                all += 1;
                set += usize::from(self.at(x, y));
            }
            2 * set >= all
        };
        loop {
            let before = [x0, y0, x1, y1];
            if x0 > 0 && joins(&mut (y0..y1).map(|y| (x0 - 1, y))) {
                x0 -= 1;
            }
            if x1 < columns && joins(&mut (y0..y1).map(|y| (x1, y))) {
                x1 += 1;
            }
            if y0 > 0 && joins(&mut (x0..x1).map(|x| (x, y0 - 1))) {
                y0 -= 1;
            }
            if y1 < rows && joins(&mut (x0..x1).map(|x| (x, y1))) {
                y1 += 1;
            }
            if before == [x0, y0, x1, y1] {
                return before;
            }
        }
    }

    /// Convex hull of the corners of the set cells, counter-clockwise.
    fn hull(&self) -> Vec<DVec2> {
        let rows = self.size[1];
        let mut corners = Vec::new();
        // Only the first and the last cell of a column are on the hull.
        for (x, column) in self.cells.chunks(rows).enumerate() {
            let (Some(first), Some(last)) = (column.iter().position(|c| *c), column.iter().rposition(|c| *c)) else {
                continue;
            };
            for u in [x, x + 1] {
                corners.extend([first, last + 1].map(|v| DVec2::new(u as f64, v as f64)));
            }
        }
        convex(corners)
    }

    /// True if the polygon reaches little beyond the set cells, by their distances: nowhere by more than a few slacks, and by
    /// more than the slack only in a small share of its cells.
    fn is_followed_by(&self, polygon: &[DVec2], distances: &[usize], slack: usize, settings: &SheetSettings) -> bool {
        let (mut all, mut beyond) = (0_u32, 0_u32);
        for cell in self.inside(polygon) {
            if distances[cell] > settings.most_slack * slack {
                return false;
            }
            all += 1;
            beyond += u32::from(distances[cell] > slack);
        }
        f64::from(beyond) <= settings.beyond * f64::from(all)
    }

    /// Cells of which the middle is in a polygon.
    fn inside<'a>(&'a self, polygon: &'a [DVec2]) -> impl Iterator<Item = usize> + 'a {
        let (low, high) =
            polygon.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
        let ends = |k: usize| low[k].max(0.0) as usize..(high[k].ceil().max(0.0) as usize).min(self.size[k]);
        let (columns, rows) = (ends(0), ends(1));
        let cells = columns.flat_map(move |x| rows.clone().map(move |y| (x, y)));
        cells
            .filter(|(x, y)| holds(polygon, DVec2::new(*x as f64 + 0.5, *y as f64 + 0.5)))
            .map(|(x, y)| x * self.size[1] + y)
    }

    /// Set cells of which the middle is in a polygon.
    pub(crate) fn within<'a>(&'a self, polygon: &'a [DVec2]) -> impl Iterator<Item = usize> + 'a {
        self.inside(polygon).filter(|cell| self.cells[*cell])
    }

    fn split(&self) -> [Self; 2] {
        let rows = self.size[1];
        let set = || (0..self.cells.len()).filter(|i| self.cells[*i]).map(|i| [i / rows, i % rows]);
        let count = set().count();
        let extent = |k: usize| set().map(|p| p[k]).max().unwrap_or(0) - set().map(|p| p[k]).min().unwrap_or(0);
        let axis = usize::from(extent(1) > extent(0));
        let middle = set().map(|p| p[axis]).sum::<usize>() / count.max(1);
        [false, true].map(|upper| {
            let mut half = Self::new(self.size);
            set().filter(|p| (p[axis] > middle) == upper).for_each(|p| half.cells[p[0] * rows + p[1]] = true);
            half
        })
    }
}

/// True if a point is in a convex polygon, counter-clockwise.
pub(crate) fn holds(polygon: &[DVec2], p: DVec2) -> bool {
    /// Distance outside, in cells, that is rounding.
    const ROUNDING: f64 = 1e-9;
    (0..polygon.len()).all(|i| (polygon[(i + 1) % polygon.len()] - polygon[i]).perp_dot(p - polygon[i]) >= -ROUNDING)
}

/// Convex hull, counter-clockwise.
fn convex(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let chain = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut out: Vec<DVec2> = Vec::new();
        for p in points {
            while out.len() >= 2 && (out[out.len() - 1] - out[out.len() - 2]).perp_dot(p - out[out.len() - 1]) <= 0.0 {
                out.pop();
            }
            out.push(p);
        }
        out.pop();
        out
    };
    let mut out = chain(&mut points.iter().copied());
    out.extend(chain(&mut points.iter().rev().copied()));
    out
}

/// The corners of a convex polygon that are extreme in `most` directions.
fn coarser(polygon: Vec<DVec2>, most: usize) -> Vec<DVec2> {
    if polygon.len() <= most {
        return polygon;
    }
    let direction = |i: usize| DVec2::from_angle(std::f64::consts::TAU * i as f64 / most as f64);
    let farthest = |d: DVec2| (0..polygon.len()).max_by(|a, b| polygon[*a].dot(d).total_cmp(&polygon[*b].dot(d)));
    let mut kept: Vec<usize> = (0..most).filter_map(|i| farthest(direction(i))).collect();
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|i| polygon[i]).collect()
}

/// Convex polygons, in cells, that cover `todo` and reach little beyond `allowed`, which holds `todo`: see
/// [`Mask::is_followed_by`]. What is at most twice `slack` cells wide is left out.
pub(crate) fn cover(allowed: &Mask, todo: &Mask, slack: usize, settings: &SheetSettings) -> Vec<Vec<DVec2>> {
    let distances = allowed.distances(settings.most_slack * slack + 2);
    let (mut out, mut stack) = (Vec::new(), todo.components());
    while let Some(part) = stack.pop() {
        if part.is_empty() || part.widest() <= 2 * slack {
            continue;
        }
        let hull = part.hull();
        if allowed.is_followed_by(&hull, &distances, slack, settings) {
            out.push(coarser(hull, settings.corners));
            continue;
        }
        let [x0, y0, x1, y1] = part.largest_rectangle();
        let count = part.cells.iter().filter(|c| **c).count();
        if ((x1 - x0) * (y1 - y0)) as f64 <= settings.worth * count as f64 {
            stack.extend(part.split().iter().flat_map(Mask::components));
            continue;
        }
        let [x0, y0, x1, y1] = allowed.grown([x0, y0, x1, y1], &distances, slack);
        out.push([[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|[x, y]| DVec2::new(x as f64, y as f64)).to_vec());
        let mut rest = part;
        for x in x0..x1 {
            (y0..y1).for_each(|y| rest.cells[x * todo.size[1] + y] = false);
        }
        stack.extend(rest.components());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(size: [usize; 2], set: impl Fn(usize, usize) -> bool) -> Mask {
        let mut out = Mask::new(size);
        for x in 0..size[0] {
            (0..size[1]).for_each(|y| out.cells[x * size[1] + y] = set(x, y));
        }
        out
    }

    /// Cells farther than `slack` from all polygons, and cells of polygons farther than that from the mask.
    fn faults(mask: &Mask, polygons: &[Vec<DVec2>], slack: usize) -> [usize; 2] {
        let covered =
            self::mask(mask.size, |x, y| polygons.iter().any(|p| holds(p, DVec2::new(x as f64 + 0.5, y as f64 + 0.5))));
        let far = |of: &Mask, from: &Mask| {
            let distances = from.distances(99);
            (0..of.cells.len()).filter(|i| of.cells[*i] && distances[*i] > slack).count()
        };
        [far(mask, &covered), far(&covered, mask)]
    }

    #[test]
    fn a_rectangle_is_one_polygon_and_a_frame_is_four() {
        let plain = mask([60, 40], |x, y| (5..55).contains(&x) && (3..33).contains(&y));
        let found = cover(&plain, &plain, 2, &SheetSettings::DEFAULT);
        assert_eq!((found.len(), found[0].len()), (1, 4));
        let frame = mask([60, 40], |x, y| !((10..50).contains(&x) && (10..30).contains(&y)));
        let found = cover(&frame, &frame, 2, &SheetSettings::DEFAULT);
        assert_eq!((found.len(), faults(&frame, &found, 2)), (4, [0, 0]), "{found:?}");
    }

    #[test]
    fn round_shapes_are_covered_within_the_slack() {
        let radius = |x: usize, y: usize| (x as f64 - 50.0).hypot(y as f64 - 50.0);
        let disc = mask([100, 100], |x, y| radius(x, y) < 45.0);
        assert_eq!(cover(&disc, &disc, 2, &SheetSettings::DEFAULT).len(), 1);
        let ring = mask([100, 100], |x, y| (30.0..45.0).contains(&radius(x, y)));
        let found = cover(&ring, &ring, 2, &SheetSettings::DEFAULT);
        assert!(faults(&ring, &found, 4) == [0, 0] && (4..30).contains(&found.len()), "{} {found:?}", found.len());
    }

    #[test]
    fn a_ragged_rim_needs_one_polygon_and_a_deep_notch_more() {
        // The rim varies by two cells, which is the slack.
        let ragged = mask([120, 80], |x, y| x >= 4 + y % 3 && x < 116 - y % 2 && y >= 4 + x % 3 && y < 76);
        assert_eq!(cover(&ragged, &ragged, 2, &SheetSettings::DEFAULT).len(), 1);
        let notched =
            mask([120, 80], |x, y| (4..116).contains(&x) && (4..76).contains(&y) && !(x > 50 && x < 70 && y > 50));
        let found = cover(&notched, &notched, 2, &SheetSettings::DEFAULT);
        assert!(found.len() > 1 && faults(&notched, &found, 4) == [0, 0], "{found:?}");
    }

    #[test]
    fn only_what_is_to_do_is_covered_and_gaps_of_noise_are_closed() {
        let plain = mask([50, 50], |x, y| !(x == 20 && y == 20));
        let found = cover(&plain.closed(1), &plain, 2, &SheetSettings::DEFAULT);
        assert_eq!(found.len(), 1);
        let todo = mask([50, 50], |x, _| x < 10);
        let found = cover(&mask([50, 50], |_, _| true), &todo, 2, &SheetSettings::DEFAULT);
        assert!(found.len() == 1 && found[0].iter().all(|p| p.x <= 10.0), "{found:?}");
        assert!(
            cover(&plain, &mask([50, 50], |x, _| x < 2), 2, &SheetSettings::DEFAULT).is_empty(),
            "a strip within the slack"
        );
    }
}
