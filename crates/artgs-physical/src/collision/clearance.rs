//! Cuts convex pieces so that no two links collide at any joint values.
//!
//! Convex pieces of measured surfaces overlap by a voxel where parts touch, and by more where a piece covers a cavity.
//! Joints stay unchanged: the overlap is cut off along the face of the other piece that removes the least volume. A piece of
//! which a cut would waste much is split by it instead: what is beyond the cut can be cut otherwise. A slide is tested as one
//! volume, which is convex for a convex piece; a hinge is tested in many poses. Pieces only shrink, so the process terminates.

use crate::collision::motions::{PairMotions, RelativeMotion};
use crate::geometry::hull::{Hull, Plane, pose};
use crate::settings::{ClearanceSettings, CollisionSettings};
use artgs_core::Rigid;
use glam::DVec3;
use parry3d_f64::bounding_volume::{Aabb, BoundingVolume as _};
use parry3d_f64::math::Pose3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Result of [`clear`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Clearance {
    /// Deepest penetration found before cutting.
    pub deepest: f64,
    /// Number of cuts.
    pub cuts: usize,
    /// Pieces that were removed completely.
    pub lost: usize,
    /// Volume before and after, all links.
    pub volume: [f64; 2],
}

/// Pieces of every link, link frames.
pub(crate) type Pieces = Vec<Vec<Hull>>;

/// Distances for [`clear`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spacing {
    /// Least distance of different links.
    pub gap: f64,
    /// Further distance of links of which neither carries the other.
    pub margins: f64,
    /// Shortfall that is ignored.
    pub tolerance: f64,
    /// Pieces thinner than this after a cut are removed.
    pub thinnest: f64,
    /// Points of the surface are covered within this distance.
    pub cover: f64,
    /// Area of the surface for which each point stands.
    pub area: f64,
    /// What a point of the link that carries the other one counts against one of that link.
    pub carrier: f64,
    /// A piece of which a cut would uncover more than the square of this is split instead, as long as what is cut off is no chip, ...
    pub waste: f64,
    /// ... and as long as the link has fewer pieces than this.
    pub most: usize,
    /// Each pair is tested twice, so that no penetration is missed.
    pub sure: bool,
    /// How cuts are chosen.
    pub settings: ClearanceSettings,
}

impl Spacing {
    /// Distances for an object with this diagonal, metres, whose links may have `most` pieces.
    pub(crate) fn of(settings: &CollisionSettings, diagonal: f64, most: u32) -> Self {
        let cover = settings.cover_of(diagonal);
        let apart = settings.apart * cover;
        Self {
            gap: settings.most_gap.min(settings.gap_share * diagonal),
            margins: settings.engine_margins.min(settings.most_margins_share * diagonal),
            tolerance: settings.contact_share * diagonal,
            thinnest: settings.thinnest_share * diagonal,
            cover,
            area: apart * apart,
            carrier: settings.clearance.carrier,
            waste: settings.clearance.waste * cover,
            most: CollisionSettings::while_cut(most) as usize,
            sure: false,
            settings: settings.clearance,
        }
    }

    /// True for a piece too short to be kept for what it covers, unless that is much.
    fn is_short(&self, [low, high]: [DVec3; 2]) -> bool {
        (high - low).max_element() < self.settings.chip * self.waste
    }
}

/// A piece of a link while it is cut.
struct Piece {
    hull: Hull,
    /// Points of the observed surface that it covers.
    covers: Vec<DVec3>,
    volume: f64,
    /// True if nothing was cut off.
    whole: bool,
}

impl Piece {
    fn of(hull: Hull, points: &[DVec3], cover: f64) -> Self {
        let ([low, high], planes) = (hull.bounds(), hull.planes());
        let near = |p: &&DVec3| {
            p.cmpge(low - cover).all() && p.cmple(high + cover).all() && planes.iter().all(|f| f.distance(**p) <= cover)
        };
        Self { covers: points.iter().filter(near).copied().collect(), volume: hull.volume(), whole: true, hull }
    }
}

/// Cuts `pieces` until no two links are closer than the gap in any of `motions`. `surface`: points of the observed surface of every
/// link, link frames; cuts leave as many of them covered as possible, and chips that cover little are removed. `related(a, b)`: one
/// of two links carries the other.
pub(crate) fn clear(
    pieces: &mut Pieces,
    surface: &[Vec<DVec3>],
    motions: &[PairMotions],
    spacing: &Spacing,
    related: impl Fn(usize, usize) -> bool,
) -> Clearance {
    let volume = |pieces: &Pieces| pieces.iter().flatten().map(Hull::volume).sum::<f64>();
    let mut out = Clearance::default();
    out.volume[0] = volume(pieces);
    let with_surface = |(link, points): (Vec<Hull>, &Vec<DVec3>)| -> Vec<Piece> {
        link.into_par_iter().map(|hull| Piece::of(hull, points, spacing.cover)).collect()
    };
    let mut whole: Vec<Vec<Piece>> = std::mem::take(pieces).into_iter().zip(surface).map(with_surface).collect();
    for PairMotions { links: [a, b], motions } in motions {
        let mut pair = [*a, *b].map(|link| std::mem::take(&mut whole[link]));
        let margins = if related(*a, *b) { 0.0 } else { spacing.margins };
        let carrier = if related(*a, *b) { spacing.carrier } else { 1.0 };
        let spacing = Spacing { gap: spacing.gap + margins, carrier, ..*spacing };
        motions.iter().for_each(|motion| clear_pair(&mut pair, motion, &spacing, &mut out));
        [whole[*a], whole[*b]] = pair;
    }
    let useful = |piece: Piece| {
        let most = spacing.settings.chip_area * spacing.waste * spacing.waste;
        let is_chip = spacing.is_short(piece.hull.bounds()) && piece.covers.len() as f64 * spacing.area < most;
        (!is_chip || piece.whole).then_some(piece.hull)
    };
    *pieces = whole.into_iter().map(|link| link.into_iter().filter_map(useful).collect()).collect();
    out.volume[1] = volume(pieces);
    out
}

/// Whether a piece covers a point within `near`.
pub(crate) fn covering(pieces: &[Hull], near: f64) -> impl Fn(&DVec3) -> bool {
    let planes: Vec<([DVec3; 2], Vec<Plane>)> = pieces.iter().map(|hull| (hull.bounds(), hull.planes())).collect();
    move |p: &DVec3| {
        planes.iter().any(|([low, high], planes)| {
            p.cmpge(*low - near).all() && p.cmple(*high + near).all() && planes.iter().all(|f| f.distance(*p) <= near)
        })
    }
}

/// Places of a surface that no piece covers within `near`, wider than `wide`: the number of connected groups of points, which
/// are about `apart` from each other.
pub(crate) fn uncovered(pieces: &[Hull], surface: &[DVec3], near: f64, apart: f64, wide: f64) -> usize {
    let covered = covering(pieces, near);
    let cell = |p: &DVec3| (*p / (2.0 * apart)).floor().as_i64vec3().to_array();
    let mut cells: BTreeMap<[i64; 3], usize> = BTreeMap::new();
    surface.iter().filter(|p| !covered(p)).for_each(|p| *cells.entry(cell(p)).or_default() += 1);
    let mut groups = 0;
    while let Some((first, mut points)) = cells.pop_first() {
        let mut stack = vec![first];
        while let Some([x, y, z]) = stack.pop() {
            for i in 0..27 {
                let next = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
                if let Some(more) = cells.remove(&next) {
                    points += more;
                    stack.push(next);
                }
            }
        }
        groups += usize::from(points as f64 * apart * apart > wide * wide);
    }
    groups
}

/// The pieces of a link with the volumes through which they move, and the boxes around these.
struct Moving {
    motion: RelativeMotion,
    pose: Pose3,
    thinnest: f64,
    swept: Vec<Option<Hull>>,
    boxes: Vec<Aabb>,
}

impl Moving {
    fn new(pieces: &[Piece], motion: &RelativeMotion, thinnest: f64) -> Self {
        let mut out =
            Self { motion: *motion, pose: pose(&motion.start), thinnest, swept: Vec::new(), boxes: Vec::new() };
        pieces.iter().for_each(|piece| out.push(&piece.hull));
        out
    }

    fn push(&mut self, hull: &Hull) {
        let swept = self.motion.swept(hull, self.thinnest);
        self.boxes.push(swept.as_ref().unwrap_or(hull).around(&self.pose));
        self.swept.push(swept);
    }

    /// The piece at a place was cut.
    fn replace(&mut self, at: usize, hull: &Hull) {
        self.push(hull);
        self.remove(at);
    }

    /// The last piece takes the place.
    fn remove(&mut self, at: usize) {
        self.swept.swap_remove(at);
        self.boxes.swap_remove(at);
    }

    fn hull<'a>(&'a self, at: usize, pieces: &'a [Piece]) -> &'a Hull {
        self.swept[at].as_ref().unwrap_or(&pieces[at].hull)
    }
}

/// Cuts the pieces of two links of which the second one moves.
fn clear_pair(links: &mut [Vec<Piece>; 2], motion: &RelativeMotion, spacing: &Spacing, out: &mut Clearance) {
    let still = RelativeMotion { start: Rigid::IDENTITY, way: DVec3::ZERO };
    let mut moving = [(&links[0], &still), (&links[1], motion)]
        .map(|(pieces, motion)| Moving::new(pieces, motion, spacing.settings.swept * spacing.thinnest));
    let sure = spacing.sure || motion.way != DVec3::ZERO;
    let mut i = 0;
    'first: while i < links[0].len() {
        let (mut j, mut tries) = (0, 0);
        while j < links[1].len() {
            let apart = !moving[0].boxes[i].loosened(spacing.gap).intersects(&moving[1].boxes[j]);
            let shapes = [moving[0].hull(i, &links[0]), moving[1].hull(j, &links[1])];
            let short = match apart {
                true => 0.0,
                false => {
                    let shortfall = if sure { Hull::sure_shortfall } else { Hull::shortfall };
                    shortfall(shapes[0], &moving[0].pose, shapes[1], &moving[1].pose, spacing.gap)
                }
            };
            if short <= spacing.tolerance {
                (j, tries) = (j + 1, 0);
                continue;
            }
            tries += 1;
            out.deepest = out.deepest.max(short - spacing.gap);
            let cut = match tries > spacing.settings.tries {
                true => Cut::lose_second(&links[1][j]),
                false => part([&links[0][i], &links[1][j]], shapes, motion, spacing),
            };
            // The piece that loses more of its surface is split by the cut: what is beyond it can be cut otherwise.
            let (link, at) = if cut.lost[0] > cut.lost[1] { (0, i) } else { (1, j) };
            let obstacle = Obstacle::of(link, shapes, motion, spacing);
            if links[link].len() < spacing.most
                && let Some([one, other]) = split(&links[link][at], cut.planes[link].as_ref(), &obstacle, spacing)
            {
                moving[link].push(&other.hull);
                links[link].push(other);
                moving[link].replace(at, &one.hull);
                links[link][at] = one;
                tries = 0;
                continue;
            }
            out.cuts += 1;
            let mut gone = [false; 2];
            for (link, (at, plane)) in [i, j].into_iter().zip(cut.planes).enumerate() {
                let Some(plane) = plane else { continue };
                match links[link][at].hull.clipped(&plane, spacing.thinnest) {
                    Some(rest) => {
                        moving[link].replace(at, &rest);
                        let covers = std::mem::take(&mut links[link][at].covers);
                        links[link][at] = Piece { whole: false, ..Piece::of(rest, &covers, spacing.cover) };
                    }
                    None => {
                        links[link].swap_remove(at);
                        moving[link].remove(at);
                        out.lost += 1;
                        gone[link] = true;
                    }
                }
            }
            match gone {
                [true, _] => continue 'first,
                [_, true] => tries = 0,
                _ => {}
            }
        }
        i += 1;
    }
}

/// A hull in the way of the other link, in a frame in which the points of that link go from `start` along `way`.
struct Obstacle {
    planes: Vec<Plane>,
    start: Rigid,
    way: DVec3,
    /// Points that come deeper into the hull than this cannot be covered.
    depth: f64,
}

impl Obstacle {
    /// What is in the way of a piece of the first or second link of a pair.
    fn of(link: usize, shapes: [&Hull; 2], motion: &RelativeMotion, spacing: &Spacing) -> Self {
        let (start, way) = match link {
            0 => (motion.start.inverse(), DVec3::ZERO),
            _ => (motion.start, motion.start.turn(motion.way)),
        };
        Self { planes: shapes[1 - link].planes(), start, way, depth: spacing.cover - spacing.gap }
    }

    /// True if a point of the surface can stay covered while a hull beside it keeps the gap.
    fn spares(&self, point: DVec3) -> bool {
        let from = self.start.apply(point);
        // The part of the way that is inside all planes.
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for plane in &self.planes {
            let (distance, speed) = (plane.distance(from) + self.depth, plane.normal.dot(self.way));
            if speed == 0.0 && distance > 0.0 {
                return true;
            }
            let at = -distance / speed;
            match speed {
                s if s > 0.0 => leaves = leaves.min(at),
                s if s < 0.0 => enters = enters.max(at),
                _ => {}
            }
        }
        enters > leaves
    }
}

/// A piece split by a plane, if much of the surface that the cut uncovers can stay covered and the rest keeps some. The first one
/// is inside the plane.
fn split(piece: &Piece, plane: Option<&Plane>, obstacle: &Obstacle, spacing: &Spacing) -> Option<[Piece; 2]> {
    let plane = plane?;
    let lost = piece.covers.iter().filter(|p| plane.distance(**p) > spacing.cover && obstacle.spares(**p)).count();
    if lost as f64 * spacing.area <= spacing.waste * spacing.waste {
        return None;
    }
    let half = |plane: &Plane| {
        let rest = piece.hull.clipped(plane, spacing.thinnest)?;
        Some(Piece { whole: false, ..Piece::of(rest, &piece.covers, spacing.cover) })
    };
    let [kept, rest] = [half(plane)?, half(&Plane { normal: -plane.normal, offset: -plane.offset })?];
    (!kept.covers.is_empty() && !spacing.is_short(rest.hull.bounds())).then_some([kept, rest])
}

/// Greatest shortfall from a gap between two links in one of their motions; with a gap of 0, the deepest penetration.
pub(crate) fn deepest(pieces: &Pieces, [a, b]: [usize; 2], motion: &RelativeMotion, gap: f64) -> f64 {
    let first = pose(&Rigid::IDENTITY);
    let second = pose(&motion.start);
    let swept: Vec<Option<Hull>> = pieces[b].iter().map(|hull| motion.swept(hull, 0.0)).collect();
    let shapes = || pieces[b].iter().zip(&swept).map(|(hull, swept)| swept.as_ref().unwrap_or(hull));
    let boxes: Vec<Aabb> = shapes().map(|hull| hull.around(&second)).collect();
    let mut worst = 0.0_f64;
    for x in &pieces[a] {
        let around = x.around(&first).loosened(gap);
        for (y, _) in shapes().zip(&boxes).filter(|(_, other)| around.intersects(other)) {
            worst = worst.max(x.shortfall(&first, y, &second, gap));
        }
    }
    worst
}

/// Planes that separate two pieces.
struct Cut {
    /// What is inside stays, each in the frame of its link; none for a piece that stays whole.
    planes: [Option<Plane>; 2],
    /// Points of the surface that each piece no longer covers.
    lost: [usize; 2],
}

impl Cut {
    /// Removes the second piece.
    fn lose_second(piece: &Piece) -> Self {
        let nothing = Plane { normal: DVec3::X, offset: f64::NEG_INFINITY };
        Self { planes: [None, Some(nothing)], lost: [0, piece.covers.len()] }
    }
}

/// The cut that separates two pieces and uncovers the least of their surfaces, of these the one that removes the least: along
/// a face of either, through one of them or between both. `shapes` are the volumes through which they move.
fn part(pieces: [&Piece; 2], shapes: [&Hull; 2], motion: &RelativeMotion, spacing: &Spacing) -> Cut {
    let ClearanceSettings { places, volume, .. } = spacing.settings;
    let poses = [motion.start.inverse(), motion.start];
    // A piece is inside a plane on its whole way if it begins inside this one.
    let begins = |link: usize, plane: Plane| match link {
        0 => plane,
        _ => Plane { offset: plane.offset - plane.normal.dot(motion.way).max(0.0), ..plane },
    };
    let mut best: Option<(f64, Cut)> = None;
    for own in 0..2 {
        let (piece, other) = (pieces[own], pieces[1 - own]);
        for plane in faces(shapes[own], shapes[1 - own], &poses[own], spacing.settings.faces) {
            // Along the normal, the piece ends at the plane and the other one begins `overlap` before it.
            let there = plane.moved(&poses[own]);
            let overlap = shapes[1 - own].depth(&there);
            let thickness = piece.hull.depth(&begins(own, plane));
            let length =
                other.hull.depth(&there) + other.hull.depth(&Plane { normal: -there.normal, offset: -there.offset });
            for place in 0..=places {
                let back = (overlap + spacing.gap) * place as f64 / places as f64;
                let own_cut = begins(own, Plane { offset: plane.offset - back, ..plane });
                let beyond = there.offset - back + spacing.gap;
                let other_cut = begins(1 - own, Plane { normal: -there.normal, offset: -beyond });
                let planes = [(back > 0.0).then_some(own_cut), (place < places).then_some(other_cut)];
                let ahead = overlap + spacing.gap - back;
                let cuts = [(piece, planes[0], thickness - back), (other, planes[1], length - ahead)];
                let lost = cuts.map(|(of, plane, left)| match plane {
                    Some(_) if left < spacing.thinnest => of.covers.len(),
                    Some(plane) => of.covers.iter().filter(|p| plane.distance(**p) > spacing.cover).count(),
                    None => 0,
                });
                // The first link is the carrier.
                let weights = if own == 0 { [spacing.carrier, 1.0] } else { [1.0, spacing.carrier] };
                let area = (lost[0] as f64 * weights[0] + lost[1] as f64 * weights[1]) * spacing.area;
                // Too thin a rest is removed.
                let share = |of: &Piece, cut: f64, whole: f64| match whole - cut < spacing.thinnest {
                    true => of.volume,
                    false => of.volume * cut / whole,
                };
                let removed = share(piece, back, thickness) + share(other, ahead, length);
                let cost = area + volume * removed.cbrt().powi(2);
                if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                    let ordered = |[x, y]: [Option<Plane>; 2]| if own == 0 { [x, y] } else { [y, x] };
                    let lost = if own == 0 { lost } else { [lost[1], lost[0]] };
                    best = Some((cost, Cut { planes: ordered(planes), lost }));
                }
            }
        }
    }
    best.map_or_else(|| Cut::lose_second(pieces[1]), |(_, cut)| cut)
}

/// Faces of a hull inside which another one reaches least, outermost first.
fn faces(own: &Hull, other: &Hull, to_other: &Rigid, most: usize) -> Vec<Plane> {
    /// Differences of depths and of cosines that are rounding.
    const ROUNDING: f64 = 1e-7;
    let mut planes: Vec<(f64, Plane)> =
        own.planes().into_iter().map(|plane| (other.depth(&plane.moved(to_other)), plane)).collect();
    planes.sort_by(|x, y| x.0.total_cmp(&y.0));
    // Triangles of one face are tried once.
    planes.dedup_by(|x, y| (x.0 - y.0).abs() < ROUNDING && x.1.normal.dot(y.1.normal) > 1.0 - ROUNDING);
    planes.truncate(most);
    planes.into_iter().map(|(_, plane)| plane).collect()
}

#[cfg(test)]
#[path = "clearance_tests.rs"]
mod tests;
