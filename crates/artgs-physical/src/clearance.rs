//! Cuts convex pieces so that no two links collide at any joint values.
//!
//! Convex pieces of measured surfaces overlap by a voxel where parts touch, and by more where a piece covers a cavity.
//! Joints stay unchanged: the overlap is cut off along the face of the other piece that removes the least volume. A piece of
//! which a cut would waste much is halved first, so that only the half in the way is cut. Pieces only shrink, so the process
//! terminates.

use crate::hull::{Hull, pose};
use artgs_core::Rigid;
use glam::DVec3;
use parry3d::bounding_volume::{Aabb, BoundingVolume as _};
use parry3d::math::Pose3;
use parry3d::shape::Shape;
use std::collections::BTreeSet;

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
    /// A piece of which a cut would uncover more than the square of this is halved instead, as long as it is longer than
    /// twice this, ...
    pub waste: f64,
    /// ... and as long as the link has fewer pieces than this.
    pub most: usize,
}

/// A piece of a link while it is cut.
struct Piece {
    hull: Hull,
    /// Points of the observed surface that it covers.
    covers: Vec<DVec3>,
}

impl Piece {
    fn of(hull: Hull, points: &[DVec3], cover: f64) -> Self {
        let ([low, high], planes) = (hull.bounds(), hull.planes());
        let near = |p: &&DVec3| {
            p.cmpge(low - cover).all() && p.cmple(high + cover).all() && planes.iter().all(|f| f.distance(**p) <= cover)
        };
        Self { covers: points.iter().filter(near).copied().collect(), hull }
    }
}

/// Cuts `pieces` until in every one of `stances` (link poses in the object's frame, one per link) no two links are closer
/// than the gap. `surface`: points of the observed surface of every link, link frames; cuts leave as many of them covered as
/// possible. `related(a, b)`: one of two links carries the other. Two links have the same relative pose in many stances: each
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
            let spacing = Spacing { gap: spacing.gap + margins, ..*spacing };
            for stance in stances {
                let b_to_a = stance[a].inverse() * stance[b];
                if seen.insert(bits(&b_to_a)) {
                    clear_pair(&mut pair, &b_to_a, &spacing, &mut out);
                }
            }
            [whole[a], whole[b]] = pair;
        }
    }
    *pieces = whole.into_iter().map(|link| link.into_iter().map(|piece| piece.hull).collect()).collect();
    out.volume[1] = volume(pieces);
    out
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
                false => links[0][i].hull.shortfall(&poses[0], &links[1][j].hull, &poses[1], spacing.gap),
            };
            if short <= spacing.tolerance {
                (j, tries) = (j + 1, 0);
                continue;
            }
            tries += 1;
            out.deepest = out.deepest.max(short - spacing.gap);
            let (link, rest) = match tries > MOST_TRIES {
                true => (1, None),
                false => part(&links[0][i], &links[1][j], b_to_a, spacing),
            };
            let at = if link == 0 { i } else { j };
            if links[link].len() < spacing.most
                && let Some([one, other]) = halves(&links[link][at], rest.as_ref(), spacing)
            {
                around[link][at] = one.hull.shape().compute_aabb(&poses[link]);
                around[link].push(other.hull.shape().compute_aabb(&poses[link]));
                links[link][at] = one;
                links[link].push(other);
                tries = 0;
                continue;
            }
            out.cuts += 1;
            match rest {
                Some(rest) => {
                    around[link][at] = rest.shape().compute_aabb(&poses[link]);
                    let covers = std::mem::take(&mut links[link][at].covers);
                    links[link][at] = Piece::of(rest, &covers, spacing.cover);
                }
                None => {
                    links[link].remove(at);
                    around[link].remove(at);
                    out.lost += 1;
                    if link == 0 {
                        continue 'first;
                    }
                    tries = 0;
                }
            }
        }
        i += 1;
    }
}

/// A piece cut across the middle of its longest side, if the cut that leaves `rest` would uncover much of the surface and the
/// piece is not too small.
fn halves(piece: &Piece, rest: Option<&Hull>, spacing: &Spacing) -> Option<[Piece; 2]> {
    let [low, high] = piece.hull.bounds();
    let size = high - low;
    let lost = match rest {
        Some(rest) => piece.covers.len() - Piece::of(rest.clone(), &piece.covers, spacing.cover).covers.len(),
        None => piece.covers.len(),
    };
    if lost as f64 * spacing.area <= spacing.waste * spacing.waste || size.max_element() < 2.0 * spacing.waste {
        return None;
    }
    let axis = [DVec3::X, DVec3::Y, DVec3::Z][(0..3).max_by(|a, b| size[*a].total_cmp(&size[*b]))?];
    let middle = axis.dot(low + high) / 2.0;
    let half = |sign: f64| {
        let plane = crate::hull::Plane { normal: axis * sign, offset: middle * sign };
        Some(Piece::of(piece.hull.clipped(&plane, spacing.thinnest)?, &piece.covers, spacing.cover))
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

/// The cut that separates two pieces and uncovers the least of their surfaces, of these the one that removes the least
/// volume: which of them is cut (0 or 1), and what is left of it.
fn part(a: &Piece, b: &Piece, b_to_a: &Rigid, spacing: &Spacing) -> (usize, Option<Hull>) {
    /// Number of faces, those with the least depth, that are tried.
    const TRIED: usize = 6;
    /// Weight of the area of the side of a cube with the removed volume.
    const VOLUME: f64 = 0.1;
    let a_to_b = b_to_a.inverse();
    let Spacing { gap, thinnest, .. } = *spacing;
    // A piece is on one side of each of its faces, so the rest of the other piece, cut a gap beyond the face, is free.
    let faces = |own: &Hull, other: &Hull, to_other: &Rigid| {
        let planes = own.planes().into_iter().map(|plane| {
            let plane = plane.moved(to_other);
            (other.depth(&plane), crate::hull::Plane { normal: -plane.normal, offset: -plane.offset - gap })
        });
        let mut planes: Vec<_> = planes.collect();
        planes.sort_by(|x, y| x.0.total_cmp(&y.0));
        // Triangles of one face are tried once.
        planes.dedup_by(|x, y| (x.0 - y.0).abs() < 1e-7 && x.1.normal.dot(y.1.normal) > 1.0 - 1e-7);
        planes.truncate(TRIED);
        planes
    };
    let cut = |link: usize, cut: &Piece, by: &Hull, to_cut: &Rigid| -> Vec<(f64, usize, Option<Hull>)> {
        let rests = faces(by, &cut.hull, to_cut).into_iter().map(|(_, plane)| {
            let rest = cut.hull.clipped(&plane, thinnest);
            let lost = match &rest {
                Some(_) => cut.covers.iter().filter(|p| plane.distance(**p) > spacing.cover).count(),
                None => cut.covers.len(),
            };
            let volume = cut.hull.volume() - rest.as_ref().map_or(0.0, Hull::volume);
            (lost as f64 * spacing.area + VOLUME * volume.max(0.0).cbrt().powi(2), link, rest)
        });
        rests.collect()
    };
    let cuts = cut(0, a, &b.hull, b_to_a).into_iter().chain(cut(1, b, &a.hull, &a_to_b));
    cuts.min_by(|x, y| x.0.total_cmp(&y.0)).map_or((0, None), |(_, link, rest)| (link, rest))
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
        waste: 0.02,
        most: 64,
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
        assert!(done.volume[1] > 0.9 * done.volume[0], "{done:?}");
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
    fn a_piece_inside_another_is_removed() {
        let plug = cuboid(DVec3::splat(0.2), DVec3::splat(0.21));
        let mut pieces = vec![vec![cuboid(DVec3::ZERO, DVec3::ONE)], vec![plug]];
        let done = clear(&mut pieces, &[vec![Rigid::IDENTITY; 2]], &SPACING, |_, _| true);
        assert_eq!((done.lost, pieces[1].len()), (1, 0));
    }
}
