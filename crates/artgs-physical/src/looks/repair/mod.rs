//! Closes meshes: cleans them, caps holes that no other part moves through, and thickens what is still open.
//!
//! A part's mesh lacks surfaces that no photo shows: its back, its underside, the inside of a compartment. A hole gets a cap,
//! in several flat pieces if the rim is not planar, unless another part moves through it or views look through it. A component that is still open
//! after that, or a sheet to which caps give no volume, becomes a shell: an inner copy, joined at the rims, makes it solid.

mod cap;
mod clean;
mod loops;
mod thicken;

pub(crate) use clean::reduced;

use crate::geometry::topology::{NUDGE, open_edges, refine, signed_volume, split_to_manifold};
use crate::settings::RepairSettings;
use artgs_core::Mesh;
use glam::DVec3;
use parry3d::math::Pose3;
use parry3d::shape::TriMesh;

/// Points of which something is true; asked from many threads.
type Points<'a> = dyn Fn(DVec3) -> bool + Sync + 'a;

/// Where a part must not have material.
#[derive(Clone, Copy)]
pub(crate) struct Obstacles<'a> {
    /// Other parts occupy or pass through these points.
    pub(crate) passed: &'a Points<'a>,
    /// Views measure something behind these points.
    pub(crate) empty: &'a Points<'a>,
}

impl Obstacles<'_> {
    fn hold(&self, point: DVec3) -> bool {
        (self.passed)(point) || (self.empty)(point)
    }
}

/// Observed surfaces of other parts and their poses in the observed states: walls end before them.
pub(crate) type Others<'a> = [(&'a TriMesh, Pose3)];

/// Settings of [`repair`]; lengths in scene units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RepairOptions {
    /// Vertices that fall into the same cell of this size become one.
    pub weld: f64,
    /// Holes not wider than this are always capped.
    pub small_hole: f64,
    /// Largest motion of a vertex when rims are smoothed before capping or thickening.
    pub rim_smoothing: f64,
    /// Thickness of shells.
    pub thickness: f64,
    /// How holes are closed.
    pub settings: RepairSettings,
}

impl RepairOptions {
    /// Settings for a mesh whose edges are about `edge` long (see [`mean_edge`]).
    pub(crate) fn at_resolution(edge: f64, settings: &RepairSettings) -> Self {
        Self {
            weld: settings.weld * edge,
            small_hole: settings.small_hole * edge,
            rim_smoothing: settings.rim_smoothing * edge,
            thickness: settings.thickness * edge,
            settings: *settings,
        }
    }
}

/// Result of [`repair`].
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Repaired {
    /// The mesh, in the frame of the input, with its colours.
    pub mesh: Mesh,
    /// True if every edge is shared by exactly two triangles that run along it in opposite directions.
    pub watertight: bool,
    /// Edges for which that does not hold.
    pub open_edges: usize,
    /// Capped holes.
    pub capped: usize,
    /// Holes without a complete cap: another part moves through them, or they would enclose no more than a sheet.
    pub left_open: usize,
    /// True if a component was thickened.
    pub thickened: bool,
    /// Enclosed volume, scene units cubed.
    pub volume: f64,
}

/// Mean length of the mesh's edges, scene units; 0 without triangles.
pub(crate) fn mean_edge(mesh: &Mesh) -> f64 {
    let lengths = mesh.triangles.iter().flat_map(|t| {
        let [a, b, c] = crate::geometry::topology::corners(mesh, *t);
        [a.distance(b), b.distance(c), c.distance(a)]
    });
    lengths.sum::<f64>() / (3 * mesh.triangles.len()).max(1) as f64
}

/// Converts a part's mesh to a closed, oriented one: welds, removes debris, orients, caps holes outside `obstacles`, and
/// thickens what is still open. Walls are at most about a third of the distance to the surface behind them thick, also to
/// those of `others`, and stay out of obstacles. An empty mesh stays empty and is not watertight.
pub(crate) fn repair(mesh: &Mesh, obstacles: &Obstacles, others: &Others, options: &RepairOptions) -> Repaired {
    let mut mesh = clean::clean(mesh, options);
    let mut holes = loops::holes(&mesh);
    for hole in &mut holes {
        loops::smooth(&mut mesh, hole, options);
    }
    let caps = cap::close(&mut mesh, &holes, obstacles, options);
    let capped = caps.iter().filter(|cap| cap.whole).count();
    mesh.triangles.extend(caps.into_iter().flat_map(|cap| cap.triangles));
    let mut thickened = false;
    if capped < holes.len() && options.thickness > 0.0 {
        thickened = true;
        // Refined, so that walls behind caps can follow the surface behind them.
        refine(&mut mesh, options.settings.shell_edge * options.thickness);
        thicken::thicken(&mut mesh, obstacles, others, options);
    }
    mesh = if open_edges(&mesh.triangles) > 0 {
        split_to_manifold(&mesh, NUDGE)
    } else {
        clean::reduced(&mesh, &mesh.triangles)
    };
    let mut volume = signed_volume(&mesh);
    let open_edges = open_edges(&mesh.triangles);
    if volume < 0.0 && open_edges == 0 {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        volume = -volume;
    }
    let watertight = open_edges == 0 && !mesh.is_empty();
    Repaired { mesh, watertight, open_edges, capped, left_open: holes.len() - capped, thickened, volume }
}

#[cfg(test)]
mod tests;
