//! The state in which a part is nearer to being closed.

use crate::geometry::hull::Hull;
use artgs_core::{Mesh, PerState, State};
use glam::DVec3;

/// The state in which a part lies closer to its parent, nearer to being closed; none if the distances differ by less than
/// `significant`. `part` and `parent` are the surfaces in both states, in one frame; about `count` vertices of each are compared. Open
/// drawers and doors protrude.
pub(crate) fn nearer_state(
    part: PerState<&Mesh>,
    parent: PerState<&Mesh>,
    significant: f64,
    count: usize,
) -> Option<State> {
    let distances = PerState::try_from_fn(|state| protrusion(part[state], parent[state], count))?;
    let (start, end) = (distances[State::START], distances[State::END]);
    if (start - end).abs() < significant {
        return None;
    }
    Some(if end < start { State::END } else { State::START })
}

/// Mean distance of the vertices of a part from the convex hull of its parent.
fn protrusion(part: &Mesh, parent: &Mesh, count: usize) -> Option<f64> {
    let sampled = |mesh: &Mesh| -> Vec<DVec3> {
        let stride = mesh.vertices.len().div_ceil(count).max(1);
        mesh.vertices.iter().step_by(stride).map(|v| DVec3::from_array(v.map(f64::from))).collect()
    };
    let hull = Hull::of(&sampled(parent), 0.0)?;
    let points = sampled(part);
    let far = |p: &DVec3| hull.distance(*p);
    (!points.is_empty()).then(|| points.iter().map(far).sum::<f64>() / points.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::tests::cuboid;

    #[test]
    fn the_closed_state_protrudes_less() {
        let base = cuboid([-0.5, 0.0, 0.0], [0.5, 1.0, 1.0]);
        let at = |y: f64| cuboid([-0.4, y, 0.0], [0.4, y + 0.8, 0.4]);
        let (shut, open) = (at(0.1), at(-0.5));
        let empty = Mesh::default();
        let closed = |start, end| nearer_state(PerState::new(start, end), PerState::new(&base, &base), 0.01, 100);
        assert_eq!(closed(&shut, &open), Some(State::START));
        assert_eq!(closed(&open, &shut), Some(State::END));
        assert_eq!(closed(&shut, &shut), None);
        assert_eq!(closed(&shut, &empty), None);
    }
}
