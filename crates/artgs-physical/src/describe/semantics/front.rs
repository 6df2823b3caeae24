//! The direction in which an object faces: where its drawers come out and its doors open to.

use super::form::{Form, samples};
use crate::settings::{DescribeSettings, FrontSettings};
use artgs_core::{Asset, PartClass, PartSemantics, Rigid};
use glam::DVec3;

/// Horizontal unit direction of the front in the asset's frame (+Z up); none if no part shows it. Every part votes with its
/// area: drawers by their axis, upright panels by their outer face, lying ones by the side that is away from their hinge.
pub(crate) fn front(asset: &Asset, classes: &[PartSemantics], settings: &DescribeSettings) -> Option<DVec3> {
    let FrontSettings { horizontal, same, .. } = settings.front;
    let diagonal = asset.bounds_diagonal();
    let forms = asset.links.iter().zip(classes).filter_map(|(link, found)| {
        let form = Form::of(link, diagonal, settings)?;
        let (direction, share) = vote(asset, &form, found, settings)?;
        let [along, reach, across] = form.extent;
        let area = if found.class == PartClass::Drawer { reach * across } else { along * reach };
        let flat = DVec3::new(direction.x, direction.y, 0.0);
        (flat.length() > horizontal).then(|| (flat.normalize_or_zero(), share * area * found.confidence))
    });
    let votes: Vec<(DVec3, f64)> = forms.collect();
    let around = |side: DVec3| votes.iter().filter(move |(v, _)| v.dot(side) > same);
    let weight = |side: DVec3| around(side).map(|(_, w)| w).sum::<f64>();
    let best = votes.iter().map(|(v, _)| *v).reduce(|a, b| if weight(b) > weight(a) * MORE { b } else { a })?;
    let mean = around(best).map(|(v, w)| *v * *w).sum::<DVec3>().try_normalize()?;
    Some(along_walls(asset, mean, &settings.front))
}

/// Factor by which a sum is larger than one that is only rounded otherwise.
const MORE: f64 = 1.0 + 1e-9;

/// The direction near `front` along which the upright faces of the static part are: doors are seldom seen quite closed, so
/// their faces are turned. `front` itself if the static part has no such faces.
fn along_walls(asset: &Asset, front: DVec3, settings: &FrontSettings) -> DVec3 {
    let FrontSettings { wall, turned: most, steps, peak: width, held: least, .. } = *settings;
    let Some(base) = asset.links.first() else { return front };
    let surface = samples(&base.visual.mesh, &Rigid::IDENTITY, f64::INFINITY);
    // Angles from the front, modulo the quarter turn between the sides of a box.
    let quarter = std::f64::consts::FRAC_PI_2;
    let angle = |n: DVec3| {
        let angle = front.cross(n).z.atan2(front.dot(n));
        angle - quarter * (angle / quarter).round()
    };
    let walls = surface.iter().filter(|s| s.normal.z.abs() < wall && s.area > 0.0);
    let walls: Vec<(f64, f64)> = walls.map(|s| (angle(s.normal), s.area)).collect();
    let near = |at: f64| walls.iter().filter(move |(a, _)| (a - at).abs() < width);
    let held = |at: f64| near(at).map(|(_, area)| area).sum::<f64>();
    let steps = (-steps..=steps).map(|i| most * f64::from(i) / f64::from(steps));
    let Some(peak) = steps.reduce(|a, b| if held(b) > held(a) * MORE { b } else { a }) else { return front };
    let (weight, total) = (held(peak), walls.iter().map(|(_, area)| area).sum::<f64>());
    if weight < least * total || total <= 0.0 {
        return front;
    }
    let turned = near(peak).map(|(a, area)| a * area).sum::<f64>() / weight;
    Rigid::about(DVec3::Z, DVec3::ZERO, turned).turn(front)
}

/// Direction for which a part votes, and what its area counts.
fn vote(asset: &Asset, form: &Form, found: &PartSemantics, settings: &DescribeSettings) -> Option<(DVec3, f64)> {
    match found.class {
        PartClass::Drawer | PartClass::Button => Some((form.opens, 1.0)),
        PartClass::Door | PartClass::Flap => Some((form.facing(settings.facing), 1.0)),
        PartClass::SlidingDoor => {
            // The side on which the part is, seen from the middle of the object.
            let across = form.axis.cross(form.reach);
            let points = |link: &artgs_core::AssetLink| {
                let at = link.origin;
                link.visual
                    .mesh
                    .vertices
                    .iter()
                    .map(move |v| at + DVec3::from_array(v.map(f64::from)))
                    .collect::<Vec<_>>()
            };
            let all: Vec<DVec3> = asset.links.iter().flat_map(points).collect();
            let low = all.iter().copied().reduce(DVec3::min)?;
            let high = all.iter().copied().reduce(DVec3::max)?;
            let side = (form.middle - 0.5 * (low + high)).dot(across);
            Some((across * side.signum(), 1.0))
        }
        PartClass::Lid | PartClass::Seat => Some((form.reach, settings.front.lying)),
        _ => None,
    }
}
