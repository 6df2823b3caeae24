//! Points and poses for the library of meshes, which computes in single precision.

use artgs_core::{Mesh, Rigid};
use glam::DVec3;
use parry3d::math::{Pose3, Rot3, Vec3};
use parry3d::shape::TriMesh;

/// A point as a vector of the collision library, which uses another version of the vector crate.
pub(crate) fn to_parry(p: DVec3) -> Vec3 {
    Vec3::from_array(p.as_vec3().to_array())
}

/// From a point of the collision library.
pub(crate) fn from_parry(p: Vec3) -> DVec3 {
    DVec3::from_array(p.to_array().map(f64::from))
}

/// A motion as a pose of the collision library.
pub(crate) fn pose(motion: &Rigid) -> Pose3 {
    let q = motion.rotation.as_quat();
    Pose3::from_parts(to_parry(motion.translation), Rot3::from_xyzw(q.x, q.y, q.z, q.w))
}

/// For ray casts and distances; none without triangles.
pub(crate) fn trimesh(mesh: &Mesh) -> Option<TriMesh> {
    let vertices = mesh.vertices.iter().map(|v| Vec3::from_array(*v)).collect();
    TriMesh::new(vertices, mesh.triangles.clone()).ok()
}
