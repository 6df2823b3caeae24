//! Parts as a person corrects them: some added, moved, deleted or merged, joint types given.

use super::propose::Proposal;
use super::register::Searchable;
use super::{DiscoverConfig, DiscoverError, Discovery, Scene, Seen, settle};
use artgs_core::{JointKind, Rigid};
use artgs_io::{CentreEdit, Corrections};
use glam::{DVec3, Vec3};

/// Why corrections cannot be honoured.
#[derive(Debug, thiserror::Error)]
pub enum CorrectError {
    /// They name a part that is not there.
    #[error(
        "corrections.json names part {part}, but there are parts 1 to {count}; they are numbered as they were found, added ones last"
    )]
    NoSuchPart {
        /// As the file says.
        part: usize,
        /// Movable parts found or added until then.
        count: usize,
    },
    /// Nothing that moves was found where a part was added.
    #[error(
        "corrections.json adds a part at {position:?}, but no motion explains what is there; put its centre on a part that moved"
    )]
    NothingThere {
        /// As the file says.
        position: [f64; 3],
    },
    /// Nothing is left.
    #[error("corrections.json deletes every movable part")]
    NothingLeft,
    /// See there.
    #[error(transparent)]
    Discover(#[from] DiscoverError),
}

/// A part on its way through the corrections.
#[derive(Clone, Copy)]
struct Kept {
    /// Number in what was found; added ones have the next.
    number: usize,
    motion: Rigid,
}

/// What was found, corrected: edits in their order, then points are labelled and parts registered anew. Parts keep their
/// order; added ones come last. A part moved to where its points are not stands for another one there.
pub fn correct(
    scene: &Scene,
    found: &Discovery,
    corrections: &Corrections,
    config: &DiscoverConfig,
) -> Result<Discovery, CorrectError> {
    let search = scene.states.each_ref().map(|s| Searchable::new(&s.cloud));
    let seen = Seen::new(scene)?;
    let asked = |e: &CentreEdit| matches!(e, CentreEdit::Add { .. } | CentreEdit::Move { .. });
    let pool = match corrections.centres.iter().any(asked) {
        true => seen.proposals(scene, &search, found.parts.len() + 2, config),
        false => Vec::new(),
    };
    let mut kept: Vec<Kept> =
        found.parts.iter().enumerate().map(|(k, p)| Kept { number: k + 1, motion: p.motion }).collect();
    // Parts found and added so far.
    let mut count = found.parts.len();
    let known = |part: usize, count: usize| {
        if part <= count { Ok(part) } else { Err(CorrectError::NoSuchPart { part, count }) }
    };
    for edit in &corrections.centres {
        match *edit {
            CentreEdit::Delete { part } | CentreEdit::Merge { part, .. } => {
                let gone = known(part, count)?;
                if let CentreEdit::Merge { into, .. } = *edit {
                    known(into, count)?;
                }
                kept.retain(|k| k.number != gone);
            }
            CentreEdit::Add { position } => {
                let motion = motion_at(scene, &pool, position, &kept)?;
                count += 1;
                kept.push(Kept { number: count, motion });
            }
            CentreEdit::Move { part, position } => {
                let part = known(part, count)?;
                if part > found.parts.len() || !stands_at(found, part, position) {
                    let others: Vec<Kept> = kept.iter().copied().filter(|k| k.number != part).collect();
                    let motion = motion_at(scene, &pool, position, &others)?;
                    kept.iter_mut().filter(|k| k.number == part).for_each(|k| k.motion = motion);
                }
            }
        }
    }
    if kept.is_empty() {
        return Err(CorrectError::NothingLeft);
    }
    for mark in &corrections.joints {
        known(mark.part, count)?;
    }
    let kind = |k: &Kept| corrections.joints.iter().find(|mark| mark.part == k.number).map(|mark| mark.kind);
    let kinds: Vec<Option<JointKind>> = kept.iter().map(kind).collect();
    let motions: Vec<Rigid> = kept.iter().map(|k| k.motion).collect();
    let (parts, labels) = settle(scene, &search, &seen.at_rest, &motions, &kinds, config);
    Ok(seen.told(scene, parts, labels, Vec::new()))
}

/// True if a position is among a part's points at the start, or no farther from them than a tenth of the diagonal.
fn stands_at(found: &Discovery, part: usize, position: [f64; 3]) -> bool {
    let at = DVec3::from_array(position).as_vec3();
    let own = found.clouds[0].points.iter().zip(&found.labels[0]).filter(|(_, label)| usize::from(**label) == part);
    own.map(|(p, _)| p.distance(at)).fold(f32::INFINITY, f32::min) < 0.1 * found.diagonal as f32
}

/// The candidate that explains most of what moved around a position, other than the motions of `taken` parts.
fn motion_at(scene: &Scene, pool: &[Proposal], position: [f64; 3], taken: &[Kept]) -> Result<Rigid, CorrectError> {
    let at = DVec3::from_array(position).as_vec3();
    let reach = 0.12 * scene.scales.diagonal;
    let clouds = scene.states.each_ref().map(|s| &s.cloud);
    // At the end the part is where the candidate takes the position.
    let weight = |p: &Proposal| -> f32 {
        let there = p.motion.apply(at.as_dvec3()).as_vec3();
        let near = |s: usize, centre: Vec3| -> f32 {
            let distances = p.explained[s].iter().map(|&i| clouds[s].points[i].distance(centre));
            distances.map(|d| (-0.5 * (d / reach) * (d / reach)).exp()).sum()
        };
        (near(0, at) + near(1, there)) * (1.0 - p.effort)
    };
    let alike = |p: &Proposal| {
        let gap = |k: &Kept, x: Vec3| k.motion.apply(x.as_dvec3()).distance(p.motion.apply(x.as_dvec3()));
        let around = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|d| at + d * reach);
        taken.iter().any(|k| around.iter().all(|x| gap(k, *x) < f64::from(2.0 * scene.scales.spacing)))
    };
    let best = pool.iter().filter(|p| !alike(p)).map(|p| (weight(p), p)).max_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|b| b.0 > 12.0).map(|b| b.1.motion).ok_or(CorrectError::NothingThere { position })
}
