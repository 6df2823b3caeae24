//! Determines the closed state of parts and extends joint limits beyond the observed range.

use crate::clearance::{Pieces, deepest};
use crate::config::PhysicalConfig;
use crate::hull::{Hull, to_parry};
use artgs_core::{Asset, JointKind, Mesh, PerState, State};
use glam::DVec3;
use parry3d::query::PointQuery as _;

/// The state in which a part lies closer to its parent; none if the distances differ by less than `significant`. `part` and
/// `parent` are the surfaces in both states, in one frame. Open drawers and doors protrude.
pub(crate) fn closed_state(part: PerState<&Mesh>, parent: PerState<&Mesh>, significant: f64) -> Option<State> {
    let distances = PerState::try_from_fn(|state| protrusion(part[state], parent[state]))?;
    let (start, end) = (distances[State::START], distances[State::END]);
    if (start - end).abs() < significant {
        return None;
    }
    Some(if end < start { State::END } else { State::START })
}

/// Mean distance of the vertices of a part from the convex hull of its parent.
fn protrusion(part: &Mesh, parent: &Mesh) -> Option<f64> {
    const SAMPLE: usize = 4000;
    let sampled = |mesh: &Mesh| -> Vec<DVec3> {
        let stride = mesh.vertices.len().div_ceil(SAMPLE).max(1);
        mesh.vertices.iter().step_by(stride).map(|v| DVec3::from_array(v.map(f64::from))).collect()
    };
    let hull = Hull::of(&sampled(parent), 0.0)?;
    let points = sampled(part);
    let far = |p: &DVec3| f64::from(hull.shape().distance_to_local_point(to_parry(*p), true));
    (!points.is_empty()).then(|| points.iter().map(far).sum::<f64>() / points.len() as f64)
}

/// Reason of a joint limit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Stop {
    /// The observed value: not extended, or no extension is free.
    Observed,
    /// Contact with this link.
    Contact(String),
    /// A slide would lose its support.
    Support,
    /// The largest allowed extension.
    Reach,
}

/// Limits of one joint.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Range {
    /// Lower and upper limit.
    pub limits: [f64; 2],
    /// Reasons of both.
    pub stops: [Stop; 2],
}

/// Extends the limits of every joint from the observed values until a contact with another link, in any observed state of
/// the others, or until a slide loses its support. Entry `i` belongs to link `i`; the base has none. `pieces` must not touch
/// each other over the observed range; lengths in metres. `closed[i]` is the state in which link `i` is closed, if known;
/// its joint is at 0 there.
pub(crate) fn extend(
    asset: &Asset,
    pieces: &Pieces,
    closed: &[Option<State>],
    diagonal: f64,
    config: &PhysicalConfig,
) -> Vec<Option<Range>> {
    let range = |link: usize| {
        let joint = asset.links[link].joint?;
        let (start, end) = (joint.observed[State::START], joint.observed[State::END]);
        let observed = [start.min(end), start.max(end)];
        if !config.extend_limits {
            return Some(Range { limits: observed, stops: [Stop::Observed, Stop::Observed] });
        }
        let span = observed[1] - observed[0];
        let most = match joint.kind {
            JointKind::Prismatic => config.most_slide * span,
            JointKind::Revolute => config.most_turn.min(0.5 * (config.widest_turn - span)),
            // The length of a thread is not visible.
            JointKind::Screw => 0.0,
        };
        let mut out = Range { limits: observed, stops: [Stop::Observed, Stop::Observed] };
        for (end, sign) in [(0, -1.0), (1, 1.0)] {
            // Beyond the closed state any contact stops the joint. In the opening direction pieces may overlap by the error
            // of the decomposition before a contact counts.
            let opens = closed[link].is_some() && observed[end] != 0.0;
            let gap = config.gap_share * diagonal;
            let contact = if opens { gap + diagonal / 110.0 } else { 0.5 * gap };
            let way = sign * most.max(0.0);
            let (way, stop) = free_way(asset, pieces, link, [observed[end], way], [gap, contact], config);
            out.limits[end] = observed[end] + sign * way;
            out.stops[end] = stop;
        }
        Some(out)
    };
    (0..asset.links.len()).map(range).collect()
}

/// Free range of a joint from `from` towards `from + most`, and the reason of its end: for a contact, another link that is
/// closer than the gap by more than `contact`.
fn free_way(
    asset: &Asset,
    pieces: &Pieces,
    link: usize,
    [from, most]: [f64; 2],
    [gap, contact]: [f64; 2],
    config: &PhysicalConfig,
) -> (f64, Stop) {
    const STEPS: usize = 45;
    /// A contact is found to a thousandth of a step.
    const HALVINGS: usize = 10;
    let carried = carried(asset, link);
    let Some(joint) = asset.links[link].joint else { return (0.0, Stop::Observed) };
    let met = |way: f64| {
        State::ALL.into_iter().find_map(|state| {
            let mut values = asset.observed(state);
            values[link] = from + way;
            let (depth, [a, b]) = deepest(pieces, &asset.poses(&values), gap, |a, b| carried[a] != carried[b]);
            (depth > contact).then_some(if carried[a] { b } else { a })
        })
    };
    let mut free = 0.0;
    for step in 1..=STEPS {
        let way = most * step as f64 / STEPS as f64;
        if let Some(other) = met(way) {
            // Closer than a step; only ways that open keep a margin.
            let (mut low, mut high) = (free * most.signum(), way);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                if met(middle).is_some() { high = middle } else { low = middle }
            }
            let margin = if contact > gap { config.margin } else { 0.0 };
            return (low.abs() * (1.0 - margin), Stop::Contact(asset.links[other].name.clone()));
        }
        let leaves = joint.kind == JointKind::Prismatic && !supported(asset, pieces, link, from, from + way, config);
        if leaves {
            return (free, Stop::Support);
        }
        free = way.abs();
    }
    (free, if most == 0.0 { Stop::Observed } else { Stop::Reach })
}

/// Links that move with a joint.
fn carried(asset: &Asset, link: usize) -> Vec<bool> {
    let mut out = vec![false; asset.links.len()];
    out[link] = true;
    for i in link + 1..asset.links.len() {
        out[i] = asset.links[i].parent.is_some_and(|p| out[p]);
    }
    out
}

/// True if at least the configured share of a sliding link lies within the extent of its parent along the slide, or more
/// than at `before`.
fn supported(asset: &Asset, pieces: &Pieces, link: usize, before: f64, value: f64, config: &PhysicalConfig) -> bool {
    let (Some(parent), Some(joint)) = (asset.links[link].parent, asset.links[link].joint) else { return true };
    let (axis, shift) = (joint.axis, asset.links[link].origin - asset.links[parent].origin);
    let extent = |of: usize, offset: f64| {
        let along = pieces[of].iter().flat_map(Hull::points).map(|p| p.dot(axis) + offset);
        along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    };
    let carrier = extent(parent, 0.0);
    let held = |value: f64| {
        let own = extent(link, shift.dot(axis) + value);
        (own[1].min(carrier[1]) - own[0].max(carrier[0])) / (own[1] - own[0])
    };
    let now = held(value);
    now.is_nan() || now >= config.least_support || now > held(before)
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{AssetJoint, AssetLink};

    fn cuboid(low: [f64; 3], high: [f64; 3]) -> Hull {
        let corners: Vec<DVec3> = (0..8)
            .map(|i: usize| DVec3::from_array([0, 1, 2].map(|a| if i >> a & 1 == 0 { low[a] } else { high[a] })))
            .collect();
        Hull::of(&corners, 1e-6).unwrap()
    }

    fn movable(kind: JointKind, axis: DVec3, origin: DVec3, open: f64) -> AssetLink {
        let joint = AssetJoint {
            kind,
            axis,
            pitch: 0.0,
            limits: [0.0, open],
            observed: PerState::new(0.0, open),
            effort: 1.0,
            velocity: 1.0,
            damping: 0.0,
            friction: 0.0,
        };
        let name = format!("{kind:?}").to_lowercase();
        AssetLink { name, parent: Some(0), joint: Some(joint), origin, ..AssetLink::default() }
    }

    /// Two side walls and a back, a drawer between them, a door before its left neighbour; everything opens along -Y.
    fn cabinet() -> (Asset, Pieces) {
        let base = vec![
            cuboid([-0.5, 0.0, 0.0], [-0.45, 1.0, 1.0]),
            cuboid([0.45, 0.0, 0.0], [0.5, 1.0, 1.0]),
            cuboid([-0.45, 0.95, 0.0], [0.45, 1.0, 1.0]),
        ];
        let drawer = vec![cuboid([-0.4, 0.0, 0.0], [0.4, 0.8, 0.4])];
        let door = vec![cuboid([0.0, -0.04, 0.0], [0.9, 0.0, 0.4])];
        let links = vec![
            AssetLink { name: "base".into(), ..AssetLink::default() },
            movable(JointKind::Prismatic, DVec3::NEG_Y, DVec3::new(0.0, 0.0, 0.1), 0.5),
            movable(JointKind::Revolute, DVec3::NEG_Z, DVec3::new(-0.45, -0.01, 0.55), 1.2),
        ];
        (Asset { name: "a".into(), links }, vec![base, drawer, door])
    }

    #[test]
    fn drawers_stop_before_the_back_and_before_they_fall_out() {
        let (asset, pieces) = cabinet();
        let ranges =
            extend(&asset, &pieces, &[None, Some(State::START), Some(State::START)], 1.7, &PhysicalConfig::default());
        assert_eq!(ranges[0], None);
        let drawer = ranges[1].clone().unwrap();
        // 15 cm are free behind it, less the gap.
        assert_eq!(drawer.stops[0], Stop::Contact("base".into()));
        assert!((-0.15..-0.145).contains(&drawer.limits[0]), "{drawer:?}");
        // A quarter of 80 cm stays inside.
        assert_eq!(drawer.stops[1], Stop::Support);
        assert!((0.58..=0.6).contains(&drawer.limits[1]), "{drawer:?}");
        let door = ranges[2].clone().unwrap();
        assert_eq!(door.stops[0], Stop::Contact("base".into()));
        assert!(door.limits[0] > -0.1 && door.limits[1] > 1.2, "{door:?}");
        let fixed = PhysicalConfig { extend_limits: false, ..PhysicalConfig::default() };
        assert_eq!(
            extend(&asset, &pieces, &[None, Some(State::START), Some(State::START)], 1.7, &fixed)[1]
                .clone()
                .unwrap()
                .limits,
            [0.0, 0.5]
        );
    }

    #[test]
    fn the_closed_state_protrudes_less() {
        let base = cuboid([-0.5, 0.0, 0.0], [0.5, 1.0, 1.0]).mesh();
        let at = |y: f64| cuboid([-0.4, y, 0.0], [0.4, y + 0.8, 0.4]).mesh();
        let (shut, open) = (at(0.1), at(-0.5));
        let empty = Mesh::default();
        let closed = |start, end| closed_state(PerState::new(start, end), PerState::new(&base, &base), 0.01);
        assert_eq!(closed(&shut, &open), Some(State::START));
        assert_eq!(closed(&open, &shut), Some(State::END));
        assert_eq!(closed(&shut, &shut), None);
        assert_eq!(closed(&shut, &empty), None);
    }
}
