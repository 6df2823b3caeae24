//! What the views of an object cannot decide.

use super::clearance::gap;
use crate::Object;
use crate::material::Material;
use artgs_core::{JointKind, Rigid, State};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Motions count as equal if they move no point of either part to places farther apart than this, metres.
const SAME_PLACE: f64 = 0.001;
/// Depth pixels of all views of a state, from which on a part counts as seen.
pub(super) const SEEN: usize = 30;

/// Why views allow another answer than the truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// Bodies that touch have the same motion: they look like one part.
    EqualMotion,
    /// No view of one state shows the part.
    Unseen,
    /// The part looks the same before and after its turn.
    Revolution,
}

/// Parts of which the views allow another answer than the truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Undecidable {
    /// Indices of the parts in the object, 1 or more.
    pub parts: Vec<usize>,
    /// Why.
    pub reason: Reason,
    /// The same in a sentence.
    pub why: String,
}

/// What follows from the geometry alone. `pixel` is the width of a pixel at the object, metres: narrower gaps are not seen.
pub(super) fn of_geometry(object: &Object, pixel: f64) -> Vec<Undecidable> {
    let mut found = equal_motions(object, pixel);
    found.extend((1..object.parts.len()).filter(|&part| is_revolution(object, part, pixel)).map(|part| Undecidable {
        parts: vec![part],
        reason: Reason::Revolution,
        why: format!("{} looks the same after its turn", object.parts[part].name),
    }));
    found
}

/// Parts that a state shows on fewer than [`SEEN`] pixels; `pixels` holds the number for every state and part.
pub(super) fn of_views(object: &Object, pixels: &[Vec<usize>]) -> Vec<Undecidable> {
    let hidden = |part: &usize| pixels.iter().any(|of_state| of_state[*part] < SEEN);
    let unseen = (1..object.parts.len()).filter(hidden).map(|part| Undecidable {
        parts: vec![part],
        reason: Reason::Unseen,
        why: format!("no view of one state shows {}", object.parts[part].name),
    });
    unseen.collect()
}

fn equal_motions(object: &Object, pixel: f64) -> Vec<Undecidable> {
    let count = object.parts.len();
    let pairs = (1..count).flat_map(|a| (a + 1..count).map(move |b| [a, b]));
    let touch = |[a, b]: [usize; 2]| {
        let points = |part: usize| {
            let pose = object.pose(part, State::START);
            object.parts[part].points().map(move |p| pose.apply(p))
        };
        gap(points(a), points(b)).is_some_and(|gap| gap < 1.5 * pixel)
    };
    let equal = pairs.filter(|&[a, b]| moves_equally(object, a, b) && touch([a, b]));
    let found = equal.map(|[a, b]| Undecidable {
        parts: vec![a, b],
        reason: Reason::EqualMotion,
        why: format!("{} and {} touch and have the same motion", object.parts[a].name, object.parts[b].name),
    });
    found.collect()
}

fn moves_equally(object: &Object, a: usize, b: usize) -> bool {
    let motions = [a, b].map(|part| object.start_to_end(part));
    let differs = |part: usize| {
        let pose = object.pose(part, State::START);
        object.parts[part].points().any(|p| {
            let p = pose.apply(p);
            motions[0].apply(p).distance(motions[1].apply(p)) > SAME_PLACE
        })
    };
    !differs(a) && !differs(b)
}

/// True if a turn of a part about its axis, by as much as it turns between the states, maps its surface onto itself, and its
/// colours do not show the turn.
fn is_revolution(object: &Object, part: usize, pixel: f64) -> bool {
    let Some(joint) = object.parts[part].joint.filter(|j| j.kind != JointKind::Prismatic) else { return false };
    let plain = object.parts[part].pieces.iter().all(|p| is_even(&p.material, 2.0 * pixel / object.scale));
    // What it carries shows the turn.
    let carries = object.parts.iter().any(|other| other.parent == Some(part));
    if !plain || carries {
        return false;
    }
    let values = joint.state_values;
    let turn = Rigid::about(joint.axis, joint.origin, values[State::END] - values[State::START]);
    let points: Vec<DVec3> = object.parts[part].points().collect();
    let farthest = |p: &DVec3| distance_to(turn.apply(*p), &points);
    points.iter().all(|p| farthest(p) < 0.5 * pixel)
}

/// True if a material has no pattern, or one finer than `finest` (the unit of materials), which photos do not resolve.
fn is_even(material: &Material, finest: f64) -> bool {
    match material {
        Material::Plain { .. } => true,
        Material::Wood { period, .. } | Material::Brushed { period, .. } => *period < finest,
        Material::Checks { cell: size, .. }
        | Material::Speckle { size, .. }
        | Material::Stripes { width: size, .. } => *size < finest,
    }
}

/// Distance of a point from the nearest of some triangles.
fn distance_to(p: DVec3, corners: &[DVec3]) -> f64 {
    let to_triangle = |t: &[DVec3]| {
        let (a, b, c) = (t[0], t[1], t[2]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let inside = [(a, b), (b, c), (c, a)].iter().all(|(s, e)| (e - s).cross(p - s).dot(normal) >= 0.0);
        if inside && normal != DVec3::ZERO {
            return (p - a).dot(normal).abs();
        }
        let to_edge = |(s, e): &(DVec3, DVec3)| {
            let along = ((p - s).dot(e - s) / (e - s).length_squared().max(1e-18)).clamp(0.0, 1.0);
            p.distance(s.lerp(*e, along))
        };
        [(a, b), (b, c), (c, a)].iter().map(to_edge).fold(f64::INFINITY, f64::min)
    };
    corners.chunks_exact(3).map(to_triangle).fold(f64::INFINITY, f64::min)
}
