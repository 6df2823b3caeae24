//! Coloured triangle meshes.

use crate::Rigid;
use glam::DVec3;

/// A triangle mesh with a colour per vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions, `[n][3]`, scene units.
    pub vertices: Vec<[f32; 3]>,
    /// sRGB colours, `[n][3]`; empty if the mesh has none.
    pub colors: Vec<[u8; 3]>,
    /// Vertex indices, `[m][3]`, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// True if there is nothing to see.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// The mesh moved rigidly.
    pub fn moved(&self, motion: &Rigid) -> Self {
        let vertices = self
            .vertices
            .iter()
            .map(|v| motion.apply(DVec3::new(v[0].into(), v[1].into(), v[2].into())).as_vec3().to_array())
            .collect();
        Self { vertices, ..self.clone() }
    }

    /// Appends another mesh. Colours are kept if both have them or this one was empty.
    pub fn append(&mut self, other: &Self) {
        let base = self.vertices.len() as u32;
        let coloured = self.colors.len() == self.vertices.len() && other.colors.len() == other.vertices.len();
        self.vertices.extend(&other.vertices);
        if coloured {
            self.colors.extend(&other.colors);
        } else {
            self.colors.clear();
        }
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + base)));
    }
}
