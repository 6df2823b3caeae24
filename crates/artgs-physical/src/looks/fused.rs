//! Fused meshes of parts with their shapes for distances and rays, each built once.

use crate::geometry::convert::trimesh;
use artgs_core::Mesh;
use parry3d::shape::TriMesh;
use std::sync::{Arc, OnceLock};

/// A fused mesh with its shape.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fused {
    mesh: Mesh,
    shape: OnceLock<Option<Arc<TriMesh>>>,
}

impl Fused {
    pub(crate) fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// For ray casts and distances; none without triangles.
    pub(crate) fn shape(&self) -> Option<&Arc<TriMesh>> {
        self.shape.get_or_init(|| trimesh(&self.mesh).map(Arc::new)).as_ref()
    }

    /// The mesh with those of its triangles that have a true entry; it shares the shape if these are all.
    pub(crate) fn kept(&self, keep: &[bool]) -> Self {
        if keep.iter().all(|keep| *keep) {
            return self.clone();
        }
        let triangles = self.mesh.triangles.iter().zip(keep).filter(|(_, keep)| **keep).map(|(t, _)| *t).collect();
        Mesh { triangles, ..self.mesh.clone() }.into()
    }
}

impl From<Mesh> for Fused {
    fn from(mesh: Mesh) -> Self {
        Self { mesh, shape: OnceLock::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_share_their_shape_until_they_lose_triangles() {
        let cube = Fused::from(Mesh::cuboid([0.0; 3], [1.0; 3]));
        let shape = cube.shape().unwrap();
        let mut keep = vec![true; cube.mesh().triangles.len()];
        assert!(Arc::ptr_eq(shape, cube.kept(&keep).shape().unwrap()));
        keep[1] = false;
        let open = cube.kept(&keep);
        assert_eq!(open.mesh().triangles, [&cube.mesh().triangles[..1], &cube.mesh().triangles[2..]].concat());
        assert_eq!(open.shape().unwrap().indices().len(), keep.len() - 1);
        assert!(Fused::default().shape().is_none());
    }
}
