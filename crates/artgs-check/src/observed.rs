//! What the capture showed of each link: the fused meshes of the replica, in the frames of the links. Visual meshes also have
//! surfaces that close them, which no image shows.

use crate::model::Model;
use crate::poses::vector;
use artgs_core::{Mesh, Replica, Rigid, State};
use artgs_io::RunFolder;
use artgs_io::export_report::ExportReport;
use glam::{DQuat, DVec3};
use rapier3d::parry::query::{PointQuery as _, PointQueryWithLocation as _};
use rapier3d::parry::shape::TriMesh;

/// The fused surface of a link.
pub(crate) struct Observed {
    shape: TriMesh,
    /// Points within this distance belong to it.
    reach: f64,
}

impl Observed {
    pub(crate) fn holds(&self, p: DVec3) -> bool {
        self.shape.project_local_point_with_max_dist(vector(p), false, self.reach as f32).is_some()
    }

    /// True if the nearest observed surface faces away from a point: no image shows the space there.
    pub(crate) fn hides(&self, p: DVec3) -> bool {
        /// Cosine of the angle between the way to the surface and its normal: beside its rim, a surface hides nothing.
        const FACING: f64 = 0.7;
        let (nearest, (triangle, _)) = self.shape.project_local_point_and_get_location(vector(p), false);
        let corner = self.shape.triangle(triangle);
        let normal = DVec3::from_array((corner.b - corner.a).cross(corner.c - corner.a).to_array().map(f64::from));
        let way = DVec3::from_array(nearest.point.to_array().map(f64::from)) - p;
        way.dot(normal) > FACING * way.length() * normal.length()
    }

    /// True for points behind this surface by more than `depth`, and not much more: what is farther from it is behind a wall. Beside a
    /// rim, nothing is known.
    pub(crate) fn is_deep(&self, p: DVec3, depth: f64) -> bool {
        /// Largest depth, in multiples of the least one.
        const NEAR: f64 = 3.0;
        /// Cosine of the largest angle between the way to the surface and its normal.
        const STRAIGHT: f64 = 0.9;
        let found =
            self.shape.project_local_point_and_get_location_with_max_dist(vector(p), false, (NEAR * depth) as f32);
        let Some((near, (triangle, _))) = found else { return false };
        let Some(normal) = self.shape.triangle(triangle).normal() else { return false };
        let [way, normal] = [vector(p) - near.point, normal].map(|v| DVec3::from_array(v.to_array().map(f64::from)));
        let behind = -way.dot(normal);
        behind > depth && behind > STRAIGHT * way.length()
    }

    /// `mesh` is in the frame and unit of the capture at the start state.
    pub(crate) fn new(mesh: &Mesh, scale: f64, to_link: &Rigid) -> Option<Self> {
        /// Distance of simplified surfaces from the fused one, relative to its edges.
        const REACH: f64 = 1.4;
        let points: Vec<DVec3> =
            mesh.vertices.iter().map(|v| to_link.apply(DVec3::from_array(v.map(f64::from)) * scale)).collect();
        let edge = |t: &[u32; 3]| points[t[0] as usize].distance(points[t[1] as usize]);
        let edges = mesh.triangles.iter().map(edge).sum::<f64>() / mesh.triangles.len().max(1) as f64;
        let shape = TriMesh::new(points.iter().map(|p| vector(*p)).collect(), mesh.triangles.clone()).ok()?;
        Some(Self { shape, reach: REACH * edges })
    }
}

/// What was observed of every link of a model; none where it is not known.
pub(crate) fn all(run: &RunFolder, replica: &Replica, exported: &ExportReport, model: &Model) -> Vec<Option<Observed>> {
    let start = |link: &crate::model::Link| {
        link.motion.as_ref().map_or(Some(0.0), |m| m.observed.as_ref().map(|values| values[State::START]))
    };
    let values: Option<Vec<f64>> = model.links.iter().map(start).collect();
    let meshes = run.load_meshes(replica, State::START).ok();
    let (Some(values), Some(meshes)) = (values.filter(|_| exported.scale > 0.0), meshes) else {
        return model.links.iter().map(|_| None).collect();
    };
    let upright = match exported.up.as_str() {
        "y" => DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2),
        _ => DQuat::IDENTITY,
    };
    // Exports of earlier versions only turned the upward axis.
    let object = exported.frame.unwrap_or(Rigid { rotation: upright, translation: DVec3::ZERO });
    let poses = model.poses(&values);
    let of_link = |(link, pose): (&crate::model::Link, &Rigid)| {
        let part = exported.links.iter().position(|l| l.name == link.name)?;
        Observed::new(meshes.get(part)?, exported.scale, &(pose.inverse() * object))
    };
    model.links.iter().zip(&poses).map(of_link).collect()
}
