//! Drawers that move alike, separated by their handles.

use super::Discovery;
use super::refinement::{Parts, Refinement};
use super::relief::{Plateau, Relief, around};
use artgs_core::{JointKind, State};
use std::collections::BTreeSet;
use std::ops::RangeInclusive;

/// What was found, drawers that move alike separated where one plateau has several bars that stand out, beside each other across their
/// length: those are handles, of a drawer each. The space between such drawers need not be seen.
pub(super) fn with_handles(
    found: Discovery,
    relief: &Relief,
    movable: &RangeInclusive<usize>,
    work: &Refinement<'_>,
    result: &dyn Fn(Parts) -> Discovery,
) -> Discovery {
    let mut parts = Parts { parts: found.parts.clone(), labels: found.labels.clone() };
    for plateau in relief.plateaus() {
        let pieces = by_handles(relief, &plateau);
        let mut of_pieces = pieces.iter().map(|piece| part_of(relief, piece, &found));
        let part = of_pieces.next().flatten();
        let Some(part) = part.filter(|part| pieces.len() > 1 && of_pieces.all(|other| other == Some(*part))) else {
            continue;
        };
        separate(relief, part, &pieces, &mut parts, work);
    }
    let count = parts.parts.len();
    if count > found.parts.len() && movable.contains(&count) { result(work.aligned(parts)) } else { found }
}

/// The part from 0 that slides as a plateau does and has most of its cells.
fn part_of(relief: &Relief, plateau: &Plateau, found: &Discovery) -> Option<usize> {
    /// Share of the cells.
    const MOST: f64 = 0.6;
    let label = |cell: &usize| {
        let (_, point) = relief.tops[State::END][*cell]?;
        usize::from(found.labels[State::END][point]).checked_sub(1)
    };
    let slide = relief.slide(plateau.length);
    let of = |k: usize| plateau.cells.iter().filter(|cell| label(cell) == Some(k)).count() as f64;
    let moves_along = |k: &usize| {
        let part = &found.parts[*k];
        let apart = part.motion.translation.distance(slide.translation);
        part.kind == JointKind::Prismatic && part.parent == 0 && apart < 2.0 * relief.same()
    };
    (0..found.parts.len()).filter(moves_along).find(|k| of(*k) > MOST * plateau.cells.len() as f64)
}

/// Gives each piece of a plateau but the first a part of its own, with the points of `part` that are nearest to it.
fn separate(relief: &Relief, part: usize, pieces: &[Plateau], parts: &mut Parts, work: &Refinement<'_>) {
    let first = parts.parts.len();
    parts.parts.extend(vec![parts.parts[part]; pieces.len() - 1]);
    let of_pieces: Vec<usize> = std::iter::once(part).chain(first..parts.parts.len()).collect();
    relief.distribute(part, &pieces.iter().collect::<Vec<_>>(), &of_pieces, &mut parts.labels, work);
    for k in of_pieces {
        parts.parts[k].motion = relief.registered(k, parts, work);
    }
}

/// A plateau divided between the bars that stand out of it, into equal heights if each has one bar; the plateau itself if there are fewer
/// than two, or if they are not across the direction in which they follow each other.
fn by_handles(relief: &Relief, plateau: &Plateau) -> Vec<Plateau> {
    /// Largest part of the distance of two bars that is along them.
    const ACROSS: f64 = 0.3;
    let bars = bars(relief, plateau);
    let follow = |pair: &[Bar]| {
        let way = [0, 1].map(|k| pair[1].middle[k] - pair[0].middle[k]);
        let length = way[0].hypot(way[1]);
        pair.iter().all(|bar| (way[0] * bar.along[0] + way[1] * bar.along[1]).abs() < ACROSS * length)
    };
    if bars.len() < 2 || !bars.windows(2).all(follow) {
        return vec![plateau.clone()];
    }
    let rows = relief.size[1];
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

/// Long groups of cells that stand out of a plateau in both states, in the order of their places. Short groups at its rim, where a cell
/// may hold the surface behind, are none.
fn bars(relief: &Relief, plateau: &Plateau) -> Vec<Bar> {
    /// Least height, cells.
    const HEIGHT: f64 = 1.2;
    /// Least number of cells.
    const LEAST: usize = 8;
    /// Least ratio of the extents along and across.
    const LONG: f64 = 2.0;
    /// Least length of a bar at the rim, relative to the longest bar.
    const AT_RIM: f64 = 0.7;
    let stands_out = |s: State| {
        let height = |cell: &usize| relief.tops[s][*cell].map_or(f64::NEG_INFINITY, |top| top.0);
        let mut heights: Vec<f64> = plateau.cells.iter().map(height).collect();
        heights.sort_by(f64::total_cmp);
        let least = heights[heights.len() / 2] + HEIGHT * relief.cell;
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
    let inside: BTreeSet<usize> = plateau.cells.iter().copied().collect();
    let at_rim = |cell: &usize| {
        let beside: Vec<usize> = around(*cell, relief.size).collect();
        beside.len() < 9 || beside.iter().any(|next| !inside.contains(next))
    };
    let (mut out, mut longest): (Vec<(Bar, bool)>, f64) = (Vec::new(), 0.0);
    while let Some(first) = left.pop_first() {
        let (mut cells, mut at) = (vec![first], 0);
        while at < cells.len() {
            for next in around(cells[at], relief.size) {
                if left.remove(&next) {
                    cells.push(next);
                }
            }
            at += 1;
        }
        let bar = Bar::of(&cells, relief.size[1]);
        if cells.len() >= LEAST && bar.ratio >= LONG {
            longest = longest.max(bar.length);
            out.push((bar, cells.iter().any(at_rim)));
        }
    }
    out.retain(|(bar, rim)| !rim || bar.length >= AT_RIM * longest);
    let mut out: Vec<Bar> = out.into_iter().map(|(bar, _)| bar).collect();
    out.sort_by(|a, b| a.middle.partial_cmp(&b.middle).unwrap_or(std::cmp::Ordering::Equal));
    out
}

/// A long group of cells, in cells.
#[derive(Clone, Copy, Debug)]
struct Bar {
    middle: [f64; 2],
    /// Unit direction of its length.
    along: [f64; 2],
    /// Extent along.
    length: f64,
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
        // A cell has an extent of its own, and a row of L cells a variance of (L^2 - 1) / 12.
        let [length, width] = [long, short].map(|s| (12.0 * s + 1.0).sqrt());
        Self { middle, along: [angle.cos(), angle.sin()], length, ratio: length / width }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::relief::tests::relief;
    use crate::discover::test_scene::{object_scene, with_refinement};
    use crate::discover::{DiscoverConfig, discover};

    #[test]
    fn drawers_that_move_alike_are_separated_by_their_handles() {
        let scene = object_scene("twin_drawers", 32, 128);
        let found = discover(&scene, 2..=2, &DiscoverConfig::default()).unwrap();
        with_refinement(&scene, |work| {
            let result =
                |parts: Parts| work.evidence.result(work.scene, work.clouds, parts, Vec::new(), &[], work.settings);
            let relief = Relief::of(work.front.unwrap(), work);
            let labels = found.labels.as_ref().map(|labels| labels.iter().map(|l| u16::from(*l > 0)).collect());
            let one = result(Parts { parts: vec![found.parts[0]], labels });
            let two = with_handles(one.clone(), &relief, &(1..=4), work, &result);
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
            assert_eq!(with_handles(one.clone(), &relief, &(1..=1), work, &result).parts.len(), 1);
            assert_eq!(with_handles(found.clone(), &relief, &(1..=4), work, &result).parts, found.parts);
        });
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
            by_handles(&relief, &found[0]).iter().map(|p| p.cells.len()).collect::<Vec<usize>>()
        };
        assert_eq!(with_bars(|x, y| (30..50).contains(&x) && [18, 19, 20, 38, 39, 40].contains(&y)), [1200, 1200]);
        assert_eq!(with_bars(|x, y| ((15..30).contains(&x) || (50..65).contains(&x)) && (28..31).contains(&y)), [2400]);
        // A short ridge at the rim is no handle, bars at the rim that are as long as others are.
        assert_eq!(
            with_bars(|x, y| (30..50).contains(&x) && [18, 19, 20, 38, 39, 40].contains(&y)
                || (58..68).contains(&x) && (48..50).contains(&y)),
            [1200, 1200]
        );
        assert_eq!(with_bars(|x, y| (30..50).contains(&x) && [27, 28, 29, 47, 48, 49].contains(&y)), [1200, 1200]);
        // Knobs say nothing, and neither does one bar.
        assert_eq!(with_bars(|x, y| (38..42).contains(&x) && ((18..22).contains(&y) || (38..42).contains(&y))), [2400]);
        assert_eq!(with_bars(|x, y| (30..50).contains(&x) && (28..31).contains(&y)), [2400]);
    }
}
