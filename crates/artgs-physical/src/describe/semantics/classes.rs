//! The class of a part: decisions by joint, shape and place, each with its distance from the limit between two classes.
//!
//! The limits are shares of lengths of the part or the object. They separate what the classes mean, and were set on the
//! ground truth of the procedural objects (`artgs synth --list`), not on reconstructions.

use super::form::{Form, Sample, covered, span};
use artgs_core::{HingeSide, JointKind, PartClass, PartSemantics};
use glam::DVec3;

/// Cosine of the angle to the vertical above which an axis or a normal is upright.
const UPRIGHT: f64 = 0.7;
/// A panel is thinner than this share of its smaller side.
const PANEL: f64 = 0.5;
/// A long part is longer than this multiple of its next extent.
const LONG: f64 = 2.5;
/// A part whose middle is nearer to the axis than this share of its radius turns about its middle.
const CENTRED: f64 = 0.3;
/// Least ratio of the extents across the axis of a round part.
const ROUND: f64 = 0.6;
/// Largest radius of a knob, and largest extent of a button, as shares of the object's diagonal.
const SMALL: f64 = 0.08;
/// Share of its travel that a drawer sticks out of the part that carries it at least.
const STICKS_OUT: f64 = 0.5;
/// A lid or a flap has a surface of the part that carries it behind more than this share of it, in one state.
const COVERED: f64 = 0.6;

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
}

/// Decisions so far, by the margin of the closest one.
struct Margin(f64);

impl Margin {
    /// True if `value` is above `limit`, both positive. Factors of two are far from it.
    fn above(&mut self, value: f64, limit: f64) -> bool {
        self.0 = self.0.min((value.max(1e-9) / limit).log2().abs());
        value > limit
    }

    /// True if a cosine is above `limit`. A difference of 0.3 is far from it.
    fn aligned(&mut self, cosine: f64, limit: f64) -> bool {
        self.0 = self.0.min((cosine.abs() - limit).abs() / 0.3);
        cosine.abs() > limit
    }

    fn of(self, class: PartClass, hinge: Option<HingeSide>, place: &Place) -> PartSemantics {
        /// Without a closed state, the side to which a part opens is a guess.
        const GUESS: f64 = 0.8;
        let known = if place.closed_known { 1.0 } else { GUESS };
        PartSemantics { class, hinge, confidence: known * (0.5 + 0.5 * self.0.min(1.0)), given: false }
    }
}

/// The class of a part.
pub(crate) fn class(form: &Form, place: &Place) -> PartSemantics {
    match form.kind {
        JointKind::Screw => Margin(1.0).of(PartClass::Cap, None, place),
        JointKind::Prismatic => slides(form, place),
        JointKind::Revolute => turns(form, place),
    }
}

fn slides(form: &Form, place: &Place) -> PartSemantics {
    let mut margin = Margin(1.0);
    let [along, tall, wide] = form.extent;
    let largest = along.max(tall).max(wide);
    let small = SMALL * place.diagonal;
    if largest < small && form.travel < 0.5 * small {
        margin.above(largest, small);
        return margin.of(PartClass::Button, None, place);
    }
    if margin.aligned(form.axis.z, UPRIGHT) {
        return margin.of(PartClass::Slider, None, place);
    }
    // What is thinnest across its way and stays within the carrier is no drawer. A handle makes a sheet thick.
    let thinnest = along.min(tall);
    if wide < thinnest && !margin.above(sticks_out(form, place), STICKS_OUT) {
        margin.above(thinnest / wide.max(1e-12), 1.0);
        return margin.of(PartClass::SlidingDoor, None, place);
    }
    let long = margin.above(along / tall.max(wide), LONG);
    margin.of(if long { PartClass::Slider } else { PartClass::Drawer }, None, place)
}

/// How far a sliding part reaches beyond its carrier where it is open, as a share of its travel, at the end that comes out.
fn sticks_out(form: &Form, place: &Place) -> f64 {
    let (Some([_, out]), Some([_, edge])) = (span(&form.surface, form.axis), span(place.carrier, form.axis)) else {
        return 1.0;
    };
    (out + form.travel - edge) / form.travel.max(1e-9)
}

fn turns(form: &Form, place: &Place) -> PartSemantics {
    let mut margin = Margin(1.0);
    let [along, reach, across] = form.extent;
    let [long, short] = form.across;
    let round = short / long.max(1e-12);
    if !margin.above(form.offset, CENTRED) && margin.above(round, ROUND) {
        let large = margin.above(form.radius, SMALL * place.diagonal);
        return margin.of(if large { PartClass::Wheel } else { PartClass::Knob }, None, place);
    }
    let mut extents = [along, long, short];
    extents.sort_by(f64::total_cmp);
    let panel = margin.above(PANEL, across / along.min(reach).max(1e-12));
    let upright_hinge = margin.aligned(form.axis.z, UPRIGHT);
    // Long along the axis: a narrow door. Long away from it: an arm.
    let arm =
        !panel && margin.above(extents[2] / extents[1].max(1e-12), LONG) || !upright_hinge && reach > LONG * along;
    if arm {
        return margin.of(PartClass::Arm, None, place);
    }
    if upright_hinge {
        return margin.of(PartClass::Door, Some(side(form)), place);
    }
    let cover = [0, 1].map(|state| covered(&form.surface, form.opens, &place.carrier_seen[state], reach));
    if is_seat(form, place) && !margin.above(cover[0].max(cover[1]), COVERED) {
        return margin.of(PartClass::Seat, None, place);
    }
    if margin.aligned(form.opens.z, UPRIGHT) {
        return margin.of(PartClass::Lid, None, place);
    }
    margin.of(PartClass::Flap, Some(side(form)), place)
}

/// The edge of a panel at which its hinge is, seen from the side to which it opens, with up upwards.
fn side(form: &Form) -> HingeSide {
    let right = DVec3::Z.cross(form.opens);
    let (across, up) = (form.reach.dot(right), form.reach.z);
    match (form.axis.z.abs() > UPRIGHT, across > 0.0, up > 0.0) {
        (true, true, _) => HingeSide::Left,
        (true, false, _) => HingeSide::Right,
        (false, _, true) => HingeSide::Bottom,
        (false, _, false) => HingeSide::Top,
    }
}

/// What a person said that a part is.
pub(crate) fn given(form: &Form, class: PartClass) -> PartSemantics {
    let is_hinged = form.kind == JointKind::Revolute && matches!(class, PartClass::Door | PartClass::Flap);
    PartSemantics { class, hinge: is_hinged.then(|| side(form)), confidence: 1.0, given: true }
}

/// True if the carrier rises above the hinge by as much as the part reaches, and goes as far down.
fn is_seat(form: &Form, place: &Place) -> bool {
    let hinge = form.middle - form.reach * 0.5 * form.extent[1];
    let Some([low, high]) = span(place.carrier, DVec3::Z) else { return false };
    let least = 0.5 * form.extent[1];
    high - hinge.z > least && hinge.z - low > least
}
