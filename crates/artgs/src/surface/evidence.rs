//! Which connected pieces of a part's mesh the views support: a piece needs views that show it, and a piece of a movable part that is apart
//! from the rest needs evidence that it moves with it.

use super::view::FusionView;
use crate::connected::connected_components;
use artgs_core::{Mesh, PerState, Rigid, State};
use glam::{DVec3, IVec3};
use rayon::prelude::*;
use std::collections::HashSet;

/// Vertices of a piece that are compared with the views.
const SAMPLES: usize = 96;
/// Views that must have measured a piece.
const LEAST_VIEWS: u32 = 2;
/// Share of the vertices of a piece that must be seen, or seen to move: of a thin door, the side that one state shows can be a piece.
const LEAST_SHARE: f64 = 0.3;

/// A part of labelled views, and its poses in their states.
pub(super) struct Seen<'a> {
    pub(super) part: u16,
    pub(super) views: PerState<&'a [FusionView<'a>]>,
    /// From the frame of the mesh into the world of each state.
    pub(super) poses: PerState<Rigid>,
    /// Distance between a surface and a depth that show the same, scene units.
    pub(super) tolerance: f64,
}

/// What views that measured something say of a point.
#[derive(Clone, Copy, Default)]
struct Votes {
    /// They measured the part there.
    own: u32,
    /// They measured something there, the part or another one.
    surface: u32,
    /// They look through the point.
    through: u32,
}

impl Votes {
    fn is_empty_space(self) -> bool {
        self.through >= LEAST_VIEWS && self.through > self.surface
    }
}

/// What is left of a mesh.
pub(super) struct Supported {
    pub(super) mesh: Mesh,
    /// Cells of a grid with pieces that do not move with the part.
    pub(super) still: Cells,
}

/// Cells of a grid.
pub(super) struct Cells {
    edge: f64,
    cells: HashSet<IVec3>,
}

impl Cells {
    fn cell(&self, point: DVec3) -> IVec3 {
        (point / self.edge).floor().as_ivec3()
    }

    fn add(&mut self, point: DVec3) {
        let around = |c: IVec3| (0..27).map(move |i| c + IVec3::new(i % 3, i / 3 % 3, i / 9) - 1);
        self.cells.extend(around(self.cell(point)));
    }

    pub(super) fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    pub(super) fn contains(&self, point: DVec3) -> bool {
        self.cells.contains(&self.cell(point))
    }
}

impl Seen<'_> {
    /// The mesh without pieces that the views do not support. The largest piece stays.
    pub(super) fn supported(&self, mesh: &Mesh) -> Supported {
        let edges = mesh.triangles.iter().flat_map(|t| [t[1], t[2]].map(|i| (t[0] as usize, i as usize)));
        let pieces = connected_components(mesh.vertices.len(), edges);
        let mut members: Vec<Vec<usize>> = vec![Vec::new(); pieces.iter().max().map_or(0, |last| *last as usize + 1)];
        pieces.iter().enumerate().for_each(|(i, piece)| members[*piece as usize].push(i));
        let largest = (0..members.len()).max_by_key(|piece| members[*piece].len());
        let verdict = |(piece, members): (usize, &Vec<usize>)| match Some(piece) == largest {
            true => Verdict::Supported,
            false => self.verdict(mesh, members),
        };
        let verdicts: Vec<Verdict> = members.par_iter().enumerate().map(verdict).collect();
        let mut still = Cells { edge: 2.0 * self.tolerance, cells: HashSet::new() };
        for (members, _) in members.iter().zip(&verdicts).filter(|m| *m.1 == Verdict::Still) {
            members.iter().for_each(|i| still.add(vertex(mesh, *i)));
        }
        let kept = |t: &&[u32; 3]| verdicts[pieces[t[0] as usize] as usize] == Verdict::Supported;
        let triangles = mesh.triangles.iter().filter(kept).copied().collect();
        Supported { mesh: super::clean::compact(mesh, triangles), still }
    }

    fn verdict(&self, mesh: &Mesh, members: &[usize]) -> Verdict {
        let (mut seen, mut moving, mut count) = (0, 0, 0);
        for i in members.iter().step_by(members.len().div_ceil(SAMPLES)) {
            let point = vertex(mesh, *i);
            let places = self.poses.as_ref().map(|pose| pose.apply(point));
            let own = PerState::from_fn(|state| self.votes(state, places[state]).own);
            count += 1;
            seen += u32::from(own.iter().sum::<u32>() >= LEAST_VIEWS);
            moving += u32::from(self.part == 0 || self.moves(&places, &own));
        }
        let least = LEAST_SHARE * f64::from(count);
        if f64::from(seen) < least {
            Verdict::Unseen
        } else if f64::from(moving) < least {
            Verdict::Still
        } else {
            Verdict::Supported
        }
    }

    /// True if a point is seen in both states where the motion takes it, or in one, and its place is empty in the other.
    fn moves(&self, places: &PerState<DVec3>, own: &PerState<u32>) -> bool {
        let left = |state: State| own[state] > 0 && self.votes(state.other(), places[state]).is_empty_space();
        own.iter().all(|own| *own > 0) || State::ALL.into_iter().any(left)
    }

    /// Votes of the views of a state on a point of its world.
    fn votes(&self, state: State, point: DVec3) -> Votes {
        let mut votes = Votes::default();
        for view in self.views[state] {
            let (uv, z) = view.camera.project(point);
            let k = &view.camera.intrinsics;
            if !(z > 0.0 && uv.x >= 0.0 && uv.y >= 0.0 && uv.x < f64::from(k.width) && uv.y < f64::from(k.height)) {
                continue;
            }
            let pixel = uv.y as usize * k.width as usize + uv.x as usize;
            if view.derived.as_ref().is_some_and(|derived| derived[pixel]) {
                continue;
            }
            let (depth, label) = (f64::from(view.depth[pixel]), view.labels.as_ref().map(|labels| labels[pixel]));
            // Background without depth may be a floor that only the other state has taken for a part of the object: it proves no place empty.
            if depth <= 0.0 {
                continue;
            }
            if (depth - z).abs() <= self.tolerance {
                votes.surface += 1;
                votes.own += u32::from(label == Some(self.part));
            } else if depth > z + 2.0 * self.tolerance {
                votes.through += 1;
            }
        }
        votes
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Verdict {
    Supported,
    /// Too few views show it.
    Unseen,
    /// It is seen, but not to move.
    Still,
}

fn vertex(mesh: &Mesh, i: usize) -> DVec3 {
    DVec3::from_array(mesh.vertices[i].map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Scene, Shape, orbit};
    use super::*;

    /// A plate of two triangles around a point.
    fn plate(mesh: &mut Mesh, at: DVec3) {
        let corner = |x: f64, y: f64| (at + DVec3::new(0.05 * x, 0.05 * y, 0.0)).as_vec3().to_array();
        let vertices = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        mesh.append(&Mesh { vertices, colors: vec![], triangles: vec![[0, 1, 2], [0, 2, 3]] });
    }

    /// A wide base whose top is at 0.1, and a block on it that slides by 0.6 along x; where it lands is empty before.
    #[test]
    fn pieces_need_views_and_pieces_of_movable_parts_need_to_move() {
        let slide = DVec3::new(0.6, 0.0, 0.0);
        let scene = |shift: DVec3| {
            let base = (Shape::Box(DVec3::new(0.8, 0.4, 0.1)), Rigid::IDENTITY);
            let block = (Shape::Box(DVec3::new(0.15, 0.15, 0.1)), Rigid::shift(DVec3::new(-0.4, 0.0, 0.2) + shift));
            Scene(vec![base, block])
        };
        let cameras = orbit(20, 120, 2.5);
        let views = PerState::new(scene(DVec3::ZERO), scene(slide)).map(|scene| {
            let view = |camera: &artgs_core::Camera| {
                let (depth, mut labels) = scene.render(camera);
                // Pixels of the base near its border at -x are labelled wrongly.
                for (i, label) in labels.iter_mut().enumerate().filter(|(i, _)| depth[*i] > 0.0) {
                    let pixel = glam::DVec2::new((i % 120) as f64 + 0.5, (i / 120) as f64 + 0.5);
                    *label = if camera.unproject(pixel, f64::from(depth[i])).x < -0.65 { 1 } else { *label };
                }
                FusionView { labels: Some(labels.into()), ..FusionView::new(*camera, depth) }
            };
            cameras.iter().map(view).collect::<Vec<_>>()
        });
        let views = views.as_ref().map(|views| &views[..]);
        let mut mesh = Mesh::default();
        let top = DVec3::new(-0.4, 0.0, 0.3);
        for i in 0..3 {
            plate(&mut mesh, top + DVec3::new(0.0, 0.02 * f64::from(i), 0.0));
        }
        // The largest piece; the others: of the base, in the air, and of the block again, apart from the rest.
        mesh.triangles.extend([[0, 5, 6], [4, 9, 10]]);
        plate(&mut mesh, DVec3::new(-0.75, 0.0, 0.1));
        plate(&mut mesh, DVec3::new(-0.4, 0.0, 0.8));
        plate(&mut mesh, top + DVec3::new(0.0, -0.08, 0.0));
        let poses = PerState::new(Rigid::IDENTITY, Rigid::shift(slide));
        let seen = Seen { part: 1, views, poses, tolerance: 0.03 };
        let Supported { mesh: kept, still } = seen.supported(&mesh);
        assert_eq!(kept.vertices.len(), 16, "the block, and its piece");
        assert!(still.contains(DVec3::new(-0.75, 0.0, 0.1)) && !still.contains(DVec3::new(-0.4, 0.0, 0.8)));
    }
}
