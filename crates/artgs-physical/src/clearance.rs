//! Cuts convex pieces so that no two links collide at any joint values.
//!
//! Convex pieces of measured surfaces overlap by a voxel where parts touch, and by more where a piece covers a cavity.
//! Joints stay unchanged: the overlap is cut off along the face of the other piece that removes the least volume. A piece of
//! which a cut would waste much is halved first, so that only the half in the way is cut. Pieces only shrink, so the process
//! terminates.

use crate::hull::{Hull, Plane, pose};
use artgs_core::Rigid;
use glam::DVec3;
use parry3d::bounding_volume::{Aabb, BoundingVolume as _};
use parry3d::math::Pose3;
use parry3d::shape::Shape;
use std::collections::{BTreeMap, BTreeSet};

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
    /// Least distance of different links: engines put margins around hulls.
    pub gap: f64,
    /// Further distance of links of which neither carries the other. PyBullet tests only such pairs, with a margin of 1 mm
    /// around each hull, and its contacts stop a part that passes another one closer than these margins.
    pub margins: f64,
    /// Shortfall that is ignored.
    pub tolerance: f64,
    /// Pieces thinner than this after a cut are removed.
    pub thinnest: f64,
    /// Points of the surface are covered within this distance.
    pub cover: f64,
    /// Area of the surface for which each point stands.
    pub area: f64,
    /// What a point of the link that carries the other one counts against one of that link: where a part passes, its carrier
    /// cannot be, also where it was observed.
    pub carrier: f64,
    /// A piece of which a cut would uncover more than the square of this is halved instead, as long as it is longer than
    /// twice this, ...
    pub waste: f64,
    /// ... and as long as the link has fewer pieces than this.
    pub most: usize,
    /// Each pair is tested twice, so that no penetration is missed.
    pub sure: bool,
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

/// Cuts `pieces` until in every one of `stances` (link poses in the object's frame, one per link) no two links are closer
/// than the gap. `surface`: points of the observed surface of every link, link frames; cuts leave as many of them covered as
/// possible, and chips that cover little are removed. `related(a, b)`: one of two links carries the other. Two links have the same relative pose in many stances: each
/// relative pose is tested once.
pub(crate) fn clear(
    pieces: &mut Pieces,
    surface: &[Vec<DVec3>],
    stances: &[Vec<Rigid>],
    spacing: &Spacing,
    related: impl Fn(usize, usize) -> bool,
) -> Clearance {
    let volume = |pieces: &Pieces| pieces.iter().flatten().map(Hull::volume).sum::<f64>();
    let mut out = Clearance::default();
    out.volume[0] = volume(pieces);
    let with_surface = |(link, points): (Vec<Hull>, &Vec<DVec3>)| -> Vec<Piece> {
        link.into_iter().map(|hull| Piece::of(hull, points, spacing.cover)).collect()
    };
    let mut whole: Vec<Vec<Piece>> = std::mem::take(pieces).into_iter().zip(surface).map(with_surface).collect();
    for a in 0..whole.len() {
        for b in a + 1..whole.len() {
            let mut pair = [a, b].map(|link| std::mem::take(&mut whole[link]));
            let mut seen = BTreeSet::new();
            let margins = if related(a, b) { 0.0 } else { spacing.margins };
            let carrier = if related(a, b) { spacing.carrier } else { 1.0 };
            let spacing = Spacing { gap: spacing.gap + margins, carrier, ..*spacing };
            for stance in stances {
                let b_to_a = stance[a].inverse() * stance[b];
                if seen.insert(bits(&b_to_a)) {
                    clear_pair(&mut pair, &b_to_a, &spacing, &mut out);
                }
            }
            [whole[a], whole[b]] = pair;
        }
    }
    let useful = |piece: Piece| {
        let [low, high] = piece.hull.bounds();
        let is_chip = (high - low).max_element() < 2.0 * spacing.waste
            && piece.covers.len() as f64 * spacing.area < 0.5 * spacing.waste * spacing.waste;
        (!is_chip || piece.whole).then_some(piece.hull)
    };
    *pieces = whole.into_iter().map(|link| link.into_iter().filter_map(useful).collect()).collect();
    out.volume[1] = volume(pieces);
    out
}

/// Places of a surface that no piece covers within `near`, wider than `wide`: the number of connected groups of points, which
/// are about `apart` from each other.
pub(crate) fn uncovered(pieces: &[Hull], surface: &[DVec3], near: f64, apart: f64, wide: f64) -> usize {
    let planes: Vec<([DVec3; 2], Vec<Plane>)> = pieces.iter().map(|hull| (hull.bounds(), hull.planes())).collect();
    let covered = |p: &DVec3| {
        planes.iter().any(|([low, high], planes)| {
            p.cmpge(*low - near).all() && p.cmple(*high + near).all() && planes.iter().all(|f| f.distance(*p) <= near)
        })
    };
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

/// Key for distinct poses.
fn bits(pose: &Rigid) -> [u64; 7] {
    let ([x, y, z, w], [tx, ty, tz]) = (pose.rotation.to_array(), pose.translation.to_array());
    [x, y, z, w, tx, ty, tz].map(f64::to_bits)
}

/// Cuts the pieces of two links; `b_to_a` is the pose of the second link in the frame of the first.
fn clear_pair(links: &mut [Vec<Piece>; 2], b_to_a: &Rigid, spacing: &Spacing, out: &mut Clearance) {
    /// One cut separates two pieces; if rounding prevents that repeatedly, one of them is removed.
    const MOST_TRIES: usize = 8;
    let poses = [pose(&Rigid::IDENTITY), pose(b_to_a)];
    let boxes = |link: usize| -> Vec<Aabb> {
        links[link].iter().map(|piece| piece.hull.shape().compute_aabb(&poses[link])).collect()
    };
    let mut around = [boxes(0), boxes(1)];
    let mut i = 0;
    'first: while i < links[0].len() {
        let (mut j, mut tries) = (0, 0);
        while j < links[1].len() {
            let apart = !around[0][i].loosened(spacing.gap as f32).intersects(&around[1][j]);
            let short = match apart {
                true => 0.0,
                false => {
                    let [a, b] = [&links[0][i].hull, &links[1][j].hull];
                    let shortfall = if spacing.sure { Hull::sure_shortfall } else { Hull::shortfall };
                    shortfall(a, &poses[0], b, &poses[1], spacing.gap)
                }
            };
            if short <= spacing.tolerance {
                (j, tries) = (j + 1, 0);
                continue;
            }
            tries += 1;
            out.deepest = out.deepest.max(short - spacing.gap);
            let cut = match tries > MOST_TRIES {
                true => Cut::lose_second(&links[1][j]),
                false => part([&links[0][i], &links[1][j]], b_to_a, spacing),
            };
            // The piece that loses more of its surface is halved, if that keeps some of it.
            let (link, at) = if cut.lost[0] > cut.lost[1] { (0, i) } else { (1, j) };
            if links[link].len() < spacing.most
                && let Some([one, other]) = halves(&links[link][at], cut.lost[link], spacing)
            {
                around[link][at] = one.hull.shape().compute_aabb(&poses[link]);
                around[link].push(other.hull.shape().compute_aabb(&poses[link]));
                links[link][at] = one;
                links[link].push(other);
                tries = 0;
                continue;
            }
            out.cuts += 1;
            let mut gone = [false; 2];
            for (link, (at, plane)) in [i, j].into_iter().zip(cut.planes).enumerate() {
                let Some(plane) = plane else { continue };
                match links[link][at].hull.clipped(&plane, spacing.thinnest) {
                    Some(rest) => {
                        around[link][at] = rest.shape().compute_aabb(&poses[link]);
                        let covers = std::mem::take(&mut links[link][at].covers);
                        links[link][at] = Piece { whole: false, ..Piece::of(rest, &covers, spacing.cover) };
                    }
                    None => {
                        links[link].remove(at);
                        around[link].remove(at);
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

/// A piece cut across the middle of its longest side, if `lost` points are much of the surface and the piece is not too small.
fn halves(piece: &Piece, lost: usize, spacing: &Spacing) -> Option<[Piece; 2]> {
    let [low, high] = piece.hull.bounds();
    let size = high - low;
    if lost as f64 * spacing.area <= spacing.waste * spacing.waste || size.max_element() < 2.0 * spacing.waste {
        return None;
    }
    let axis = [DVec3::X, DVec3::Y, DVec3::Z][(0..3).max_by(|a, b| size[*a].total_cmp(&size[*b]))?];
    let middle = axis.dot(low + high) / 2.0;
    let half = |sign: f64| {
        let plane = Plane { normal: axis * sign, offset: middle * sign };
        let rest = piece.hull.clipped(&plane, spacing.thinnest)?;
        Some(Piece { whole: false, ..Piece::of(rest, &piece.covers, spacing.cover) })
    };
    Some([half(1.0)?, half(-1.0)?])
}

/// Greatest shortfall from a gap between any two links in one stance, with the links; with a gap of 0, the deepest
/// penetration.
pub(crate) fn deepest(
    pieces: &Pieces,
    stance: &[Rigid],
    gap: f64,
    of: impl Fn(usize, usize) -> bool,
) -> (f64, [usize; 2]) {
    let poses: Vec<Pose3> = stance.iter().map(pose).collect();
    let placed: Vec<Vec<Placed>> =
        pieces.iter().zip(&poses).map(|(link, pose)| link.iter().map(|h| Placed::new(h, pose)).collect()).collect();
    let mut worst = (0.0, [0, 0]);
    for a in 0..pieces.len() {
        for b in (a + 1..pieces.len()).filter(|b| of(a, *b)) {
            for x in &placed[a] {
                for y in &placed[b] {
                    let depth = shortfall(x, y, gap);
                    if depth > worst.0 {
                        worst = (depth, [a, b]);
                    }
                }
            }
        }
    }
    worst
}

/// A posed piece with its bounding box.
struct Placed<'a> {
    hull: &'a Hull,
    pose: &'a Pose3,
    around: Aabb,
}

impl<'a> Placed<'a> {
    fn new(hull: &'a Hull, pose: &'a Pose3) -> Self {
        Self { hull, pose, around: hull.shape().compute_aabb(pose) }
    }
}

fn shortfall(a: &Placed, b: &Placed, gap: f64) -> f64 {
    if !a.around.loosened(gap as f32).intersects(&b.around) {
        return 0.0;
    }
    a.hull.shortfall(a.pose, b.hull, b.pose, gap)
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
/// a face of either, through one of them or between both.
fn part(pieces: [&Piece; 2], b_to_a: &Rigid, spacing: &Spacing) -> Cut {
    /// Number of faces, those with the least depth, that are tried.
    const TRIED: usize = 6;
    /// Places between the piece's own face and the other piece's far side.
    const PLACES: usize = 8;
    /// Weight of the area of the side of a cube with the removed volume.
    const VOLUME: f64 = 0.1;
    let a_to_b = b_to_a.inverse();
    let mut best: Option<(f64, Cut)> = None;
    for own in 0..2 {
        let (piece, other) = (pieces[own], pieces[1 - own]);
        let to_other = if own == 0 { &a_to_b } else { b_to_a };
        for plane in faces(&piece.hull, &other.hull, to_other, TRIED) {
            // Along the normal, the piece ends at the plane and the other one begins `overlap` before it.
            let there = plane.moved(to_other);
            let overlap = other.hull.depth(&there);
            let thickness = piece.hull.depth(&plane);
            let length = overlap + other.hull.depth(&Plane { normal: -there.normal, offset: -there.offset });
            for place in 0..=PLACES {
                let back = (overlap + spacing.gap) * place as f64 / PLACES as f64;
                let own_cut = Plane { offset: plane.offset - back, ..plane };
                let beyond = there.offset - back + spacing.gap;
                let other_cut = Plane { normal: -there.normal, offset: -beyond };
                let planes = [(back > 0.0).then_some(own_cut), (place < PLACES).then_some(other_cut)];
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
                let cost = area + VOLUME * removed.cbrt().powi(2);
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
    let mut planes: Vec<(f64, Plane)> =
        own.planes().into_iter().map(|plane| (other.depth(&plane.moved(to_other)), plane)).collect();
    planes.sort_by(|x, y| x.0.total_cmp(&y.0));
    // Triangles of one face are tried once.
    planes.dedup_by(|x, y| (x.0 - y.0).abs() < 1e-7 && x.1.normal.dot(y.1.normal) > 1.0 - 1e-7);
    planes.truncate(most);
    planes.into_iter().map(|(_, plane)| plane).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPACING: Spacing = Spacing {
        gap: 2e-3,
        margins: 3e-3,
        tolerance: 1e-4,
        thinnest: 1e-3,
        cover: 5e-3,
        area: 1e-4,
        carrier: 0.3,
        waste: 0.02,
        most: 64,
        sure: false,
    };

    /// Without an observed surface.
    fn clear(
        pieces: &mut Pieces,
        stances: &[Vec<Rigid>],
        spacing: &Spacing,
        related: impl Fn(usize, usize) -> bool,
    ) -> Clearance {
        let surface = vec![Vec::new(); pieces.len()];
        super::clear(pieces, &surface, stances, spacing, related)
    }

    fn cuboid(low: DVec3, high: DVec3) -> Hull {
        let corners: Vec<DVec3> = (0..8)
            .map(|i: usize| DVec3::from_array([0, 1, 2].map(|a| if i >> a & 1 == 0 { low[a] } else { high[a] })))
            .collect();
        Hull::of(&corners, 1e-6).unwrap()
    }

    #[test]
    fn a_tight_drawer_is_cut_and_not_moved() {
        let wall = |x: f64| cuboid(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 0.1, 1.0, 1.0));
        let drawer = cuboid(DVec3::new(-0.01, -0.2, 0.0), DVec3::new(1.01, 0.9, 0.5));
        let mut pieces = vec![vec![wall(-0.1), wall(1.0)], vec![drawer]];
        let stances: Vec<Vec<Rigid>> =
            (0..20).map(|i| vec![Rigid::IDENTITY, Rigid::shift(DVec3::NEG_Y * (i as f64 * 0.05))]).collect();
        let done = clear(&mut pieces, &stances, &SPACING, |_, _| true);
        assert!((done.deepest - 0.01).abs() < 1e-4 && done.lost == 0, "{done:?}");
        for stance in &stances {
            assert!(deepest(&pieces, stance, SPACING.gap, |_, _| true).0 <= 1e-4);
        }
        // Only slivers of a hundredth on both sides were removed.
        assert!(done.volume[0] - done.volume[1] < 0.03, "{done:?}");
    }

    #[test]
    fn a_turning_door_clears_its_frame() {
        let frame = cuboid(DVec3::new(-0.2, -0.1, 0.0), DVec3::new(0.0, 0.1, 1.0));
        let door = cuboid(DVec3::new(-0.02, -0.03, 0.0), DVec3::new(0.8, 0.03, 1.0));
        let mut pieces = vec![vec![frame], vec![door]];
        let turned = |i: usize| Rigid::about(DVec3::Z, DVec3::ZERO, 0.1 * i as f64);
        let stances: Vec<Vec<Rigid>> = (0..20).map(|i| vec![Rigid::IDENTITY, turned(i)]).collect();
        let done = clear(&mut pieces, &stances, &SPACING, |_, _| true);
        assert!(done.cuts > 0);
        assert!(stances.iter().all(|s| deepest(&pieces, s, SPACING.gap, |_, _| true).0 <= 1e-4));
        assert!(done.volume[1] > 0.88 * done.volume[0] && done.lost == 0, "{done:?}");
    }

    #[test]
    fn the_sure_test_separates_likewise() {
        let block = |x: f64| cuboid(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 1.0, 1.0, 1.0));
        let mut pieces = vec![vec![block(0.0)], vec![block(0.99)]];
        let stance = vec![Rigid::IDENTITY; 2];
        let sure = Spacing { sure: true, ..SPACING };
        let done = clear(&mut pieces, std::slice::from_ref(&stance), &sure, |_, _| true);
        assert!((done.deepest - 0.01).abs() < 1e-4, "{done:?}");
        assert!(deepest(&pieces, &stance, SPACING.gap, |_, _| true).0 <= 1e-4);
    }

    #[test]
    fn the_successor_of_a_removed_piece_is_tested_against_all_pieces() {
        // The first plug is removed at the far wall; the long one behind it also penetrates the near wall.
        let walls = vec![cuboid(DVec3::ZERO, DVec3::ONE), cuboid(DVec3::new(3.0, 0.0, 0.0), DVec3::new(4.0, 1.0, 1.0))];
        let plug = cuboid(DVec3::new(3.4, 0.4, 0.4), DVec3::new(3.41, 0.41, 0.41));
        let long = cuboid(DVec3::new(0.9, 0.4, 0.4), DVec3::new(2.0, 0.6, 0.6));
        let mut pieces = vec![vec![plug, long], walls];
        let stance = vec![Rigid::IDENTITY; 2];
        let done = clear(&mut pieces, &[stance.clone(), stance.clone()], &SPACING, |_, _| true);
        assert!(done.lost >= 1);
        assert!(deepest(&pieces, &stance, SPACING.gap, |_, _| true).0 <= 1e-4, "{done:?}");
    }

    #[test]
    fn links_that_do_not_carry_each_other_keep_the_margins_of_engines() {
        let block = |x: f64| cuboid(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 1.0, 1.0, 1.0));
        let distance = |pieces: &Pieces| {
            let x = |link: usize| pieces[link][0].points().iter().map(|p| p.x).fold(f64::NAN, f64::max);
            pieces[1][0].points().iter().map(|p| p.x).fold(f64::NAN, f64::min) - x(0)
        };
        for (related, expected) in [(true, 2e-3), (false, 5e-3)] {
            let mut pieces = vec![vec![block(0.0)], vec![block(1.001)]];
            clear(&mut pieces, &[vec![Rigid::IDENTITY; 2]], &SPACING, |_, _| related);
            assert!((distance(&pieces) - expected).abs() < 2e-4, "{related}: {}", distance(&pieces));
        }
    }

    #[test]
    fn sheets_that_overlap_both_keep_the_sides_that_were_seen() {
        // The floor of a drawer, seen from above, and a board below it, seen from below.
        let board = cuboid(DVec3::ZERO, DVec3::new(1.0, 1.0, 0.02));
        let floor = cuboid(DVec3::new(0.0, 0.0, 0.005), DVec3::new(1.0, 1.0, 0.025));
        let grid = |z: f64| (0..400).map(|i| DVec3::new((i % 20) as f64 / 20.0, (i / 20) as f64 / 20.0, z)).collect();
        let surface: [Vec<DVec3>; 2] = [grid(0.0), grid(0.025)];
        let mut pieces = vec![vec![board], vec![floor]];
        let spacing = Spacing { area: 2.5e-3, ..SPACING };
        let done = super::clear(&mut pieces, &surface, &[vec![Rigid::IDENTITY; 2]], &spacing, |_, _| true);
        assert_eq!((pieces[0].len(), pieces[1].len(), done.lost), (1, 1, 0), "{done:?}");
        let [[low, board_top], [floor_low, high]] = [0, 1].map(|link: usize| pieces[link][0].bounds());
        assert!(low.z.abs() < 1e-6 && (high.z - 0.025).abs() < 1e-6, "{low} {high}");
        assert!(floor_low.z - board_top.z > 1.8e-3, "{board_top} {floor_low}");
    }

    #[test]
    fn a_panel_that_is_hit_in_one_place_keeps_the_rest() {
        let panel = cuboid(DVec3::ZERO, DVec3::new(1.0, 0.01, 1.0));
        let block = cuboid(DVec3::new(0.45, -0.5, 0.45), DVec3::new(0.5, 0.5, 0.5));
        let seen: Vec<DVec3> =
            (0..2500).map(|i| DVec3::new((i % 50) as f64 / 50.0, 0.0, (i / 50) as f64 / 50.0)).collect();
        // The block was seen too, and counts more.
        let faces = (0..4000).map(|i| DVec3::new(0.45, -0.5 + i as f64 / 4000.0, 0.47)).collect();
        let mut pieces = vec![vec![block], vec![panel]];
        let spacing = Spacing { area: 4e-4, carrier: 100.0, ..SPACING };
        super::clear(&mut pieces, &[faces, seen.clone()], &[vec![Rigid::IDENTITY; 2]], &spacing, |_, _| true);
        let covered = |p: &DVec3| pieces[1].iter().any(|h| h.planes().iter().all(|f| f.distance(*p) <= 5e-3));
        let share = seen.iter().filter(|p| covered(p)).count() as f64 / seen.len() as f64;
        assert!(share > 0.97 && pieces[1].len() > 1, "{share} {}", pieces[1].len());
    }

    #[test]
    fn places_without_a_piece_are_counted() {
        let grid: Vec<DVec3> =
            (0..2500).map(|i| DVec3::new((i % 50) as f64 / 50.0, (i / 50) as f64 / 50.0, 0.0)).collect();
        let plate = |from: f64, to: f64| cuboid(DVec3::new(from, 0.0, -0.01), DVec3::new(to, 1.0, 0.0));
        let count = |pieces: &[Hull]| uncovered(pieces, &grid, 0.01, 0.02, 0.06);
        assert_eq!(count(&[plate(0.0, 1.0)]), 0);
        // A gap at one end and a gap in the middle.
        assert_eq!(count(&[plate(0.0, 0.4), plate(0.6, 0.9)]), 2);
        assert_eq!(count(&[]), 1);
    }

    #[test]
    fn a_piece_inside_another_is_removed() {
        let plug = cuboid(DVec3::splat(0.2), DVec3::splat(0.21));
        let mut pieces = vec![vec![cuboid(DVec3::ZERO, DVec3::ONE)], vec![plug]];
        let done = clear(&mut pieces, &[vec![Rigid::IDENTITY; 2]], &SPACING, |_, _| true);
        assert_eq!((done.lost, pieces[1].len()), (1, 0));
    }
}
