//! Heights along the front of the object, where depth noise spreads points. The fronts of drawers are the outermost surfaces there in both
//! states: what the height of a front changed by between the states is the length of its slide, and noise of single points does not change it.

use super::Discovery;
use super::front::Front;
use super::joints::JointFit;
use super::refinement::{Parts, Refinement, points_of_part};
use artgs_core::{JointEstimate, JointKind, PerState, Rigid, State};
use glam::DVec3;
use std::collections::{BTreeSet, VecDeque};
use std::ops::RangeInclusive;

/// Slides and heights this close are the same, spacings.
const SAME: f64 = 1.5;

/// Parts that slide as the fronts of the object do, if these agree better with the heights of the fronts than what was `found`.
pub(super) fn with_plateaus(
    found: &Discovery,
    movable: &RangeInclusive<usize>,
    work: &Refinement<'_>,
    result: &dyn Fn(Parts) -> Discovery,
) -> Option<Discovery> {
    /// What a change must raise the sum of quality and agreement by.
    const WORTH: f64 = 0.02;
    /// Least share of the cells that what was found moves otherwise, unless there are fewer parts.
    const DISAGREED: f64 = 0.05;
    /// Share of the explained points that must remain explained.
    const KEPT: f64 = 0.9;
    let relief = Relief::of(work.front?, work);
    let plateaus = relief.plateaus();
    let total = work.evidence.total();
    let value = |of: &Discovery| of.quality(total) + relief.agreement(&plateaus, of);
    let mut best: Option<Discovery> = None;
    for turns in turns_of(found) {
        let Some(other) = relief.explained_with(&turns, plateaus.clone(), movable, work, result) else { continue };
        let fewer = other.parts.len() < found.parts.len();
        let worth = if fewer { 0.0 } else { WORTH };
        let agrees = fewer || relief.agreement(&plateaus, &other) > relief.agreement(&plateaus, found) + DISAGREED;
        let better = agrees && value(&other) > best.as_ref().map_or(value(found) + worth, value);
        if better && other.explained() >= KEPT * found.explained() {
            best = Some(other);
        }
    }
    best
}

/// What was found, drawers that move alike separated where one plateau has several bars that stand out, beside each other across their length: those are
/// handles, of a drawer each. The space between such drawers need not be seen.
pub(super) fn with_handles(
    found: Discovery,
    movable: &RangeInclusive<usize>,
    work: &Refinement<'_>,
    result: &dyn Fn(Parts) -> Discovery,
) -> Discovery {
    let Some(front) = work.front else { return found };
    let relief = Relief::of(front, work);
    let mut parts = Parts { parts: found.parts.clone(), labels: found.labels.clone() };
    for plateau in relief.plateaus() {
        let pieces = relief.by_handles(&plateau);
        let mut of_pieces = pieces.iter().map(|piece| relief.part_of(piece, &found));
        let part = of_pieces.next().flatten();
        let Some(part) = part.filter(|part| pieces.len() > 1 && of_pieces.all(|other| other == Some(*part))) else {
            continue;
        };
        relief.separate(part, &pieces, &mut parts, work);
    }
    let count = parts.parts.len();
    if count > found.parts.len() && movable.contains(&count) { result(parts) } else { found }
}

/// The hinges and screws that were found, and those of them that are not doubtful.
fn turns_of(found: &Discovery) -> Vec<Vec<Rigid>> {
    /// Confidence below which a hinge is left out.
    const DOUBTFUL: f64 = 0.3;
    let of = |least: f64| -> Vec<Rigid> {
        let turns = found.parts.iter().filter(|p| p.kind != JointKind::Prismatic);
        turns.filter(|p| p.confidence.is_some_and(|c| c >= least)).map(|p| p.motion).collect()
    };
    let mut sets = vec![of(0.0), of(DOUBTFUL)];
    sets.dedup();
    sets
}

/// The outermost surface of both states on a grid across the front.
struct Relief {
    /// Unit direction of the front, world frame.
    direction: DVec3,
    /// Unit directions of columns and rows, and the places where they begin.
    across: [DVec3; 2],
    low: [f64; 2],
    /// Columns and rows.
    size: [usize; 2],
    /// Distance of cells, scene units.
    cell: f64,
    /// Heights above this stand out of what rests.
    standing_out: f64,
    /// Lower ones are inside of the object.
    inside: f64,
    /// Shortest slide.
    shortest: f64,
    /// Height of the outermost surface in each cell, with a point of it.
    tops: PerState<Vec<Option<(f64, usize)>>>,
}

/// A connected part of the relief of which all heights changed by about the same.
#[derive(Clone, Debug)]
struct Plateau {
    /// Change of the heights from start to end.
    length: f64,
    cells: Vec<usize>,
}

impl Relief {
    fn of(front: Front, work: &Refinement<'_>) -> Self {
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
    fn slide(&self, length: f64) -> Rigid {
        Rigid::shift(self.direction * length)
    }

    /// Change of the height of a cell where the front stands out in one of the states.
    fn change(&self, cell: usize) -> Option<f64> {
        let [from, to] = [self.tops[State::START][cell]?.0, self.tops[State::END][cell]?.0];
        let is_front = from.max(to) > self.standing_out && from.min(to) > self.inside;
        (is_front && (to - from).abs() > self.shortest).then_some(to - from)
    }

    /// Cells beside a cell, and itself.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> + use<> {
        around(cell, self.size)
    }

    /// Connected cells whose heights changed by about the same, largest first: wide enough for a front, and of one height, not of a door that turned.
    fn plateaus(&self) -> Vec<Plateau> {
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
            let is_wide = |cell: &usize| self.around(*cell).filter(|c| cells.binary_search(c).is_ok()).count() == 9;
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
                (other.length - plateau.length).abs() < SAME * self.cell && other.cells.iter().any(|cell| near[*cell])
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
            let next: Vec<usize> = rim.iter().flat_map(|cell| self.around(*cell)).filter(|cell| !out[*cell]).collect();
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
            for next in self.around(cell) {
                let near = changes[next].is_some_and(|change| (change - mean).abs() < SAME * self.cell);
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

    /// Parts that slide as `plateaus` do, and others that turn by `turns`; none if the plateaus are none, or too many.
    fn explained_with(
        &self,
        turns: &[Rigid],
        mut plateaus: Vec<Plateau>,
        movable: &RangeInclusive<usize>,
        work: &Refinement<'_>,
        result: &dyn Fn(Parts) -> Discovery,
    ) -> Option<Discovery> {
        /// A plateau of which a smaller share moves along is none of a front: a door may have turned there.
        const LEAST: f64 = 0.3;
        while !plateaus.is_empty() {
            let slides = self.slides(&plateaus);
            let motions: Vec<Rigid> = slides.iter().chain(turns).copied().collect();
            let refined = work.refined_but(slides.len(), &motions);
            let found = result(self.divided(refined, &slides, &plateaus, work));
            let count = plateaus.len();
            plateaus.retain(|plateau| self.agreement(std::slice::from_ref(plateau), &found) >= LEAST);
            if plateaus.len() == count {
                return movable.contains(&found.parts.len()).then_some(found);
            }
        }
        None
    }

    /// Slides by the different lengths of plateaus, those of the largest ones first.
    fn slides(&self, plateaus: &[Plateau]) -> Vec<Rigid> {
        let mut lengths: Vec<f64> = Vec::new();
        for plateau in plateaus {
            if lengths.iter().all(|length| (length - plateau.length).abs() > SAME * self.cell) {
                lengths.push(plateau.length);
            }
        }
        lengths.into_iter().map(|length| self.slide(length)).collect()
    }

    /// Parts of which the first ones move by `slides`, with one part for each plateau: points go to the nearest one of the plateaus that
    /// changed by about the length of their slide.
    fn divided(&self, mut found: Parts, slides: &[Rigid], plateaus: &[Plateau], work: &Refinement<'_>) -> Parts {
        let length = |slide: &Rigid| slide.translation.dot(self.direction);
        let off = |plateau: &Plateau, i: &usize| (length(&slides[*i]) - plateau.length).abs();
        let nearest = |plateau: &Plateau| {
            (0..slides.len()).min_by(|a, b| off(plateau, a).total_cmp(&off(plateau, b))).unwrap_or_default()
        };
        let of_slide: Vec<usize> = plateaus.iter().map(nearest).collect();
        let mut parts_of: Vec<usize> = Vec::new();
        for (i, plateau) in plateaus.iter().enumerate() {
            let part = match of_slide[..i].contains(&of_slide[i]) {
                false => of_slide[i],
                true => {
                    found.parts.push(JointEstimate::new(JointKind::Prismatic, slides[of_slide[i]]));
                    found.parts.len() - 1
                }
            };
            found.parts[part].motion = self.slide(plateau.length);
            parts_of.push(part);
        }
        for slide in 0..slides.len() {
            let own: Vec<usize> = (0..plateaus.len()).filter(|i| of_slide[*i] == slide).collect();
            if own.len() < 2 {
                continue;
            }
            let nearest = self.nearest(&own.iter().map(|i| &plateaus[*i]).collect::<Vec<_>>());
            for s in State::ALL {
                let points = &work.clouds[s].cloud.points;
                let labels =
                    found.labels[s].iter_mut().zip(points).filter(|(label, _)| usize::from(**label) == slide + 1);
                labels.for_each(|(label, p)| *label = parts_of[own[nearest[self.cell_of(p.as_dvec3())]]] as u16 + 1);
            }
        }
        let fit = JointFit::new(work.scene, work.front, &work.settings.joints, work.config, true);
        for part in parts_of {
            let own = points_of_part(work.clouds, &found.labels, part as u16 + 1);
            let along = fit.along(&found.parts[part].motion, &own, SAME * self.cell);
            let free = fit.decide(&found.parts[part], &own, Some(JointKind::Prismatic)).joint;
            let near = free.motion.translation.distance(along.translation) < SAME * self.cell;
            found.parts[part].motion = if near { free.motion } else { along };
        }
        work.aligned(found)
    }

    /// The part from 0 that slides as a plateau does and has most of its cells.
    fn part_of(&self, plateau: &Plateau, found: &Discovery) -> Option<usize> {
        /// Share of the cells.
        const MOST: f64 = 0.6;
        let label = |cell: &usize| {
            let (_, point) = self.tops[State::END][*cell]?;
            usize::from(found.labels[State::END][point]).checked_sub(1)
        };
        let slide = self.slide(plateau.length);
        let of = |k: usize| plateau.cells.iter().filter(|cell| label(cell) == Some(k)).count() as f64;
        let moves_along = |k: &usize| {
            let part = &found.parts[*k];
            let apart = part.motion.translation.distance(slide.translation);
            part.kind == JointKind::Prismatic && part.parent == 0 && apart < 2.0 * SAME * self.cell
        };
        (0..found.parts.len()).filter(moves_along).find(|k| of(*k) > MOST * plateau.cells.len() as f64)
    }

    /// Gives each piece of a plateau but the first a part of its own, with the points of `part` that are nearest to it.
    fn separate(&self, part: usize, pieces: &[Plateau], parts: &mut Parts, work: &Refinement<'_>) {
        let first = parts.parts.len();
        parts.parts.extend(vec![parts.parts[part]; pieces.len() - 1]);
        let nearest = self.nearest(&pieces.iter().collect::<Vec<_>>());
        let part_of = |i: usize| if i == 0 { part } else { first + i - 1 };
        for s in State::ALL {
            let points = &work.clouds[s].cloud.points;
            let labels = parts.labels[s].iter_mut().zip(points).filter(|(label, _)| usize::from(**label) == part + 1);
            labels.for_each(|(label, p)| *label = part_of(nearest[self.cell_of(p.as_dvec3())]) as u16 + 1);
        }
        let fit = JointFit::new(work.scene, work.front, &work.settings.joints, work.config, true);
        for k in std::iter::once(part).chain(first..parts.parts.len()) {
            let own = points_of_part(work.clouds, &parts.labels, k as u16 + 1);
            parts.parts[k].motion = fit.along(&parts.parts[k].motion, &own, SAME * self.cell);
        }
    }

    /// A plateau divided between the bars that stand out of it, into equal heights if each has one bar; the plateau itself if there are none, or only one, or if they are not across
    /// the direction in which they follow each other.
    fn by_handles(&self, plateau: &Plateau) -> Vec<Plateau> {
        /// Largest part of the distance of two bars that is along them.
        const ACROSS: f64 = 0.3;
        let bars = self.bars(plateau);
        let follow = |pair: &[Bar]| {
            let way = [0, 1].map(|k| pair[1].middle[k] - pair[0].middle[k]);
            let length = way[0].hypot(way[1]);
            pair.iter().all(|bar| (way[0] * bar.along[0] + way[1] * bar.along[1]).abs() < ACROSS * length)
        };
        if bars.len() < 2 || !bars.windows(2).all(follow) {
            return vec![plateau.clone()];
        }
        let rows = self.size[1];
        let along = bars[0].along;
        let across = |[x, y]: [f64; 2]| y * along[0] - x * along[1];
        let place = |cell: usize| across([(cell / rows) as f64, (cell % rows) as f64]);
        let ends = plateau.cells.iter().map(|cell| place(*cell));
        let [low, high] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], at| [l.min(at), h.max(at)]);
        let bars: Vec<f64> = bars.iter().map(|bar| across(bar.middle)).collect();
        // Fronts of the same height, if each has its handle: handles need not be in their middle.
        let count = bars.len();
        let share = |at: f64| (((at - low) / (high - low) * count as f64) as usize).min(count - 1);
        let fronts: BTreeSet<usize> = bars.iter().map(|bar| share(*bar)).collect();
        let nearest = |cell: usize| {
            let at = place(cell);
            let far = |i: &usize| (bars[*i] - at).abs();
            match fronts.len() == count {
                true => share(at),
                false => (0..count).min_by(|a, b| far(a).total_cmp(&far(b))).unwrap_or_default(),
            }
        };
        let mut out = vec![Plateau { length: plateau.length, cells: Vec::new() }; bars.len()];
        plateau.cells.iter().for_each(|cell| out[nearest(*cell)].cells.push(*cell));
        out
    }

    /// Long groups of cells that stand out of a plateau in both states, in the order of their places.
    fn bars(&self, plateau: &Plateau) -> Vec<Bar> {
        /// Least height, cells.
        const HEIGHT: f64 = 1.2;
        /// Least number of cells.
        const LEAST: usize = 8;
        /// Least ratio of the extents along and across.
        const LONG: f64 = 2.0;
        let stands_out = |s: State| {
            let height = |cell: &usize| self.tops[s][*cell].map_or(f64::NEG_INFINITY, |top| top.0);
            let mut heights: Vec<f64> = plateau.cells.iter().map(height).collect();
            heights.sort_by(f64::total_cmp);
            let least = heights[heights.len() / 2] + HEIGHT * self.cell;
            plateau.cells.iter().map(|cell| height(cell) > least).collect::<Vec<bool>>()
        };
        let [start, end] = State::ALL.map(stands_out);
        let mut left: BTreeSet<usize> = plateau
            .cells
            .iter()
            .zip(start.iter().zip(&end))
            .filter(|(_, (a, b))| **a && **b)
            .map(|(cell, _)| *cell)
            .collect();
        let mut out: Vec<Bar> = Vec::new();
        while let Some(first) = left.pop_first() {
            let (mut cells, mut at) = (vec![first], 0);
            while at < cells.len() {
                for next in self.around(cells[at]) {
                    if left.remove(&next) {
                        cells.push(next);
                    }
                }
                at += 1;
            }
            let bar = Bar::of(&cells, self.size[1]);
            if cells.len() >= LEAST && bar.ratio >= LONG {
                out.push(bar);
            }
        }
        out.sort_by(|a, b| a.middle.partial_cmp(&b.middle).unwrap_or(std::cmp::Ordering::Equal));
        out
    }

    /// Cell of a point, world frame.
    fn cell_of(&self, p: DVec3) -> usize {
        let [x, y] = [0, 1].map(|k| {
            let at = ((p.dot(self.across[k]) - self.low[k]) / self.cell).max(0.0) as usize;
            at.min(self.size[k] - 1)
        });
        x * self.size[1] + y
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
            for next in self.around(cell) {
                if out[next] == usize::MAX {
                    out[next] = out[cell];
                    queue.push_back(next);
                }
            }
        }
        out.into_iter().map(|i| if i == usize::MAX { 0 } else { i }).collect()
    }

    /// Share of the cells of the plateaus whose outermost points move as their plateau does.
    fn agreement(&self, plateaus: &[Plateau], found: &Discovery) -> f64 {
        let (mut all, mut agree) = (0_usize, 0_usize);
        for plateau in plateaus {
            let slide = self.slide(plateau.length);
            for (s, cell) in State::ALL.into_iter().flat_map(|s| plateau.cells.iter().map(move |cell| (s, *cell))) {
                let Some((_, point)) = self.tops[s][cell] else { continue };
                let p = found.clouds[s].points[point].as_dvec3();
                let part = usize::from(found.labels[s][point]).checked_sub(1).map(|k| &found.parts[k]);
                let apart = |motion: &Rigid| motion.away_from(s).apply(p).distance(slide.away_from(s).apply(p));
                all += 1;
                agree += usize::from(part.is_some_and(|part| apart(&part.motion) < SAME * self.cell));
            }
        }
        agree as f64 / all.max(1) as f64
    }
}

/// A long group of cells, in cells.
#[derive(Clone, Copy, Debug)]
struct Bar {
    middle: [f64; 2],
    /// Unit direction of its length.
    along: [f64; 2],
    /// Extent along by that across.
    ratio: f64,
}

impl Bar {
    fn of(cells: &[usize], rows: usize) -> Self {
        let places = || cells.iter().map(|cell| [(cell / rows) as f64, (cell % rows) as f64]);
        let count = cells.len() as f64;
        let middle = [0, 1].map(|k| places().map(|p| p[k]).sum::<f64>() / count);
        let moment =
            |i: usize, j: usize| places().map(|p| (p[i] - middle[i]) * (p[j] - middle[j])).sum::<f64>() / count;
        let (xx, xy, yy) = (moment(0, 0), moment(0, 1), moment(1, 1));
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        let spread = ((xx - yy) / 2.0).hypot(xy);
        let [long, short] = [spread, -spread].map(|s| ((xx + yy) / 2.0 + s).max(0.0));
        // A cell has an extent of its own.
        let ratio = ((long + 1.0 / 12.0) / (short + 1.0 / 12.0)).sqrt();
        Self { middle, along: [angle.cos(), angle.sin()], ratio }
    }
}

/// Cells beside a cell of a grid, and itself.
fn around(cell: usize, [columns, rows]: [usize; 2]) -> impl Iterator<Item = usize> {
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
        let [x, y] = [0, 1].map(|k| (((place[k] - low[k]) / cell) as usize).min(size[k] - 1));
        around(x * size[1] + y, size).for_each(|near| columns[near].push(i));
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
mod tests {
    use super::*;
    use crate::discover::test_scene::{cabinet_scene, object_scene, with_refinement};
    use crate::discover::{DiscoverConfig, discover};

    #[test]
    fn a_drawer_with_a_wrong_length_gets_the_length_of_its_front() {
        let scene = cabinet_scene(16, 96);
        let found = discover(&scene, 2..=2, &DiscoverConfig::default()).unwrap();
        with_refinement(&scene, |work| {
            let result =
                |parts: Parts| work.evidence.result(work.scene, work.clouds, parts, Vec::new(), &[], work.settings);
            let drawer = found.parts.iter().position(|p| p.kind == JointKind::Prismatic).unwrap();
            let truth = found.parts[drawer].motion.translation;
            let mut parts = found.parts.clone();
            parts[drawer].motion = Rigid::shift(truth * 0.6);
            let short = result(Parts { parts, labels: found.labels.clone() });
            let right = with_plateaus(&short, &(1..=4), work, &result).unwrap();
            assert_eq!(right.parts.len(), 2);
            let slide = right.parts.iter().find(|p| p.kind == JointKind::Prismatic).unwrap().motion.translation;
            assert!(slide.distance(truth) < 0.01 * found.diagonal, "{slide} {truth}");
            let hinge = |of: &Discovery| of.parts.iter().find(|p| p.kind == JointKind::Revolute).unwrap().motion;
            assert!((hinge(&found).inverse() * hinge(&right)).angle().to_degrees() < 1.0);
            // What agrees with the fronts stays, and so do parts that would be too many.
            assert!(with_plateaus(&found, &(1..=4), work, &result).is_none());
            assert!(with_plateaus(&short, &(1..=1), work, &result).is_none());
        });
    }

    #[test]
    fn drawers_that_move_alike_are_separated_by_their_handles() {
        let scene = object_scene("twin_drawers", 32, 128);
        let found = discover(&scene, 2..=2, &DiscoverConfig::default()).unwrap();
        with_refinement(&scene, |work| {
            let result =
                |parts: Parts| work.evidence.result(work.scene, work.clouds, parts, Vec::new(), &[], work.settings);
            let labels = found.labels.as_ref().map(|labels| labels.iter().map(|l| u16::from(*l > 0)).collect());
            let one = result(Parts { parts: vec![found.parts[0]], labels });
            let two = with_handles(one.clone(), &(1..=4), work, &result);
            assert_eq!(two.parts.len(), 2);
            for s in State::ALL {
                let pairs = two.labels[s].iter().zip(&found.labels[s]).filter(|(_, right)| **right > 0);
                let (mut same, mut all) = (0, 0);
                pairs.for_each(|(own, right)| {
                    same += usize::from(own == right);
                    all += 1;
                });
                // Either may be the first; the sides of the drawers are near the border.
                assert!(same.max(all - same) * 100 > 85 * all, "{same} of {all}");
            }
            // No more parts than are allowed, and none where there are two already.
            assert_eq!(with_handles(one.clone(), &(1..=1), work, &result).parts.len(), 1);
            assert_eq!(with_handles(found.clone(), &(1..=4), work, &result).parts, found.parts);
        });
    }

    /// A relief of 100 x 60 cells of 1 cm, with heights at the start and changes from there.
    fn relief(heights: impl Fn(usize, usize) -> Option<(f64, f64)>) -> Relief {
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
    fn a_plateau_is_divided_between_parallel_bars_but_not_between_bars_in_a_row() {
        let with_bars = |is_bar: fn(usize, usize) -> bool| {
            let relief = relief(|x, y| match (x, y) {
                (10..70, 10..50) => Some((if is_bar(x, y) { 0.03 } else { 0.0 }, 0.2)),
                _ => Some((0.0, 0.0)),
            });
            let found = relief.plateaus();
            assert_eq!(found.len(), 1);
            relief.by_handles(&found[0]).iter().map(|p| p.cells.len()).collect::<Vec<usize>>()
        };
        assert_eq!(with_bars(|x, y| (30..50).contains(&x) && [18, 19, 20, 38, 39, 40].contains(&y)), [1200, 1200]);
        assert_eq!(with_bars(|x, y| ((15..30).contains(&x) || (50..65).contains(&x)) && (28..31).contains(&y)), [2400]);
        // Knobs say nothing, and neither does one bar.
        assert_eq!(with_bars(|x, y| (38..42).contains(&x) && ((18..22).contains(&y) || (38..42).contains(&y))), [2400]);
        assert_eq!(with_bars(|x, y| (30..50).contains(&x) && (28..31).contains(&y)), [2400]);
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
