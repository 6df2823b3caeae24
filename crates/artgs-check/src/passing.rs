//! Places of a link through which another one passes: no hull can be there.

use crate::drawn::Drawn;
use crate::model::{Link, Model, bounds};
use artgs_core::{Rigid, State};
use glam::DVec3;

/// Joint values of a joint at which places are tested.
const STOPS: usize = 48;
/// Distance that hulls of different links keep, metres, ...
const GAP: f64 = 2.5e-3;
/// ... as a share of the object's diagonal at most.
const GAP_SHARE: f64 = 2e-3;

/// The visual meshes of the other links, wherever one joint takes them past a link while the other joints are at zero, and in both
/// observed states: poses in which the export keeps links apart.
pub(crate) struct Passing<'a> {
    /// Each with the motions from the frame of the link to that of the other one.
    others: Vec<(&'a Drawn, Vec<Rigid>)>,
    /// Points this near to another link are passed as well.
    near: f64,
}

impl<'a> Passing<'a> {
    /// What passes a link of the model, of which `drawn` are the visual meshes.
    pub(crate) fn of(model: &Model, drawn: &'a [Option<Drawn>], link: usize) -> Self {
        let zero = vec![0.0; model.links.len()];
        let poses = stances(model);
        let passes = |other: usize| {
            let drawn = drawn[other].as_ref().filter(|_| other != link)?;
            let moved = |joint: &Option<usize>| {
                joint.is_none_or(|joint| {
                    let carried = model.carried(joint);
                    carried[other] != carried[link]
                })
            };
            let relative = |poses: &Vec<Rigid>| poses[other].inverse() * poses[link];
            let all = poses.iter().filter(|(joint, _)| moved(joint)).map(|(_, poses)| relative(poses));
            Some((drawn, all.chain([relative(&model.poses(&zero))]).collect()))
        };
        let boxes = model.links.iter().filter_map(|link| link.bounds(&link.visuals));
        let object = bounds(boxes.flatten());
        let near = object.map_or(0.0, |[low, high]| GAP.min(GAP_SHARE * (high - low).length()));
        Self { others: (0..model.links.len()).filter_map(passes).collect(), near }
    }

    /// True if a point, link frame, is inside of another link, or within the gap before it, at some joint value.
    pub(crate) fn holds(&self, p: DVec3) -> bool {
        self.others.iter().any(|(drawn, motions)| motions.iter().any(|motion| drawn.holds(motion.apply(p), self.near)))
    }
}

/// Link frames at the stops of each joint with finite limits while the others are at zero, with the joint, and in the observed states.
fn stances(model: &Model) -> Vec<(Option<usize>, Vec<Rigid>)> {
    let values = |joint: usize, [low, high]: [f64; 2]| {
        (0..STOPS).map(move |k| (joint, low + (high - low) * k as f64 / (STOPS - 1) as f64))
    };
    let joints = model.links.iter().enumerate().filter_map(|(i, link)| {
        let limits = link.motion.as_ref()?.limits;
        limits.iter().all(|limit| limit.is_finite()).then(|| values(i, limits))
    });
    let alone = joints.flatten().map(|(joint, value)| {
        let mut values = vec![0.0; model.links.len()];
        values[joint] = value;
        (Some(joint), model.poses(&values))
    });
    let seen = State::ALL.iter().map(|state| {
        let value = |link: &Link| link.motion.as_ref().and_then(|m| m.observed.as_ref()).map_or(0.0, |v| v[*state]);
        (None, model.poses(&model.links.iter().map(value).collect::<Vec<f64>>()))
    });
    alone.chain(seen).collect()
}
