//! Coloured triangle meshes as PLY.

use crate::error::read_bytes;
use crate::ply::{Column, Element, Kind, read_ply};
use crate::{FileError, write_atomic};
use artgs_core::Mesh;
use std::fmt::Write;
use std::path::Path;

/// Writes a mesh as binary little endian PLY: float xyz, uchar rgb (if it has colours), faces with int indices.
pub fn write_mesh_ply(path: &Path, mesh: &Mesh) -> Result<(), FileError> {
    let n = mesh.vertices.len();
    let colored = !mesh.colors.is_empty();
    if colored && mesh.colors.len() != n {
        return Err(FileError::malformed(path, format!("{n} vertices with {} colours", mesh.colors.len())));
    }
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\ncomment artgs {}\nelement vertex {n}\n\
         property float x\nproperty float y\nproperty float z\n",
        env!("CARGO_PKG_VERSION")
    );
    if colored {
        out += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    }
    let _ = write!(out, "element face {}\nproperty list uchar int vertex_indices\nend_header\n", mesh.triangles.len());
    let mut out = out.into_bytes();
    out.reserve(n * 15 + mesh.triangles.len() * 13);
    for (i, vertex) in mesh.vertices.iter().enumerate() {
        vertex.iter().for_each(|v| out.extend(v.to_le_bytes()));
        if colored {
            out.extend(mesh.colors[i]);
        }
    }
    for triangle in &mesh.triangles {
        out.push(3);
        triangle.iter().for_each(|i| out.extend(i.to_le_bytes()));
    }
    write_atomic(path, &out)
}

/// Reads a mesh from any PLY: polygons become fans, unknown properties are skipped, colours are read from
/// `red green blue` if all three exist. Indices out of range and vertices that are not finite are errors.
pub fn read_mesh_ply(path: &Path) -> Result<Mesh, FileError> {
    let bytes = read_bytes(path)?;
    read_ply(&bytes).and_then(|elements| mesh(&elements)).map_err(|reason| FileError::malformed(path, reason))
}

/// Largest coordinate of a mesh: products of larger ones are not finite in single precision.
const FARTHEST: f32 = 1e9;

fn mesh(elements: &[Element]) -> Result<Mesh, String> {
    let find = |name| elements.iter().find(|e| e.name == name);
    let vertex = find("vertex").ok_or("no element `vertex`")?;
    let [x, y, z] = [vertex.require("x")?, vertex.require("y")?, vertex.require("z")?];
    let vertices: Vec<[f32; 3]> = (0..vertex.count).map(|i| [x[i] as f32, y[i] as f32, z[i] as f32]).collect();
    if let Some(row) = vertices.iter().position(|v| v.iter().any(|c| !c.is_finite())) {
        return Err(format!("element `vertex`, row {row}: not finite"));
    }
    if let Some(row) = vertices.iter().position(|v| v.iter().any(|c| c.abs() > FARTHEST)) {
        return Err(format!("element `vertex`, row {row}: a coordinate is beyond {FARTHEST:e}"));
    }
    let colors = match ["red", "green", "blue"].map(|c| vertex.scalar(c)) {
        [Some(r), Some(g), Some(b)] => (0..vertex.count).map(|i| [byte(r, i), byte(g, i), byte(b, i)]).collect(),
        _ => Vec::new(),
    };
    let triangles = match find("face") {
        Some(face) if face.count > 0 => fans(face, vertices.len())?,
        _ => Vec::new(),
    };
    Ok(Mesh { vertices, colors, triangles })
}

/// A colour as a byte: floats are in [0, 1], 16-bit values are rounded.
fn byte(column: &Column, row: usize) -> u8 {
    let v = column.values[row];
    match column.kind {
        Kind::F32 | Kind::F64 => (v * 255.0).round() as u8,
        Kind::U16 => (v / 257.0).round() as u8,
        _ => v as u8,
    }
}

fn fans(face: &Element, vertices: usize) -> Result<Vec<[u32; 3]>, String> {
    let list = face
        .list(&["vertex_indices", "vertex_index"])
        .ok_or("element `face` has no list `vertex_indices` or `vertex_index`")?;
    if let Some(i) = list.values.iter().find(|i| !(0.0..vertices as f64).contains(*i)) {
        return Err(format!("element `face`: index {i} where there are {vertices} vertices"));
    }
    let mut triangles = Vec::with_capacity(face.count);
    let mut begin = 0;
    for &end in &list.ends {
        let polygon = &list.values[begin..end];
        for pair in polygon.get(1..).unwrap_or_default().windows(2) {
            triangles.push([polygon[0] as u32, pair[0] as u32, pair[1] as u32]);
        }
        begin = end;
    }
    Ok(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> Mesh {
        Mesh {
            vertices: vec![[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 1.25, 0.0], [0.0, 0.0, -2.0]],
            colors: vec![[255, 0, 1], [2, 3, 4], [5, 6, 7], [8, 9, 10]],
            triangles: vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]],
        }
    }

    #[test]
    fn round_trip_with_and_without_colours_and_empty() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.ply");
        let plain = Mesh { colors: Vec::new(), ..tetrahedron() };
        for mesh in [tetrahedron(), plain, Mesh::default()] {
            write_mesh_ply(&path, &mesh).unwrap();
            assert_eq!(read_mesh_ply(&path).unwrap(), mesh);
        }
    }

    #[test]
    fn reads_foreign_ascii_with_quads_doubles_and_extra_properties() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.ply");
        let text = "ply\nformat ascii 1.0\nobj_info by hand\nelement vertex 4\nproperty double x\nproperty double y\n\
                    property double z\nproperty float nx\nproperty float red\nproperty float green\nproperty float blue\n\
                    element face 2\nproperty list uchar uint vertex_index\nproperty uchar flag\n\
                    element edge 1\nproperty int a\nend_header\n\
                    0.0 0e0 0 9 1.0 0.5 0\n1.000000000000000000e+00 0 0 9 0 0 0\n1 1 0 9 0 0 0\n0 1 0 9 0 0 0\n\
                    4 0 1 2 3 1\n3 0 2 3 0\n5\n";
        std::fs::write(&path, text).unwrap();
        let mesh = read_mesh_ply(&path).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 2, 3]]);
        assert_eq!((mesh.vertices[2], mesh.colors[0]), ([1.0, 1.0, 0.0], [255, 128, 0]));
    }

    #[test]
    fn bad_indices_numbers_and_colour_counts_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("bad.ply");
        let file = |vertex: &str, face: &str| {
            format!(
                "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                 element face 1\nproperty list uchar int vertex_indices\nend_header\n{vertex}\n{face}\n"
            )
        };
        for (text, word) in [(file("0 0 0", "3 0 0 1"), "index 1"), (file("0 nan 0", "3 0 0 0"), "row 0")] {
            std::fs::write(&path, text).unwrap();
            let message = read_mesh_ply(&path).unwrap_err().to_string();
            assert!(message.contains("bad.ply") && message.contains(word), "{message}");
        }
        assert!(write_mesh_ply(&path, &Mesh { colors: vec![[0; 3]], ..tetrahedron() }).is_err());
    }
}
