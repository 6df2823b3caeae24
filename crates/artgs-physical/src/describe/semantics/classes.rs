//! The class of a part: decisions by joint, shape and place, each with its distance from the limit between two classes.

use super::form::{Form, Sample, covered, span};
use crate::settings::{ClassSettings, DescribeSettings};
use artgs_core::{HingeSide, JointKind, PartClass, PartSemantics};
use glam::DVec3;

/// Length or ratio that guards a division.
const TINY: f64 = 1e-12;
/// The same in a logarithm, and of ways.
const SMALL: f64 = 1e-9;

/// What surrounds a part.
pub(crate) struct Place<'a> {
    /// Surface of the part that carries it, object's frame, zero pose.
    pub carrier: &'a [Sample],
    /// The same surface as seen from the part, moved into the object's frame, in both observed states.
    pub carrier_seen: [Vec<DVec3>; 2],
    /// Diagonal of the object's box.
    pub diagonal: f64,
    /// True if it is known in which state the part is closed.
    pub closed_known: bool,
    /// Limits between classes.
    pub settings: &'a DescribeSettings,
}

/// Decisions so far, by the margin of the closest one.
struct Margin<'a> {
    least: f64,
    settings: &'a DescribeSettings,
}

impl<'a> Margin<'a> {
    /// Nothing is decided.
    fn new(place: &Place<'a>) -> Self {
        Self { least: 1.0, settings: place.settings }
    }

    /// True if `value` is above `limit`, both positive. Factors of two are far from it.
    fn above(&mut self, value: f64, limit: f64) -> bool {
        self.least = self.least.min((value.max(SMALL) / limit).log2().abs());
        value > limit
    }

    /// True if a cosine is above `limit`.
    fn aligned(&mut self, cosine: f64, limit: f64) -> bool {
        let far = self.settings.classes.far;
        self.least = self.least.min((cosine.abs() - limit).abs() / far);
        cosine.abs() > limit
    }

    fn of(self, class: PartClass, hinge: Option<HingeSide>, place: &Place) -> PartSemantics {
        let ClassSettings { guess, least_confidence: at_limit, .. } = self.settings.classes;
        let known = if place.closed_known { 1.0 } else { guess };
        let confidence = known * (at_limit + (1.0 - at_limit) * self.least.min(1.0));
        PartSemantics { class, hinge, confidence, given: false }
    }
}

/// The class of a part.
pub(crate) fn class(form: &Form, place: &Place) -> PartSemantics {
    match form.kind {
        JointKind::Screw => Margin::new(place).of(PartClass::Cap, None, place),
        JointKind::Prismatic => slides(form, place),
        JointKind::Revolute => turns(form, place),
    }
}

fn slides(form: &Form, place: &Place) -> PartSemantics {
    let (mut margin, settings) = (Margin::new(place), &place.settings.classes);
    let [along, tall, wide] = form.extent;
    let largest = along.max(tall).max(wide);
    let small = settings.small_share * place.diagonal;
    if largest < small && form.travel < settings.pressed * small {
        margin.above(largest, small);
        return margin.of(PartClass::Button, None, place);
    }
    if margin.aligned(form.axis.z, place.settings.upright) {
        return margin.of(PartClass::Slider, None, place);
    }
    // What is thinnest across its way and stays within the carrier is no drawer. A handle makes a sheet thick.
    let thinnest = along.min(tall);
    if wide < thinnest && !margin.above(sticks_out(form, place), settings.sticks_out) {
        margin.above(thinnest / wide.max(TINY), 1.0);
        return margin.of(PartClass::SlidingDoor, None, place);
    }
    let long = margin.above(along / tall.max(wide), settings.long);
    margin.of(if long { PartClass::Slider } else { PartClass::Drawer }, None, place)
}

/// How far a sliding part reaches beyond its carrier where it is open, as a share of its travel, at the end that comes out.
fn sticks_out(form: &Form, place: &Place) -> f64 {
    let end = |surface: &[Sample]| span(surface, form.axis, place.settings.beyond);
    let (Some([_, out]), Some([_, edge])) = (end(&form.surface), end(place.carrier)) else { return 1.0 };
    (out + form.travel - edge) / form.travel.max(SMALL)
}

fn turns(form: &Form, place: &Place) -> PartSemantics {
    let (mut margin, settings) = (Margin::new(place), &place.settings.classes);
    let [along, reach, across] = form.extent;
    let [long, short] = form.across;
    let round = short / long.max(TINY);
    if !margin.above(form.offset, settings.centred) && margin.above(round, settings.round) {
        let large = margin.above(form.radius, settings.small_share * place.diagonal);
        return margin.of(if large { PartClass::Wheel } else { PartClass::Knob }, None, place);
    }
    let mut extents = [along, long, short];
    extents.sort_by(f64::total_cmp);
    let panel = margin.above(settings.panel, across / along.min(reach).max(TINY));
    let upright_hinge = margin.aligned(form.axis.z, place.settings.upright);
    // Long along the axis: a narrow door. Long away from it: an arm.
    let is_long = |margin: &mut Margin| margin.above(extents[2] / extents[1].max(TINY), settings.long);
    let arm = !panel && is_long(&mut margin) || !upright_hinge && reach > settings.long * along;
    if arm {
        return margin.of(PartClass::Arm, None, place);
    }
    if upright_hinge {
        return margin.of(PartClass::Door, Some(side(form, place.settings.upright)), place);
    }
    let cover = [0, 1]
        .map(|state| covered(&form.surface, form.opens, &place.carrier_seen[state], reach, place.settings.beyond));
    if is_seat(form, place) && !margin.above(cover[0].max(cover[1]), settings.covered) {
        return margin.of(PartClass::Seat, None, place);
    }
    if margin.aligned(form.opens.z, place.settings.upright) {
        return margin.of(PartClass::Lid, None, place);
    }
    margin.of(PartClass::Flap, Some(side(form, place.settings.upright)), place)
}

/// The edge of a panel at which its hinge is, seen from the side to which it opens, with up upwards; `upright`: cosine above which an axis is.
fn side(form: &Form, upright: f64) -> HingeSide {
    let right = DVec3::Z.cross(form.opens);
    let (across, up) = (form.reach.dot(right), form.reach.z);
    match (form.axis.z.abs() > upright, across > 0.0, up > 0.0) {
        (true, true, _) => HingeSide::Left,
        (true, false, _) => HingeSide::Right,
        (false, _, true) => HingeSide::Bottom,
        (false, _, false) => HingeSide::Top,
    }
}

/// What a person said that a part is.
pub(crate) fn given(form: &Form, class: PartClass, upright: f64) -> PartSemantics {
    let is_hinged = form.kind == JointKind::Revolute && matches!(class, PartClass::Door | PartClass::Flap);
    PartSemantics { class, hinge: is_hinged.then(|| side(form, upright)), confidence: 1.0, given: true }
}

/// True if the carrier rises above the hinge by much of what the part reaches, and goes as far down.
fn is_seat(form: &Form, place: &Place) -> bool {
    let hinge = form.middle - form.reach * 0.5 * form.extent[1];
    let Some([low, high]) = span(place.carrier, DVec3::Z, place.settings.beyond) else { return false };
    let least = place.settings.classes.backrest * form.extent[1];
    high - hinge.z > least && hinge.z - low > least
}
