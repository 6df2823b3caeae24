//! Convex pieces that cover nothing alone: what they cover, others cover too.

use crate::collision::clearance::covering;
use crate::geometry::hull::Hull;
use glam::DVec3;
use rayon::prelude::*;

/// Removes pieces of a link of which every point of the `surface` within `near` is within `near` of another piece that stays, the
/// smallest ones first. Cuts and the pieces for what they left open make such pieces; engines test each of them in every step. If more
/// than `most` are left, those go that alone cover the fewest points.
pub(crate) fn without_redundant(pieces: &mut Vec<Hull>, surface: &[DVec3], near: f64, most: usize) {
    let covered = |hull: &Hull| -> Vec<u32> {
        let holds = covering(std::slice::from_ref(hull), near);
        (0..surface.len() as u32).filter(|i| holds(&surface[*i as usize])).collect()
    };
    let covered: Vec<Vec<u32>> = pieces.par_iter().map(covered).collect();
    let mut covers = vec![0u32; surface.len()];
    covered.iter().flatten().for_each(|i| covers[*i as usize] += 1);
    let alone = |k: usize, covers: &[u32]| covered[k].iter().filter(|i| covers[**i as usize] < 2).count();
    let volumes: Vec<f64> = pieces.iter().map(Hull::volume).collect();
    // A piece that covers no seen point closes something that was not seen.
    let mut candidates: Vec<usize> = (0..pieces.len()).filter(|k| !covered[*k].is_empty()).collect();
    candidates.sort_by(|a, b| volumes[*a].total_cmp(&volumes[*b]).then(a.cmp(b)));
    let mut kept = vec![true; pieces.len()];
    let mut remove = |k: usize, covers: &mut [u32]| {
        covered[k].iter().for_each(|i| covers[*i as usize] -= 1);
        kept[k] = false;
    };
    let mut count = pieces.len();
    candidates.retain(|k| {
        let is_needed = alone(*k, &covers) > 0;
        if !is_needed {
            remove(*k, &mut covers);
            count -= 1;
        }
        is_needed
    });
    while count > most
        && let Some((at, _)) = candidates.iter().map(|k| alone(*k, &covers)).enumerate().min_by_key(|(_, alone)| *alone)
    {
        remove(candidates.remove(at), &mut covers);
        count -= 1;
    }
    let mut kept = kept.into_iter();
    pieces.retain(|_| kept.next().unwrap_or(true));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(low: [f64; 3], high: [f64; 3]) -> Hull {
        let corner = |k: usize| DVec3::from_array([0, 1, 2].map(|a| if k >> a & 1 == 0 { low[a] } else { high[a] }));
        Hull::of(&(0..8).map(corner).collect::<Vec<_>>(), 1e-3).unwrap()
    }

    #[test]
    fn pieces_that_others_cover_are_removed_and_no_point_is_left_open() {
        // A plate in two overlapping halves, two pieces within them, one that closes a gap, and one where nothing was seen.
        let halves = [block([0.0, 0.0, 0.0], [0.6, 0.5, 0.02]), block([0.5, 0.0, 0.0], [0.95, 0.5, 0.02])];
        let within = [block([0.2, 0.1, 0.002], [0.4, 0.3, 0.018]), block([0.45, 0.2, 0.0], [0.7, 0.3, 0.02])];
        let rim = block([0.93, 0.0, 0.0], [1.0, 0.5, 0.02]);
        let unseen = block([0.0, 0.0, 0.5], [0.1, 0.1, 0.6]);
        let mut pieces = [&halves[..], &within, &[rim.clone(), unseen.clone()]].concat();
        let surface: Vec<DVec3> =
            (0..5000).map(|i| DVec3::new((i % 100) as f64 / 99.0, (i / 100) as f64 / 99.0, 0.02)).collect();
        without_redundant(&mut pieces, &surface, 4e-3, 10);
        let kept: Vec<f64> = pieces.iter().map(Hull::volume).collect();
        let expected: Vec<f64> = [&halves[0], &halves[1], &rim, &unseen].map(Hull::volume).to_vec();
        assert_eq!(kept, expected);
        let holds = covering(&pieces, 4e-3);
        assert!(surface.iter().all(holds));
    }

    #[test]
    fn of_too_many_pieces_those_go_that_alone_cover_the_least() {
        let strips = [[0.0, 0.5], [0.5, 0.58], [0.58, 0.9], [0.9, 1.0]];
        let mut pieces: Vec<Hull> = strips.iter().map(|[x, y]| block([*x, 0.0, 0.0], [*y, 0.5, 0.02])).collect();
        let expected = [pieces[0].volume(), pieces[2].volume()];
        let surface: Vec<DVec3> =
            (0..5000).map(|i| DVec3::new((i % 100) as f64 / 99.0, (i / 100) as f64 / 99.0, 0.02)).collect();
        without_redundant(&mut pieces, &surface, 1e-3, 2);
        assert_eq!(pieces.iter().map(Hull::volume).collect::<Vec<_>>(), expected);
    }
}
