//! Triangle meshes as Wavefront OBJ, which simulators read where they do not read PLY. Write only.

use crate::{FileError, write_atomic};
use artgs_core::Mesh;
use std::fmt::Write;
use std::path::Path;

/// Writes a mesh as OBJ; colours follow the coordinates of each `v` line as `r g b` in [0, 1], as MeshLab does.
pub fn write_mesh_obj(path: &Path, mesh: &Mesh) -> Result<(), FileError> {
    let colored = mesh.colors.len() == mesh.vertices.len();
    if !colored && !mesh.colors.is_empty() {
        let (n, c) = (mesh.vertices.len(), mesh.colors.len());
        return Err(FileError::malformed(path, format!("{n} vertices with {c} colours")));
    }
    let mut out = format!("# artgs {}\n", env!("CARGO_PKG_VERSION"));
    for (i, [x, y, z]) in mesh.vertices.iter().enumerate() {
        let _ = write!(out, "v {x} {y} {z}");
        if colored {
            let [r, g, b] = mesh.colors[i].map(|c| f32::from(c) / 255.0);
            let _ = write!(out, " {r:.4} {g:.4} {b:.4}");
        }
        out.push('\n');
    }
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| u64::from(i) + 1);
        let _ = writeln!(out, "f {a} {b} {c}");
    }
    write_atomic(path, out.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_from_one_and_appends_colours() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.obj");
        let mesh = Mesh {
            vertices: vec![[0.0, 1e-7, -2.5], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            colors: vec![[255, 0, 51], [0; 3], [0; 3]],
            triangles: vec![[0, 1, 2]],
        };
        write_mesh_obj(&path, &mesh).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(lines[0], "v 0 0.0000001 -2.5 1.0000 0.0000 0.2000");
        assert_eq!(lines[3], "f 1 2 3");
    }
}
