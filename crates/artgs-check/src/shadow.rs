//! Parallel rays along the three axes: where they meet a surface, as maps of depth.

use glam::DVec3;

/// Points and triangles.
pub(crate) type Triangles<'a> = (&'a [DVec3], &'a [[u32; 3]]);

/// Rays along one axis on a square grid, with the first and the last point at which each of them meets a surface.
#[derive(Clone, Debug)]
pub(crate) struct Shadow {
    axis: usize,
    low: DVec3,
    step: f64,
    size: [usize; 2],
    /// Lowest and highest coordinate along the axis, `f64::INFINITY` and its negative where a ray meets nothing.
    ends: Vec<[f64; 2]>,
}

/// A square of rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Square {
    /// Its side.
    pub(crate) cells: usize,
    /// The ray in its middle.
    pub(crate) middle: [usize; 2],
}

impl Shadow {
    /// Rays along `axis` through the box from `low` to `high`, `step` apart.
    pub(crate) fn new(axis: usize, [low, high]: [DVec3; 2], step: f64, surfaces: &[Triangles]) -> Self {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let size = [u, v].map(|a| ((high[a] - low[a]) / step).ceil().max(1.0) as usize);
        let ends = vec![[f64::INFINITY, f64::NEG_INFINITY]; size[0] * size[1]];
        let mut out = Self { axis, low, step, size, ends };
        for (points, triangles) in surfaces {
            for t in *triangles {
                let corner = t.map(|i| {
                    let p = points[i as usize];
                    [(p[u] - low[u]) / step - 0.5, (p[v] - low[v]) / step - 0.5, p[axis]]
                });
                out.add(corner);
            }
        }
        out
    }

    /// Adds a triangle given in cells, with its depths; the centre of the first cell is at 0.
    fn add(&mut self, [a, b, c]: [[f64; 3]; 3]) {
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area.abs() < 1e-12 {
            return;
        }
        let range = |k: usize| {
            let (low, high) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
            low.ceil().max(0.0) as usize..=(high.floor().min(self.size[k] as f64 - 1.0).max(-1.0) + 1.0) as usize
        };
        let (columns, rows) = (range(0), range(1));
        for x in columns.filter(|x| *x < self.size[0]) {
            for y in rows.clone().filter(|y| *y < self.size[1]) {
                let (px, py) = (x as f64, y as f64);
                let weight = |p: [f64; 3], q: [f64; 3]| ((p[0] - px) * (q[1] - py) - (p[1] - py) * (q[0] - px)) / area;
                let (wa, wb, wc) = (weight(b, c), weight(c, a), weight(a, b));
                // Rays through an edge belong to both triangles, so that none passes between them.
                if wa >= -1e-9 && wb >= -1e-9 && wc >= -1e-9 {
                    let depth = wa * a[2] + wb * b[2] + wc * c[2];
                    let [low, high] = &mut self.ends[x * self.size[1] + y];
                    (*low, *high) = (low.min(depth), high.max(depth));
                }
            }
        }
    }

    /// Rays that meet something.
    pub(crate) fn hits(&self) -> usize {
        self.ends.iter().filter(|[low, _]| low.is_finite()).count()
    }

    /// Rays from below (side 0) or above (side 1) that meet this surface and meet `other` more than `tolerance` later or never.
    pub(crate) fn missed_by(&self, other: &Self, side: usize, tolerance: f64) -> Vec<bool> {
        let later = |own: &[f64; 2], other: &[f64; 2]| match side {
            0 => own[0].is_finite() && other[0] > own[0] + tolerance,
            _ => own[1].is_finite() && other[1] < own[1] - tolerance,
        };
        self.ends.iter().zip(&other.ends).map(|(own, other)| later(own, other)).collect()
    }

    /// The largest square of marked rays.
    pub(crate) fn widest(&self, marked: &[bool]) -> Square {
        let [_, rows] = self.size;
        let (mut before, mut widest) = (vec![0_usize; rows + 1], Square::default());
        for (x, column) in marked.chunks(rows).enumerate() {
            let mut now = vec![0; rows + 1];
            for (y, _) in column.iter().enumerate().filter(|(_, m)| **m) {
                let cells = 1 + before[y].min(before[y + 1]).min(now[y]);
                now[y + 1] = cells;
                if cells > widest.cells {
                    widest = Square { cells, middle: [x - cells / 2, y - cells / 2] };
                }
            }
            before = now;
        }
        widest
    }

    /// A ray's place in the grid.
    pub(crate) fn place(&self, ray: usize) -> [usize; 2] {
        [ray / self.size[1], ray % self.size[1]]
    }

    /// Where a ray from below (side 0) or above (side 1) meets this surface.
    pub(crate) fn point(&self, [x, y]: [usize; 2], side: usize) -> DVec3 {
        let (u, v) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let mut out = self.low;
        out[u] += (x as f64 + 0.5) * self.step;
        out[v] += (y as f64 + 0.5) * self.step;
        out[self.axis] = self.ends[x * self.size[1] + y][side];
        out
    }
}
