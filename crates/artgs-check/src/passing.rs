//! Places of a link through which another one passes: no hull can be there.

use crate::coverage::Drawn;
use crate::model::Model;
use artgs_core::Rigid;
use glam::DVec3;

/// Joint values of a joint at which places are tested.
const STOPS: usize = 48;

/// The visual meshes of the links that a link carries, and of its carrier, at all joint values of the joints between them.
pub(crate) struct Passing<'a> {
    /// Each with the motions from the frame of the link to that of the other one.
    others: Vec<(&'a Drawn, Vec<Rigid>)>,
}

impl<'a> Passing<'a> {
    /// What passes a link of the model, of which `drawn` are the visual meshes.
    pub(crate) fn of(model: &Model, drawn: &'a [Option<Drawn>], link: usize) -> Self {
        let links = &model.links;
        let pairs = (0..links.len()).filter_map(|child| {
            let parent = links[child].parent?;
            let other = if child == link { parent } else { child };
            ((child == link || parent == link) && links[child].motion.is_some()).then_some((parent, child, other))
        });
        let others = pairs.filter_map(|(parent, child, other)| {
            let motion = links[child].motion.as_ref()?;
            let [low, high] = motion.limits;
            let from_child = |k: usize| {
                let value = low + (high - low) * k as f64 / (STOPS - 1) as f64;
                links[parent].pose.inverse() * links[child].pose * motion.motion(value)
            };
            let to_other = |k: usize| if other == parent { from_child(k) } else { from_child(k).inverse() };
            let is_finite = low.is_finite() && high.is_finite();
            Some((drawn[other].as_ref()?, (0..if is_finite { STOPS } else { 0 }).map(to_other).collect()))
        });
        Self { others: others.collect() }
    }

    /// True if a point, link frame, is inside of another link at some joint value.
    pub(crate) fn holds(&self, p: DVec3) -> bool {
        self.others.iter().any(|(drawn, motions)| motions.iter().any(|motion| drawn.holds(motion.apply(p))))
    }
}
