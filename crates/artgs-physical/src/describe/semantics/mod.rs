//! What the links of an asset are, in which direction the object faces, and where a gripper holds its parts.

mod classes;
mod form;
mod front;
mod handles;
mod names;
#[cfg(test)]
mod tests;

pub(crate) use front::front;
pub(crate) use handles::handles;
pub(crate) use names::names;

use crate::settings::{DescribeSettings, GivenClass};
use artgs_core::{Asset, PartClass, PartSemantics, Rigid, State};
use classes::Place;
use form::{Form, Sample, samples};
use glam::DVec3;

/// Classes of all links, by visual meshes and joints at value 0; +Z is up, the front may be anywhere. `closed_known[i]` says
/// whether joint value 0 of link `i` is its closed state. Classes that are `given` replace those found.
pub(crate) fn classes(
    asset: &Asset,
    closed_known: &[bool],
    given: &[GivenClass],
    settings: &DescribeSettings,
) -> Vec<PartSemantics> {
    let diagonal = asset.bounds_diagonal();
    let surface = |i: usize| {
        let link = &asset.links[i];
        samples(&link.visual.mesh, &Rigid::shift(link.origin), settings.spacing_share * diagonal)
    };
    let surfaces: Vec<Vec<Sample>> = (0..asset.links.len()).map(surface).collect();
    let of = |(i, link): (usize, &artgs_core::AssetLink)| {
        let unknown = PartSemantics { class: PartClass::Part, hinge: None, confidence: 0.0, given: false };
        let Some(parent) = link.parent else {
            return PartSemantics { class: PartClass::Body, confidence: 1.0, ..unknown };
        };
        let Some(form) = Form::of(link, diagonal, settings) else { return unknown };
        let carrier = &surfaces[parent];
        let joint = link.joint.as_ref();
        // Carrier and part move against each other only by this joint, so the carrier is moved instead of the part.
        let seen = State::ALL.map(|state| {
            let motion = joint.map_or(Rigid::IDENTITY, |j| j.motion(j.observed[state])).inverse();
            let about = Rigid::shift(link.origin) * motion * Rigid::shift(-link.origin);
            carrier.iter().map(|s| about.apply(s.at)).collect::<Vec<DVec3>>()
        });
        let closed_known = closed_known.get(i).copied().unwrap_or(false);
        let found = classes::class(&form, &Place { carrier, carrier_seen: seen, diagonal, closed_known, settings });
        match given.iter().find(|g| g.part == i) {
            Some(given) => classes::given(&form, given.class, settings.upright),
            None => found,
        }
    };
    asset.links.iter().enumerate().map(of).collect()
}
