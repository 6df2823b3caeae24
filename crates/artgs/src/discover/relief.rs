//! Heights along the front of the object, where depth noise spreads points. The fronts of drawers are the outermost surfaces there in both
//! states: what the height of a front changed by between the states is the length of its slide, and noise of single points does not change it.

use super::Discovery;
use super::front::Front;
use super::joints::JointFit;
use super::refinement::{Parts, Refinement, points_of_part};
use artgs_core::{JointKind, PerState, Rigid, State};
use glam::DVec3;
use std::collections::VecDeque;

/// Slides and heights this close are the same, spacings.
const SAME: f64 = 1.5;

/// The outermost surface of both states on a grid across the front.
pub(super) struct Relief {
    /// Unit direction of the front, world frame.
    direction: DVec3,
    /// Unit directions of columns and rows, and the places where they begin.
    across: [DVec3; 2],
    low: [f64; 2],
    /// Columns and rows.
    pub(super) size: [usize; 2],
    /// Distance of cells, scene units.
    pub(super) cell: f64,
    /// Heights above this stand out of what rests.
    standing_out: f64,
    /// Lower ones are inside of the object.
    inside: f64,
    /// Shortest slide.
    shortest: f64,
    /// Height of the outermost surface in each cell, with a point of it.
    pub(super) tops: PerState<Vec<Option<(f64, usize)>>>,
}

/// A connected part of the relief of which all heights changed by about the same.
#[derive(Clone, Debug)]
pub(super) struct Plateau {
    /// Change of the heights from start to end.
    pub(super) length: f64,
    pub(super) cells: Vec<usize>,
}

impl Relief {
    pub(super) fn of(front: Front, work: &Refinement<'_>) -> Self {
        /// Part of the margin of the front by which the fronts of open drawers must stand out.
        const MARGIN: f64 = 0.25;
        /// Fronts of closed drawers are this far behind what rests at most, as a share of the diagonal; what is seen where a door was is
        /// deeper inside.
        const INSET: f64 = 0.05;
        /// Shortest slide, spacings.
        const SHORTEST: f64 = 3.0;
        let lengths = work.scene.lengths;
        let (cell, direction) = (f64::from(lengths.spacing), front.direction.as_dvec3());
        let (u, v) = direction.any_orthonormal_pair();
        let places = work.clouds.as_ref().map(|c| {
            let place = |p: &glam::Vec3| {
                let p = p.as_dvec3();
                [p.dot(u), p.dot(v), p.dot(direction)]
            };
            c.cloud.points.iter().map(place).collect::<Vec<[f64; 3]>>()
        });
        let all = || places.iter().flatten();
        let ends = |k: usize| all().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], p| [l.min(p[k]), h.max(p[k])]);
        let (across, along) = (ends(0), ends(1));
        let size = [across, along].map(|[low, high]| ((high - low) / cell).max(0.0) as usize + 1);
        let tops = places.as_ref().map(|places| tops(places, [across[0], along[0]], cell, size));
        let margin = f64::from(work.settings.front.margin * lengths.diagonal);
        let standing_out = f64::from(front.height) - (1.0 - MARGIN) * margin;
        let inside = f64::from(front.height) - margin - INSET * f64::from(lengths.diagonal);
        Self {
            direction,
            across: [u, v],
            low: [across[0], along[0]],
            size,
            cell,
            standing_out,
            inside,
            shortest: SHORTEST * cell,
            tops,
        }
    }

    /// The slide along the front by a length, start to end.
    pub(super) fn slide(&self, length: f64) -> Rigid {
        Rigid::shift(self.direction * length)
    }

    /// Change of the height of a cell where the front stands out in one of the states.
    fn change(&self, cell: usize) -> Option<f64> {
        let [from, to] = [self.tops[State::START][cell]?.0, self.tops[State::END][cell]?.0];
        let is_front = from.max(to) > self.standing_out && from.min(to) > self.inside;
        (is_front && (to - from).abs() > self.shortest).then_some(to - from)
    }

    /// Connected cells whose heights changed by about the same, largest first: wide enough for a front, and of one height, not of a door
    /// that turned.
    pub(super) fn plateaus(&self) -> Vec<Plateau> {
        /// Least number of cells.
        const LEAST: usize = 60;
        /// Greatest slope of the changes.
        const STEEPEST: f64 = 0.08;
        let changes: Vec<Option<f64>> = (0..self.size[0] * self.size[1]).map(|cell| self.change(cell)).collect();
        let mut taken: Vec<bool> = changes.iter().map(Option::is_none).collect();
        let mut out = Vec::new();
        for first in 0..changes.len() {
            if taken[first] {
                continue;
            }
            let cells = self.grown(first, &changes, &mut taken);
            let is_wide =
                |cell: &usize| around(*cell, self.size).filter(|c| cells.binary_search(c).is_ok()).count() == 9;
            let inner = cells.iter().filter(|cell| is_wide(cell)).count();
            if cells.len() >= LEAST && 4 * inner >= cells.len() && self.slope(&cells, &changes) < STEEPEST {
                let mut lengths: Vec<f64> = cells.iter().filter_map(|cell| changes[*cell]).collect();
                lengths.sort_by(f64::total_cmp);
                out.push(Plateau { length: lengths[lengths.len() / 2], cells });
            }
        }
        out.sort_by_key(|plateau| std::cmp::Reverse(plateau.cells.len()));
        self.joined(out)
    }

    /// Plateaus, pieces of one front joined: those whose heights changed by the same and that are next to each other.
    fn joined(&self, plateaus: Vec<Plateau>) -> Vec<Plateau> {
        let mut out: Vec<Plateau> = Vec::new();
        for plateau in plateaus {
            let near = self.near(&plateau);
            let is_same = |other: &Plateau| {
                (other.length - plateau.length).abs() < self.same() && other.cells.iter().any(|cell| near[*cell])
            };
            match out.iter().position(is_same) {
                Some(i) => out[i].cells.extend(plateau.cells),
                None => out.push(plateau),
            }
        }
        out
    }

    /// Which cells are as near to a plateau as another piece of its front may be.
    fn near(&self, plateau: &Plateau) -> Vec<bool> {
        /// Cells between two pieces of a front.
        const BETWEEN: usize = 3;
        let mut out = vec![false; self.size[0] * self.size[1]];
        let mut rim = plateau.cells.clone();
        rim.iter().for_each(|cell| out[*cell] = true);
        for _ in 0..=BETWEEN {
            let next: Vec<usize> =
                rim.iter().flat_map(|cell| around(*cell, self.size)).filter(|cell| !out[*cell]).collect();
            next.iter().for_each(|cell| out[*cell] = true);
            rim = next;
        }
        out
    }

    /// Cells connected with the first one whose changes are near the mean of those before, in order; they are taken.
    fn grown(&self, first: usize, changes: &[Option<f64>], taken: &mut [bool]) -> Vec<usize> {
        let (mut cells, mut sum) = (Vec::new(), 0.0);
        let mut queue = VecDeque::from([first]);
        taken[first] = true;
        while let Some(cell) = queue.pop_front() {
            sum += changes[cell].unwrap_or(0.0);
            cells.push(cell);
            let mean = sum / cells.len() as f64;
            for next in around(cell, self.size) {
                let near = changes[next].is_some_and(|change| (change - mean).abs() < self.same());
                if near && !taken[next] {
                    taken[next] = true;
                    queue.push_back(next);
                }
            }
        }
        cells.sort_unstable();
        cells
    }

    /// Slope of the plane through the changes of cells.
    fn slope(&self, cells: &[usize], changes: &[Option<f64>]) -> f64 {
        let rows = self.size[1];
        let at = |cell: &usize| {
            let place = [cell / rows, cell % rows].map(|i| i as f64 * self.cell);
            [place[0], place[1], changes[*cell].unwrap_or(0.0)]
        };
        let count = cells.len() as f64;
        let mean = [0, 1, 2].map(|k| cells.iter().map(|cell| at(cell)[k]).sum::<f64>() / count);
        let moment = |i: usize, j: usize| -> f64 {
            cells.iter().map(|cell| (at(cell)[i] - mean[i]) * (at(cell)[j] - mean[j])).sum()
        };
        let (uu, uv, vv, uw, vw) = (moment(0, 0), moment(0, 1), moment(1, 1), moment(0, 2), moment(1, 2));
        let determinant = uu * vv - uv * uv;
        if determinant <= 0.0 {
            return f64::INFINITY;
        }
        ((vv * uw - uv * vw) / determinant).hypot((uu * vw - uv * uw) / determinant)
    }

    /// Gives the points of part `part` (from 0) to the parts `of_plateaus`, one per plateau: each point to that of the nearest plateau.
    pub(super) fn distribute(
        &self,
        part: usize,
        plateaus: &[&Plateau],
        of_plateaus: &[usize],
        labels: &mut PerState<Vec<u16>>,
        work: &Refinement<'_>,
    ) {
        let nearest = self.nearest(plateaus);
        for s in State::ALL {
            let points = &work.clouds[s].cloud.points;
            let own = labels[s].iter_mut().zip(points).filter(|(label, _)| usize::from(**label) == part + 1);
            own.for_each(|(label, p)| *label = of_plateaus[nearest[self.cell_of(p.as_dvec3())]] as u16 + 1);
        }
    }

    /// The slide of part `k` (from 0), registered; along the front if its own direction would take the end farther away than heights that
    /// are the same differ.
    pub(super) fn registered(&self, k: usize, parts: &Parts, work: &Refinement<'_>) -> Rigid {
        let fit = JointFit::new(work.scene, work.front, &work.settings.joints, work.config, true);
        let (part, own) = (&parts.parts[k], points_of_part(work.clouds, &parts.labels, k as u16 + 1));
        let along = fit.along(&part.motion, &own, self.same());
        let free = fit.decide(part, &own, Some(JointKind::Prismatic)).joint.motion;
        if free.translation.distance(along.translation) < self.same() { free } else { along }
    }

    /// Slides and heights this close are the same, scene units.
    pub(super) fn same(&self) -> f64 {
        SAME * self.cell
    }

    /// Cell of a point, world frame.
    fn cell_of(&self, p: DVec3) -> usize {
        cell_at(self.across.map(|axis| p.dot(axis)), self.low, self.cell, self.size)
    }

    /// The nearest of some plateaus, by its index, for every cell of the grid; 0 if there are none.
    fn nearest(&self, plateaus: &[&Plateau]) -> Vec<usize> {
        let mut out = vec![usize::MAX; self.size[0] * self.size[1]];
        let mut queue = VecDeque::new();
        for (i, plateau) in plateaus.iter().enumerate() {
            for cell in &plateau.cells {
                out[*cell] = i;
                queue.push_back(*cell);
            }
        }
        while let Some(cell) = queue.pop_front() {
            for next in around(cell, self.size) {
                if out[next] == usize::MAX {
                    out[next] = out[cell];
                    queue.push_back(next);
                }
            }
        }
        out.into_iter().map(|i| if i == usize::MAX { 0 } else { i }).collect()
    }

    /// Share of the cells of the plateaus whose outermost points move as their plateau does.
    pub(super) fn agreement(&self, plateaus: &[Plateau], found: &Discovery) -> f64 {
        let (mut all, mut agree) = (0_usize, 0_usize);
        for plateau in plateaus {
            let slide = self.slide(plateau.length);
            for (s, cell) in State::ALL.into_iter().flat_map(|s| plateau.cells.iter().map(move |cell| (s, *cell))) {
                let Some((_, point)) = self.tops[s][cell] else { continue };
                let p = found.clouds[s].points[point].as_dvec3();
                let part = usize::from(found.labels[s][point]).checked_sub(1).map(|k| &found.parts[k]);
                let apart = |motion: &Rigid| motion.away_from(s).apply(p).distance(slide.away_from(s).apply(p));
                all += 1;
                agree += usize::from(part.is_some_and(|part| apart(&part.motion) < self.same()));
            }
        }
        agree as f64 / all.max(1) as f64
    }
}

/// The cell at a place, on a grid of cells of this size that begins at `low`.
fn cell_at(place: [f64; 2], low: [f64; 2], cell: f64, size: [usize; 2]) -> usize {
    let [x, y] = [0, 1].map(|k| (((place[k] - low[k]) / cell).max(0.0) as usize).min(size[k] - 1));
    x * size[1] + y
}

/// Cells beside a cell of a grid, and itself.
pub(super) fn around(cell: usize, [columns, rows]: [usize; 2]) -> impl Iterator<Item = usize> {
    let (x, y) = (cell / rows, cell % rows);
    let near = move |i: usize, count: usize| i.saturating_sub(1)..(i + 2).min(count);
    near(x, columns).flat_map(move |x| near(y, rows).map(move |y| x * rows + y))
}

/// Height of the outermost surface in each cell, from the points in and around it: `[across, along, height]`.
fn tops(places: &[[f64; 3]], low: [f64; 2], cell: f64, size: [usize; 2]) -> Vec<Option<(f64, usize)>> {
    /// Depth of the layer whose median counts, cells.
    const LAYER: f64 = 2.5;
    /// Least number of its points: fewer are stray.
    const LEAST: usize = 3;
    let mut columns: Vec<Vec<usize>> = vec![Vec::new(); size[0] * size[1]];
    for (i, place) in places.iter().enumerate() {
        around(cell_at([place[0], place[1]], low, cell, size), size).for_each(|near| columns[near].push(i));
    }
    let height = |i: usize| places[i][2];
    let top = |mut column: Vec<usize>| {
        column.sort_by(|a, b| height(*b).total_cmp(&height(*a)));
        let layer = |first: usize| {
            let end = column[first..].iter().take_while(|i| height(**i) > height(column[first]) - LAYER * cell).count();
            &column[first..first + end]
        };
        let layer = (0..column.len()).map(layer).find(|layer| layer.len() >= LEAST)?;
        let middle = layer[layer.len() / 2];
        Some((height(middle), middle))
    };
    columns.into_iter().map(top).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A relief of 100 x 60 cells of 1 cm, with heights at the start and changes from there.
    pub(in crate::discover) fn relief(heights: impl Fn(usize, usize) -> Option<(f64, f64)>) -> Relief {
        let size = [100, 60];
        let cells = || (0..size[0] * size[1]).map(|i| heights(i / size[1], i % size[1]));
        let tops = PerState::new(
            cells().map(|cell| cell.map(|(height, _)| (height, 0))).collect(),
            cells().map(|cell| cell.map(|(height, change)| (height + change, 0))).collect(),
        );
        Relief {
            direction: DVec3::NEG_Y,
            across: [DVec3::X, DVec3::Z],
            low: [0.0; 2],
            size,
            cell: 0.01,
            standing_out: 0.02,
            inside: -0.05,
            shortest: 0.03,
            tops,
        }
    }

    #[test]
    fn fronts_are_plateaus_and_a_door_and_what_it_hid_are_none() {
        let found = relief(|x, y| {
            let noise = 0.004 * ((x * 7 + y * 3) % 5) as f64 - 0.008;
            match (x, y) {
                // Two drawers beside each other, one below that closes, a door that turns by 20 degrees, and the inside behind another one.
                (0..20, 0..20) => Some((0.0, 0.2 + noise)),
                (20..40, 0..20) => Some((0.0, 0.15 + noise)),
                (0..40, 25..50) => Some((0.12, -0.12 + noise)),
                (45..70, _) => Some((0.0, 0.0364 * (x - 45) as f64 / 10.0 + noise)),
                (75..95, _) => Some((0.03, -0.3 + noise)),
                (_, 55..) => None,
                _ => Some((0.0, noise)),
            }
        })
        .plateaus();
        let mut lengths: Vec<f64> = found.iter().map(|p| (p.length * 100.0).round()).collect();
        lengths.sort_by(f64::total_cmp);
        assert_eq!(lengths, [-12.0, 15.0, 20.0], "{found:?}");
    }

    #[test]
    fn pieces_of_a_front_are_one_plateau_and_two_fronts_apart_are_two() {
        let with_gap = |gap: usize| {
            relief(|x, y| match (x, y) {
                (10..40, 10..30) => Some((0.0, 0.2)),
                (x, 10..30) if (40 + gap..70 + gap).contains(&x) => Some((0.0, 0.2)),
                (x, 10..30) if (40..40 + gap).contains(&x) => None,
                _ => Some((0.0, 0.0)),
            })
            .plateaus()
            .len()
        };
        assert_eq!([with_gap(2), with_gap(10)], [1, 2]);
    }

    #[test]
    fn stray_points_before_a_front_are_not_its_height() {
        let front = (0..400).map(|i| [(i / 20) as f64 + 0.5, (i % 20) as f64 + 0.5, 3.0 + 0.1 * (i % 3) as f64]);
        let stray = [[5.5, 5.5, 9.0], [12.5, 3.5, 8.0]];
        let places: Vec<[f64; 3]> = front.chain(stray).collect();
        let tops = tops(&places, [0.0; 2], 1.0, [20, 20]);
        assert!(tops.iter().all(|top| top.is_some_and(|(height, _)| (2.9..3.3).contains(&height))));
    }
}
