//! Cuts with known results.

use super::*;
use crate::collision::motions::{Stance, pair_motions};

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
    settings: ClearanceSettings::DEFAULT,
};

/// Without an observed surface.
fn clear(
    pieces: &mut Pieces,
    stances: &[Vec<Rigid>],
    spacing: &Spacing,
    related: impl Fn(usize, usize) -> bool,
) -> Clearance {
    let surface = vec![Vec::new(); pieces.len()];
    super::clear(pieces, &surface, &motions(stances), spacing, related)
}

fn motions(stances: &[Vec<Rigid>]) -> Vec<PairMotions> {
    let still: Vec<Stance> = stances.iter().cloned().map(Stance::still).collect();
    pair_motions(&still, stances[0].len())
}

/// Greatest shortfall from a gap between the first two links.
fn deepest(pieces: &Pieces, stance: &[Rigid], gap: f64) -> f64 {
    let start = stance[0].inverse() * stance[1];
    super::deepest(pieces, [0, 1], &RelativeMotion { start, way: DVec3::ZERO }, gap)
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
        assert!(deepest(&pieces, stance, SPACING.gap) <= 1e-4);
    }
    // Only slivers of a hundredth on both sides were removed.
    assert!(done.volume[0] - done.volume[1] < 0.03, "{done:?}");
}

#[test]
fn a_slide_is_clear_on_its_whole_way_and_keeps_what_is_not_in_the_way() {
    // A knob above the drawer's side stands in the way of the rim of the drawer only.
    let knob = cuboid(DVec3::new(-0.1, 0.4, 0.45), DVec3::new(0.05, 0.41, 0.6));
    let side = cuboid(DVec3::ZERO, DVec3::new(0.02, 1.0, 0.5));
    let seen: Vec<DVec3> =
        (0..5000).map(|i| DVec3::new(0.02, (i % 100) as f64 / 100.0, (i / 100) as f64 / 100.0)).collect();
    let knob_seen = (0..4000).map(|i| DVec3::new(-0.1 + 0.15 * i as f64 / 4000.0, 0.4, 0.5)).collect();
    let mut pieces = vec![vec![knob], vec![side]];
    let slide =
        Stance { poses: vec![Rigid::IDENTITY; 2], slide: Some((vec![false, true], DVec3::new(0.0, -0.9, 0.0))) };
    let spacing = Spacing { carrier: 100.0, ..SPACING };
    let surface = [knob_seen, seen.clone()];
    super::clear(&mut pieces, &surface, &pair_motions(&[slide], 2), &spacing, |_, _| true);
    for step in 0..=300 {
        let stance = [Rigid::IDENTITY, Rigid::shift(DVec3::NEG_Y * (0.003 * step as f64))];
        assert!(deepest(&pieces, &stance, SPACING.gap) <= 1e-4, "{step}");
    }
    let covered = |p: &DVec3| pieces[1].iter().any(|h| h.planes().iter().all(|f| f.distance(*p) <= 5e-3));
    let below: Vec<DVec3> = seen.into_iter().filter(|p| p.z < 0.44).collect();
    assert!(below.iter().all(covered), "{} pieces", pieces[1].len());
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
    assert!(stances.iter().all(|s| deepest(&pieces, s, SPACING.gap) <= 1e-4));
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
    assert!(deepest(&pieces, &stance, SPACING.gap) <= 1e-4);
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
    assert!(deepest(&pieces, &stance, SPACING.gap) <= 1e-4, "{done:?}");
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
    let done = super::clear(&mut pieces, &surface, &motions(&[vec![Rigid::IDENTITY; 2]]), &spacing, |_, _| true);
    assert_eq!((pieces[0].len(), pieces[1].len(), done.lost), (1, 1, 0), "{done:?}");
    let [[low, board_top], [floor_low, high]] = [0, 1].map(|link: usize| pieces[link][0].bounds());
    assert!(low.z.abs() < 1e-6 && (high.z - 0.025).abs() < 1e-6, "{low} {high}");
    assert!(floor_low.z - board_top.z > 1.8e-3, "{board_top} {floor_low}");
}

#[test]
fn a_panel_that_is_hit_in_one_place_keeps_the_rest() {
    let panel = cuboid(DVec3::ZERO, DVec3::new(1.0, 0.01, 1.0));
    let block = cuboid(DVec3::new(0.45, -0.5, 0.45), DVec3::new(0.5, 0.5, 0.5));
    let seen: Vec<DVec3> = (0..2500).map(|i| DVec3::new((i % 50) as f64 / 50.0, 0.0, (i / 50) as f64 / 50.0)).collect();
    // The block was seen too, and counts more.
    let faces = (0..4000).map(|i| DVec3::new(0.45, -0.5 + i as f64 / 4000.0, 0.47)).collect();
    let mut pieces = vec![vec![block], vec![panel]];
    let spacing = Spacing { area: 4e-4, carrier: 100.0, ..SPACING };
    super::clear(&mut pieces, &[faces, seen.clone()], &motions(&[vec![Rigid::IDENTITY; 2]]), &spacing, |_, _| true);
    let covered = |p: &DVec3| pieces[1].iter().any(|h| h.planes().iter().all(|f| f.distance(*p) <= 5e-3));
    let share = seen.iter().filter(|p| covered(p)).count() as f64 / seen.len() as f64;
    assert!(share > 0.97 && pieces[1].len() > 1, "{share} {}", pieces[1].len());
}

#[test]
fn places_without_a_piece_are_counted() {
    let grid: Vec<DVec3> = (0..2500).map(|i| DVec3::new((i % 50) as f64 / 50.0, (i / 50) as f64 / 50.0, 0.0)).collect();
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
