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
    /// True if there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// An axis-aligned box, without colours.
    pub fn cuboid(low: [f32; 3], high: [f32; 3]) -> Self {
        const QUADS: [[u32; 4]; 6] =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { low[axis] } else { high[axis] });
        let triangles = QUADS.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        Self { vertices: (0..8).map(corner).collect(), colors: Vec::new(), triangles }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_closed_and_oriented_outwards() {
        let mesh = Mesh::cuboid([0.0, 1.0, 2.0], [1.0, 3.0, 5.0]);
        let at = |i: u32| DVec3::from_array(mesh.vertices[i as usize].map(f64::from));
        let six: f64 = mesh.triangles.iter().map(|t| at(t[0]).dot(at(t[1]).cross(at(t[2])))).sum();
        assert!((six / 6.0 - 6.0).abs() < 1e-12, "{six}");
    }
}
