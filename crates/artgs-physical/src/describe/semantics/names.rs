//! Names of links by their class: `drawer`, `door_left`, `drawer_2`.

use super::form::{Sample, samples, span};
use crate::settings::DescribeSettings;
use artgs_core::{Asset, HingeSide, PartClass, PartSemantics, Rigid};
use glam::DVec3;

/// Names of the links of an asset whose front is along -Y; none for links that keep theirs: the base, and parts of no class.
///
/// A class with one part names it. Of two doors with hinges at different sides, one is `door_left`, the other `door_right`.
/// Others are numbered as one reads them from the front, row by row from the top, each from the left.
pub(crate) fn names(asset: &Asset, classes: &[PartSemantics], settings: &DescribeSettings) -> Vec<Option<String>> {
    let mut out: Vec<Option<String>> = vec![None; asset.links.len()];
    for class in PartClass::ALL {
        if matches!(class, PartClass::Body | PartClass::Part) {
            continue;
        }
        let members: Vec<usize> = (0..asset.links.len()).filter(|i| classes[*i].class == class).collect();
        let sides: Vec<Option<HingeSide>> = members.iter().map(|i| classes[*i].hinge).collect();
        let pair = |a, b| sides == [Some(a), Some(b)];
        let (left, right) = (HingeSide::Left, HingeSide::Right);
        match members.as_slice() {
            [one] => out[*one] = Some(class.name().into()),
            [a, b] if pair(left, right) || pair(right, left) => {
                for i in [*a, *b] {
                    out[i] = classes[i].hinge.map(|side| format!("{}_{}", class.name(), side.name()));
                }
            }
            _ => {
                for (k, i) in in_reading_order(asset, &members, settings).into_iter().enumerate() {
                    out[i] = Some(format!("{}_{}", class.name(), k + 1));
                }
            }
        }
    }
    out
}

/// Links row by row from the top, those of a row from the left.
fn in_reading_order(asset: &Asset, members: &[usize], settings: &DescribeSettings) -> Vec<usize> {
    let spacing = settings.order_share * asset.bounds_diagonal();
    let place = |i: &usize| {
        let link = &asset.links[*i];
        let surface: Vec<Sample> = samples(&link.visual.mesh, &Rigid::shift(link.origin), spacing);
        let of = |axis: DVec3| span(&surface, axis, settings.beyond).unwrap_or([link.origin.dot(axis); 2]);
        (*i, of(DVec3::Z), of(DVec3::X))
    };
    let mut left: Vec<(usize, [f64; 2], [f64; 2])> = members.iter().map(place).collect();
    left.sort_by(|a, b| b.1[1].total_cmp(&a.1[1]).then(a.2[0].total_cmp(&b.2[0])));
    let mut out = Vec::new();
    while let Some((_, [low, high], _)) = left.first().copied() {
        // A row is what has its middle beside the highest part.
        let beside = |z: [f64; 2]| (low..=high).contains(&(0.5 * (z[0] + z[1])));
        let (mut row, rest): (Vec<_>, Vec<_>) = left.into_iter().partition(|(_, z, _)| beside(*z));
        if row.is_empty() {
            out.extend(rest.into_iter().map(|(i, _, _)| i));
            break;
        }
        row.sort_by(|a, b| a.2[0].total_cmp(&b.2[0]));
        out.extend(row.into_iter().map(|(i, _, _)| i));
        left = rest;
    }
    out
}
