//! Agreement of views about surfaces: points of each view are carried into the others.

use super::samples::{CoarseView, Posed, Reading, Seen};
use glam::DVec3;
use rayon::prelude::*;

/// Depths that differ by less than this share are the same: several times the noise of depth cameras.
const TOLERANCE: f64 = 0.02;
/// Least cosine between a normal and the line of sight of a view that must see the point.
const FACING: f64 = 0.4;

/// Numbers of carried points that face the view that they are carried into.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Agreement {
    /// At the depth that the view shows.
    pub(super) agree: usize,
    /// Elsewhere: in front of what the view shows, or on its background.
    pub(super) differ: usize,
    /// Behind what the view shows: hidden by another surface, or elsewhere.
    pub(super) hidden: usize,
    /// Outside of its image or behind it.
    pub(super) outside: usize,
}

impl Agreement {
    /// Share of the points that a view could show that agree, 0 to 1.
    pub(super) fn share(&self) -> f64 {
        self.agree as f64 / (self.agree + self.differ).max(1) as f64
    }

    /// Share of all points that agree, those hidden and those outside of the images included, 0 to 1.
    pub(super) fn share_of_all(&self) -> f64 {
        self.agree as f64 / self.all().max(1) as f64
    }

    /// Number of points.
    pub(super) fn all(&self) -> usize {
        self.agree + self.differ + self.hidden + self.outside
    }

    /// Number of points that a view could show.
    pub(super) fn shown(&self) -> usize {
        self.agree + self.differ
    }

    /// One vote of a point: whether most of the views that show its place agree, or else that it is hidden or outside.
    fn vote(&self) -> Self {
        let mut vote = Self::default();
        match self {
            _ if self.agree > self.differ => vote.agree = 1,
            _ if self.differ > 0 => vote.differ = 1,
            _ if self.hidden > 0 => vote.hidden = 1,
            _ => vote.outside = usize::from(self.outside > 0),
        }
        vote
    }

    fn plus(self, other: Self) -> Self {
        let (agree, differ) = (self.agree + other.agree, self.differ + other.differ);
        Self { agree, differ, hidden: self.hidden + other.hidden, outside: self.outside + other.outside }
    }
}

/// Agreement of the views `of` with the views `with`; a view is not compared with itself.
pub(super) fn agreement(of: &[CoarseView], with: &[CoarseView], readings: [Reading; 2]) -> Agreement {
    let own: Vec<Posed<'_>> = of.iter().map(|v| Posed::new(v, readings[0])).collect();
    let other: Vec<Posed<'_>> = with.iter().map(|v| Posed::new(v, readings[1])).collect();
    let same = std::ptr::eq(of, with);
    let of_view = |i: usize| {
        let others = other.iter().enumerate().filter(|&(j, _)| !(same && j == i));
        agreement_of(&own[i], others.map(|(_, view)| view))
    };
    (0..own.len()).into_par_iter().map(of_view).reduce(Agreement::default, Agreement::plus)
}

/// Agreement of one view with others.
pub(super) fn agreement_of<'p, 'v: 'p>(view: &Posed<'_>, others: impl Iterator<Item = &'p Posed<'v>>) -> Agreement {
    let to_world = view.to_camera.inverse();
    let mut counts = Agreement::default();
    let points: Vec<(DVec3, DVec3)> = view.points().map(|(p, n)| (to_world.apply(p), to_world.turn(n))).collect();
    for other in others {
        points.iter().for_each(|(p, n)| compare(other, *p, *n, &mut counts));
    }
    counts
}

/// Points of the views `of`, each counted once by what most of the views `with` show of it.
pub(super) fn votes(of: &[CoarseView], with: &[CoarseView]) -> Agreement {
    let other: Vec<Posed<'_>> = with.iter().map(|v| Posed::new(v, Reading::STATED)).collect();
    let votes_of = |view: &CoarseView| {
        let posed = Posed::new(view, Reading::STATED);
        let to_world = posed.to_camera.inverse();
        let voted = posed.points().map(|(p, n)| {
            let (p, n) = (to_world.apply(p), to_world.turn(n));
            let mut counts = Agreement::default();
            other.iter().for_each(|view| compare(view, p, n, &mut counts));
            counts.vote()
        });
        voted.fold(Agreement::default(), Agreement::plus)
    };
    of.par_iter().map(votes_of).reduce(Agreement::default, Agreement::plus)
}

fn compare(view: &Posed<'_>, p: DVec3, n: DVec3, counts: &mut Agreement) {
    let (q, normal) = (view.to_camera.apply(p), view.to_camera.turn(n));
    if normal.dot(-q.normalize_or_zero()) < FACING {
        return;
    }
    match view.looks_at(q) {
        None => counts.outside += 1,
        Some(Seen::Unknown) => {}
        Some(Seen::Background) => counts.differ += 1,
        Some(Seen::Surface(z)) if (z - q.z).abs() < TOLERANCE * z => counts.agree += 1,
        Some(Seen::Surface(z)) if q.z > z => counts.hidden += 1,
        Some(Seen::Surface(_)) => counts.differ += 1,
    }
}
