//! Things that are not of the object and moved between the recordings: a chair that was pushed. They are reported, and not
//! modelled.

use super::AlignConfig;
use super::cloud::{FusedCloud, cube};
use super::components::Components;
use super::frames::DepthFrame;
use super::global::seen_through;
use super::object::Selection;
use artgs_core::{PerState, State};
use glam::{DVec3, IVec3, Vec3};
use nalgebra::{Matrix3, SymmetricEigen};
use serde::Serialize;
use std::collections::HashSet;
use std::fmt;

/// Largest number of things that are reported.
const MOST: usize = 3;
/// Least edge of a square of the area that moved, units of the median depth: smaller areas are errors of depth.
const LEAST_EDGE: f64 = 0.1;
/// Least width across the longest direction, units of the median depth: errors along the edge of a wall are narrower.
const LEAST_WIDTH: f64 = 0.05;
/// Share of the surface at the place, as the state itself shows it, that the other state must look through.
const LEAST_SHARE: f64 = 0.5;
/// Groups whose areas differ by a larger factor are not the same thing in both states.
const SAME_AREA: f64 = 3.0;
/// The same thing is at most so many of its widths away.
const SAME_REACH: f64 = 4.0;

/// Something outside of the object that is in different places in the two states, or in one state only.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bystander {
    /// Where each state shows it and the other state shows that nothing is there.
    pub seen: PerState<Option<Seen>>,
}

/// Surfaces that one state shows and the other does not have.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Seen {
    /// Middle of their box, world of the start recording.
    pub place: DVec3,
    /// Longest edge of their box, scene units.
    pub width: f64,
    /// Their area, square scene units, at the resolution of the selection.
    pub area: f64,
}

impl fmt::Display for Bystander {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = |p: DVec3| format!("({:.2}, {:.2}, {:.2})", p.x, p.y, p.z);
        match (self.seen[State::START], self.seen[State::END]) {
            (Some(start), Some(end)) => write!(
                f,
                "something outside the object was seen near {} in the start recording and near {} in the end recording, \
                 about {:.2} units wide; it is not part of the replica",
                at(start.place),
                at(end.place),
                start.width.max(end.width)
            ),
            (start, end) => {
                let name = if start.is_some() { "start" } else { "end" };
                let Some(seen) = start.or(end) else { return Ok(()) };
                write!(
                    f,
                    "something outside the object was seen only in the {name} recording near {}, about {:.2} units wide; it \
                     is not part of the replica",
                    at(seen.place),
                    seen.width
                )
            }
        }
    }
}

/// What moved beside the object, the largest first.
pub(crate) fn find(
    frames: &PerState<Vec<DepthFrame>>,
    selection: &Selection,
    unit: f64,
    config: &AlignConfig,
) -> Vec<Bystander> {
    let groups = PerState::from_fn(|state| groups(&frames[state], &frames[state.other()], selection, unit, config));
    let mut found = paired(groups);
    let area = |b: &Bystander| b.seen.iter().flatten().map(|s| s.area).fold(0.0, f64::max);
    found.sort_by(|a, b| area(b).total_cmp(&area(a)));
    found.truncate(MOST);
    found
}

/// Large connected surfaces of one state, outside of the object, that the other state looks through.
fn groups(
    own: &[DepthFrame],
    other: &[DepthFrame],
    selection: &Selection,
    unit: f64,
    config: &AlignConfig,
) -> Vec<Seen> {
    let edge = config.object.cube * unit;
    let tolerance = config.global.tolerance * unit;
    let cloud = FusedCloud::new(own.iter(), edge as f32);
    let free = |&i: &usize| !selection.is_near(cloud.points[i].as_dvec3(), config.object.bump_spreads);
    let outside = cloud.select(&(0..cloud.len()).filter(free).collect::<Vec<_>>());
    // Errors of depth are empty space also for other frames of the same state.
    let (absent, error) = (seen_through(&outside, other, tolerance), seen_through(&outside, own, tolerance));
    let moved: Vec<Vec3> = (0..outside.len()).filter(|&i| absent[i] && !error[i]).map(|i| outside.points[i]).collect();
    let components = Components::new(&moved, edge as f32, config.object.gap);
    let mut members = vec![Vec::new(); components.count];
    for p in moved {
        if let Some(n) = components.of(p) {
            members[n].push(p);
        }
    }
    let place = |points: &Vec<Vec3>| seen(points, &outside, edge, unit);
    members.iter().filter_map(place).collect()
}

/// What a group of moved points is; none if it can be an error of depth.
fn seen(points: &[Vec3], outside: &FusedCloud, edge: f64, unit: f64) -> Option<Seen> {
    let cubes: HashSet<IVec3> = points.iter().map(|p| cube(*p, edge as f32)).collect();
    let area = cubes.len() as f64 * edge * edge;
    if area < (LEAST_EDGE * unit).powi(2) || second_width(points) < LEAST_WIDTH * unit {
        return None;
    }
    let there = outside.points.iter().filter(|p| cubes.contains(&cube(**p, edge as f32))).count();
    let (lower, upper) = points.iter().fold((Vec3::MAX, Vec3::MIN), |(l, u), p| (l.min(*p), u.max(*p)));
    let (lower, upper) = (lower.as_dvec3(), upper.as_dvec3());
    (points.len() as f64 >= LEAST_SHARE * there as f64).then(|| Seen {
        place: 0.5 * (lower + upper),
        width: (upper - lower).max_element(),
        area,
    })
}

/// Width of points in the second of their main directions: the edge of a rectangle with the same variance.
fn second_width(points: &[Vec3]) -> f64 {
    let count = points.len().max(1) as f64;
    let middle = points.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / count;
    let mut moments = Matrix3::<f64>::zeros();
    for p in points {
        let d = p.as_dvec3() - middle;
        let d = nalgebra::Vector3::new(d.x, d.y, d.z);
        moments += d * d.transpose() / count;
    }
    let mut values: [f64; 3] = SymmetricEigen::new(moments).eigenvalues.into();
    values.sort_by(f64::total_cmp);
    (12.0 * values[1].max(0.0)).sqrt()
}

/// Joins what both states show of one thing: the nearest of about the same size.
fn paired(groups: PerState<Vec<Seen>>) -> Vec<Bystander> {
    let alike = |a: &Seen, b: &Seen| {
        let reach = SAME_REACH * a.width.max(b.width);
        a.area.max(b.area) <= SAME_AREA * a.area.min(b.area) && a.place.distance(b.place) <= reach
    };
    let (start, end) = (&groups[State::START], &groups[State::END]);
    let mut pairs: Vec<(f64, usize, usize)> = (0..start.len())
        .flat_map(|i| (0..end.len()).map(move |j| (i, j)))
        .filter(|&(i, j)| alike(&start[i], &end[j]))
        .map(|(i, j)| (start[i].place.distance(end[j].place), i, j))
        .collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut free = PerState::new(vec![true; start.len()], vec![true; end.len()]);
    let mut found = Vec::new();
    for (_, i, j) in pairs {
        if free[State::START][i] && free[State::END][j] {
            free[State::START][i] = false;
            free[State::END][j] = false;
            found.push(Bystander { seen: PerState::new(Some(start[i]), Some(end[j])) });
        }
    }
    for state in State::ALL {
        let alone = groups[state].iter().zip(&free[state]).filter(|(_, free)| **free);
        found.extend(alone.map(|(s, _)| {
            let seen = PerState::from_fn(|own| (own == state).then_some(*s));
            Bystander { seen }
        }));
    }
    found
}
