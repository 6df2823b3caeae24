//! Where the front of a part that slides lies in one plane with the front of its carrier, or with the fronts of closed parts
//! beside it.

use crate::sweep::Surface;
use artgs_core::{Asset, JointKind};
use glam::DVec3;

/// The front of a part: the plate that looks where the part opens. Handles stand out of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plate {
    /// Coordinate along the direction in which the part opens, object's frame, all joints at 0.
    pub depth: f64,
    /// Extents along both directions across it.
    across: [[f64; 2]; 2],
}

/// Least cosine between the normals of a front and the direction in which parts open.
const FACING: f64 = 0.9;

/// Directions across the one in which a part opens.
fn sides(opens: DVec3) -> [DVec3; 2] {
    let (u, v) = opens.any_orthonormal_pair();
    [u, v]
}

/// Observed points of a link that look in direction `opens`, object's frame.
fn facing(asset: &Asset, surfaces: &[Surface], link: usize, opens: DVec3) -> Vec<DVec3> {
    let origin = asset.links[link].origin;
    surfaces[link].facing(opens, FACING).map(|p| p + origin).collect()
}

/// Depth at which most of the points lie, if at least `least` do: the mean of the fullest interval of length 2 `layer`.
fn fullest(points: &[DVec3], opens: DVec3, layer: f64, least: usize) -> Option<f64> {
    let mut depths: Vec<f64> = points.iter().map(|p| p.dot(opens)).collect();
    depths.sort_by(f64::total_cmp);
    let count = |i: usize| depths.partition_point(|d| *d <= depths[i] + 2.0 * layer) - i;
    let first = (0..depths.len()).max_by(|a, b| count(*a).cmp(&count(*b)).then(b.cmp(a)))?;
    let number = count(first);
    (number >= least).then(|| depths[first..first + number].iter().sum::<f64>() / number as f64)
}

/// The front of a link that slides and opens in direction `opens`; `layer`: distance from a plane within which points lie on it; none
/// with fewer than `least` points.
pub(crate) fn plate(
    asset: &Asset,
    surfaces: &[Surface],
    link: usize,
    opens: DVec3,
    layer: f64,
    least: usize,
) -> Option<Plate> {
    let points = facing(asset, surfaces, link, opens);
    let depth = fullest(&points, opens, layer, least)?;
    let across = sides(opens).map(|side| {
        let on_plate = points.iter().filter(|p| (p.dot(opens) - depth).abs() <= 2.0 * layer).map(|p| p.dot(side));
        on_plate.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    });
    Some(Plate { depth, across })
}

/// Depth of the front of another link within `reach` of the rim of a plate, between two depths.
pub(crate) fn frame(
    asset: &Asset,
    surfaces: &[Surface],
    link: usize,
    (plate, opens): (&Plate, DVec3),
    (reach, [low, high]): (f64, [f64; 2]),
    (layer, least): (f64, usize),
) -> Option<f64> {
    let sides = sides(opens);
    let beyond = |p: &DVec3| {
        let outside = sides.iter().zip(plate.across).map(|(side, [low, high])| {
            let x = p.dot(*side);
            (low - x).max(x - high)
        });
        outside.fold(f64::NEG_INFINITY, f64::max)
    };
    let around = facing(asset, surfaces, link, opens);
    let is_around = |p: &DVec3| (low..=high).contains(&p.dot(opens)) && (0.0..reach).contains(&beyond(p));
    let around: Vec<DVec3> = around.into_iter().filter(is_around).collect();
    fullest(&around, opens, layer, least)
}

/// Links that slide in the same direction on the same carrier.
pub(crate) fn beside(asset: &Asset, link: usize) -> impl Iterator<Item = usize> {
    /// Least cosine between the axes.
    const PARALLEL: f64 = 0.99;
    let slides = |i: usize| asset.links[i].joint.filter(|joint| joint.kind == JointKind::Prismatic);
    (0..asset.links.len()).filter(move |other| {
        let axes = slides(link).zip(slides(*other));
        *other != link
            && asset.links[*other].parent == asset.links[link].parent
            && axes.is_some_and(|(a, b)| a.axis.dot(b.axis) > PARALLEL)
    })
}
