//! Puts fingers into the gaps between handles and what they are fixed to: no hull may be there.

use crate::CheckOptions;
use crate::drawn::Drawn;
use crate::model::Model;
use crate::poses::{Scene, signed};
use crate::report::FingerFinding;
use artgs_core::Rigid;
use artgs_io::export_report::HandleReport;
use glam::{DQuat, DVec3};
use rapier3d::prelude::SharedShape;

/// Radius of a finger.
const RADIUS: f64 = 5e-3;
/// Half of its length in the gap, without the round ends.
const HALF: f64 = 5e-3;
/// Least gap between handle and surface that has to hold a finger.
const GAP: f64 = 0.015;
/// Farthest way behind the front of a handle at which a gap is looked for.
const REACH: f64 = 0.15;
/// Step of that search.
const STEP: f64 = 5e-4;
/// Free way to a gap, from above or below the handle: what is enclosed by a mesh is no gap.
const ENTRY: f64 = 0.05;
/// Places along a handle, as shares of its length.
const PLACES: [f64; 5] = [-0.3, -0.15, 0.0, 0.15, 0.3];

/// Puts a finger into every gap behind the handles of a link, joints at 0; none if it has no gaps that the visual meshes of all links
/// (`all`) leave free.
pub(crate) fn link(
    model: &Model,
    scene: &Scene,
    index: usize,
    all: &[Option<Drawn>],
    handles: &[HandleReport],
    options: &CheckOptions,
) -> Option<FingerFinding> {
    let link = &model.links[index];
    let drawn = all[index].as_ref()?;
    let mut out = FingerFinding { link: link.name.clone(), ..FingerFinding::default() };
    let poses = model.poses(&vec![0.0; model.links.len()]);
    for handle in handles {
        let frame = Rigid {
            rotation: DQuat::from_array(handle.orientation).normalize(),
            translation: DVec3::from_array(handle.position),
        };
        for place in PLACES {
            let at = frame * Rigid::shift(DVec3::X * (place * handle.length));
            let Some(gap) = gap(drawn, &at) else { continue };
            let own = at * Rigid::shift(DVec3::Z * gap);
            if ![DVec3::Y, DVec3::NEG_Y].iter().any(|side| drawn.ray(own.translation, own.turn(*side), ENTRY).is_none())
            {
                continue;
            }
            let finger = poses[index] * own;
            if !is_free(all, &poses, &finger) {
                continue;
            }
            out.gaps += 1;
            let depth = deepest(scene, &poses, &finger);
            out.deepest = out.deepest.max(depth);
            out.blocked += usize::from(depth > options.touch);
        }
    }
    if out.blocked > 0 {
        let (blocked, gaps, mm) = (out.blocked, out.gaps, 1e3 * out.deepest);
        let text = "places behind handles hold no finger of 10 mm, hulls are up to";
        let list = if 2 * blocked > gaps { &mut out.problems } else { &mut out.warnings };
        list.push(format!("{blocked} of {gaps} {text} {mm:.1} mm in the way"));
    }
    (out.gaps > 0).then_some(out)
}

/// The middle of the gap behind a handle, along the direction of approach of its grasp frame; none if it is narrower than [`GAP`].
fn gap(drawn: &Drawn, grasp: &Rigid) -> Option<f64> {
    let along = |z: f64| drawn.signed(grasp.apply(DVec3::Z * z));
    // The origin is half as deep as the handle; it can be in front of a curved bar or behind it.
    let steps = (REACH / STEP) as usize;
    let values: Vec<f64> = (0..2 * steps).map(|i| along((i as f64 - steps as f64) * STEP)).collect();
    let enters = |from: usize, solid: bool| (from..values.len()).find(|i| (values[*i] < 0.0) == solid);
    let exit = enters(enters(0, true)?, false)?;
    let end = enters(exit, true)?;
    let z = |i: usize| (i as f64 - steps as f64) * STEP;
    ((end - exit) as f64 * STEP >= GAP).then(|| 0.5 * (z(exit) + z(end)))
}

/// True if no link is drawn where the finger is, which lies along Y of a pose in the object's frame.
fn is_free(drawn: &[Option<Drawn>], poses: &[Rigid], finger: &Rigid) -> bool {
    let free = |p: DVec3| {
        let far = |(drawn, at): (&Option<Drawn>, &Rigid)| {
            drawn.as_ref().is_none_or(|drawn| drawn.signed(at.inverse().apply(p)) > RADIUS)
        };
        drawn.iter().zip(poses).all(far)
    };
    [-1.0, -0.5, 0.0, 0.5, 1.0].iter().all(|share| free(finger.apply(DVec3::Y * (share * HALF))))
}

/// How deep hulls reach into a finger at a pose in the object's frame.
fn deepest(scene: &Scene, poses: &[Rigid], finger: &Rigid) -> f64 {
    /// Balls along the finger.
    const BALLS: usize = 9;
    let balls = (0..BALLS).map(|i| DVec3::Y * HALF * (2.0 * i as f64 / (BALLS - 1) as f64 - 1.0));
    let middles: Vec<DVec3> = balls.map(|p| finger.apply(p)).collect();
    let of_link = |(hulls, link): (&Vec<SharedShape>, &Rigid)| {
        let to_link = link.inverse();
        let own: Vec<DVec3> = middles.iter().map(|p| to_link.apply(*p)).collect();
        let near = |hull: &SharedShape| own.iter().map(|p| signed(hull, *p)).fold(f64::INFINITY, f64::min);
        hulls.iter().map(near).fold(f64::INFINITY, f64::min)
    };
    RADIUS - scene.hulls.iter().zip(poses).map(of_link).fold(RADIUS, f64::min)
}

#[cfg(test)]
#[path = "finger_tests.rs"]
mod tests;
