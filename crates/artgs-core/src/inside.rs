//! Which points a surface encloses, where the sign at its nearest triangle is not enough.

use glam::DVec3;

/// The inside of a surface, by rays along the three axes in both directions: a point is inside if most of the six rays leave the
/// surface more often than they enter it. Sheets that are inside a solid or that cut through its sides do not change the answer,
/// and a surface that is not closed has one. Answers are exact up to half the distance of the rays.
#[derive(Clone, Debug)]
pub struct Inside {
    axes: [Columns; 3],
}

impl Inside {
    /// Rays per side of the box at most.
    const MOST: f64 = 512.0;

    /// `finest`: least distance of parallel rays, in units of the points. None without triangles of finite size.
    pub fn of(points: &[DVec3], triangles: &[[u32; 3]], finest: f64) -> Option<Self> {
        let corners = || triangles.iter().flatten().map(|i| points[*i as usize]);
        let (low, high) = corners().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        let longest = (high - low).max_element();
        if !(longest > 0.0 && longest.is_finite()) {
            return None;
        }
        let step = finest.max(longest / Self::MOST);
        Some(Self { axes: [0, 1, 2].map(|axis| Columns::of(axis, [low, high], step, points, triangles)) })
    }

    /// Distance between neighbouring parallel rays.
    pub fn step(&self) -> f64 {
        self.axes[0].step
    }

    /// Distance of a point from the surface, negative inside, for the distance `near` that has the sign of the nearest triangle.
    /// That sign counts beside the surface only: farther away, the triangle can belong to a sheet inside the solid.
    pub fn signed(&self, p: DVec3, near: f64) -> f64 {
        if near.abs() <= 2.0 * self.step() {
            return near;
        }
        if self.holds(p) { -near.abs() } else { near.abs() }
    }

    /// Whether the surface encloses a point.
    pub fn holds(&self, p: DVec3) -> bool {
        /// Rays of six that have to agree.
        const MOST: usize = 4;
        self.axes.iter().map(|columns| columns.votes(p)).sum::<usize>() >= MOST
    }
}

/// Rays along one axis with the places at which they cross the surface.
#[derive(Clone, Debug)]
struct Columns {
    axis: usize,
    low: [f64; 2],
    step: f64,
    size: [usize; 2],
    /// Where the crossings of each ray begin, and the end.
    starts: Vec<u32>,
    /// Coordinate along the axis, and whether the surface faces along it.
    crossings: Vec<(f64, bool)>,
}

impl Columns {
    fn of(axis: usize, [low, high]: [DVec3; 2], step: f64, points: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let size = [u, v].map(|a| ((high[a] - low[a]) / step).floor() as usize + 1);
        // Surfaces of procedural objects lie on round coordinates: rays do not.
        let low = [low[u] + 0.431 * step, low[v] + 0.617 * step];
        let mut found: Vec<(u32, f64, bool)> = Vec::new();
        for t in triangles {
            let corner = t.map(|i| {
                let p = points[i as usize];
                [(p[u] - low[0]) / step, (p[v] - low[1]) / step, p[axis]]
            });
            cross(corner, size, &mut found);
        }
        let mut starts = vec![0_u32; size[0] * size[1] + 1];
        found.iter().for_each(|(column, ..)| starts[*column as usize + 1] += 1);
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let (mut next, mut crossings) = (starts.clone(), vec![(0.0, false); found.len()]);
        for (column, at, up) in found {
            let place = &mut next[column as usize];
            crossings[*place as usize] = (at, up);
            *place += 1;
        }
        for ends in starts.windows(2) {
            crossings[ends[0] as usize..ends[1] as usize]
                .sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
        Self { axis, low, step, size, starts, crossings }
    }

    /// How many of the two rays from a point along the axis leave the surface more often than they enter it.
    fn votes(&self, p: DVec3) -> usize {
        let place = |k: usize, a: usize| {
            let at = ((p[a] - self.low[k]) / self.step).round();
            (at >= 0.0 && at < self.size[k] as f64).then_some(at as usize)
        };
        let (Some(x), Some(y)) = (place(0, (self.axis + 1) % 3), place(1, (self.axis + 2) % 3)) else { return 0 };
        let column = x * self.size[1] + y;
        let own = &self.crossings[self.starts[column] as usize..self.starts[column + 1] as usize];
        let split = own.partition_point(|(at, _)| *at < p[self.axis]);
        let (below, above) = own.split_at(split);
        let count =
            |of: &[(f64, bool)], leaves: bool| of.iter().map(|(_, up)| if *up == leaves { 1 } else { -1 }).sum::<i32>();
        usize::from(count(below, false) > 0) + usize::from(count(above, true) > 0)
    }
}

/// Adds the crossings of a triangle with the rays, which are at whole numbers of the first two coordinates.
fn cross([a, b, c]: [[f64; 3]; 3], size: [usize; 2], out: &mut Vec<(u32, f64, bool)>) {
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    let up = area > 0.0;
    let [a, b, c] = if up { [a, b, c] } else { [a, c, b] };
    let range = |k: usize| {
        let (low, high) = (a[k].min(b[k]).min(c[k]).ceil().max(0.0), a[k].max(b[k]).max(c[k]).floor());
        (low <= high).then_some(low as usize..=(high as usize).min(size[k] - 1))
    };
    let (Some(columns), Some(rows)) = (range(0), range(1)) else { return };
    for x in columns {
        for y in rows.clone() {
            let (px, py) = (x as f64, y as f64);
            // Of two triangles with a common edge, a ray through it belongs to one: the products are the same, with the other sign.
            let weight = |p: [f64; 3], q: [f64; 3]| {
                let w = (p[0] - px) * (q[1] - py) - (p[1] - py) * (q[0] - px);
                let owned = q[1] > p[1] || (q[1] == p[1] && q[0] < p[0]);
                (w > 0.0 || (w == 0.0 && owned)).then_some(w)
            };
            if let (Some(wa), Some(wb), Some(wc)) = (weight(b, c), weight(c, a), weight(a, b)) {
                let at = (wa * a[2] + wb * b[2] + wc * c[2]) / (wa + wb + wc);
                out.push(((x * size[1] + y) as u32, at, up));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mesh, Rigid};

    fn inside(mesh: &Mesh, finest: f64) -> Inside {
        let points: Vec<DVec3> = mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from))).collect();
        Inside::of(&points, &mesh.triangles, finest).unwrap()
    }

    /// Points in a cube of side 2 about the origin.
    fn scattered() -> impl Iterator<Item = DVec3> {
        let spread = |i: u32, k: f64| 2.0 * (k * f64::from(i)).fract() - 1.0;
        (0..5000).map(move |i| DVec3::new(spread(i, 0.819_17), spread(i, 0.671_04), spread(i, 0.549_70)))
    }

    #[test]
    fn a_turned_box_holds_what_is_between_its_faces() {
        let turned = Rigid { rotation: glam::DQuat::from_rotation_x(0.4), translation: DVec3::new(0.1, 0.0, -0.1) };
        for motion in [Rigid::IDENTITY, turned] {
            let found = inside(&Mesh::cuboid([-0.5, -0.3, -0.4], [0.5, 0.3, 0.4]).moved(&motion), 0.01);
            let mut inner = 0;
            for p in scattered() {
                let own = motion.inverse().apply(p).abs() - DVec3::new(0.5, 0.3, 0.4);
                // Rays are 1 cm apart.
                if own.max_element().abs() > 0.02 {
                    assert_eq!(found.holds(p), own.max_element() < 0.0, "{p}");
                    inner += usize::from(own.max_element() < 0.0);
                }
            }
            assert!(inner > 150, "{inner}");
        }
    }

    #[test]
    fn a_sheet_inside_a_solid_does_not_change_the_answer_and_a_missing_side_does_not_either() {
        let mut mesh = Mesh::cuboid([-0.5; 3], [0.5; 3]);
        mesh.append(&Mesh::cuboid([0.1, -0.4, -0.6], [0.11, 0.4, 0.4]));
        let middle = DVec3::new(0.13, 0.0, 0.0);
        let found = inside(&mesh, 0.01);
        assert!(found.holds(middle) && !found.holds(DVec3::new(0.53, 0.0, 0.0)));
        // Before the sheet, but far behind the sides.
        assert_eq!((found.signed(middle, 0.02), found.signed(middle, 0.03)), (0.02, -0.03));
        assert_eq!(found.signed(DVec3::new(0.53, 0.0, 0.0), -0.03), 0.03);
        let mut open = Mesh::cuboid([-0.5; 3], [0.5; 3]);
        open.triangles.truncate(10);
        let found = inside(&open, 0.01);
        assert!(found.holds(middle) && !found.holds(DVec3::splat(0.53)));
        assert!(Inside::of(&[], &[], 0.01).is_none());
    }

    #[test]
    fn a_cavity_is_outside() {
        let mut mesh = Mesh::cuboid([-0.5; 3], [0.5; 3]);
        let mut cavity = Mesh::cuboid([-0.3; 3], [0.3; 3]);
        cavity.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        mesh.append(&cavity);
        let found = inside(&mesh, 1e-9);
        assert!((found.step() - 1.0 / 512.0).abs() < 1e-12);
        assert!(!found.holds(DVec3::ZERO) && found.holds(DVec3::new(0.4, 0.0, 0.1)) && !found.holds(DVec3::X));
    }
}
