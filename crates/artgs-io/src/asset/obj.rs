//! Wavefront OBJ with MTL and PNG for simulators. Write only.
//!
//! Limitations: vertex colours are written only without a texture, because loaders multiply both. They follow the coordinates
//! of each `v` line as in MeshLab, which many loaders ignore. One material. Faces follow a comment that says what they rest on, `# evidence
//! seen`, `derived` or `invented`: groups and materials would make several shapes of one mesh in some loaders.

use crate::image_io::write_rgb;
use crate::{FileError, write_atomic};
use artgs_core::{Mesh, TexturedMesh};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Begins a comment that says what the faces after it rest on.
const EVIDENCE: &str = "# evidence";

/// Writes `STEM.obj` and, with a texture, `STEM.mtl` and `STEM.png`; returns the files, the OBJ first. `vt` starts at the lower
/// left corner.
pub fn write_textured_obj(dir: &Path, stem: &str, mesh: &TexturedMesh) -> Result<Vec<PathBuf>, FileError> {
    let path = dir.join(format!("{stem}.obj"));
    let text = textured(stem, mesh).map_err(|reason| FileError::malformed(&path, reason))?;
    let mut written = vec![path];
    if let Some(texture) = &mesh.texture {
        let (picture, material) = (dir.join(format!("{stem}.png")), dir.join(format!("{stem}.mtl")));
        write_rgb(&picture, texture.width, texture.height, &texture.rgb)?;
        let look = format!("newmtl {stem}\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\nmap_Kd {stem}.png\n");
        write_atomic(&material, look.as_bytes())?;
        written.extend([material, picture]);
    }
    write_atomic(&written[0], text.as_bytes())?;
    Ok(written)
}

/// Writes positions and triangles only, for collision meshes.
pub fn write_hull_obj(path: &Path, mesh: &Mesh) -> Result<(), FileError> {
    let mut out = header();
    for v in &mesh.vertices {
        line(&mut out, "v", v);
    }
    out.push('\n');
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| u64::from(i) + 1);
        let _ = writeln!(out, "f {a} {b} {c}");
    }
    write_atomic(path, out.as_bytes())
}

fn header() -> String {
    format!("# artgs {}\n", env!("CARGO_PKG_VERSION"))
}

fn line(out: &mut String, tag: &str, values: &[f32]) {
    *out += tag;
    for v in values {
        let _ = write!(out, " {}", v + 0.0);
    }
    out.push('\n');
}

fn textured(stem: &str, textured: &TexturedMesh) -> Result<String, String> {
    let TexturedMesh { mesh, normals, uvs, texture, .. } = textured;
    let n = mesh.vertices.len();
    let fits = |name: &str, len: usize, needed: bool| {
        if len == n || (len == 0 && !needed) {
            Ok(len == n && n > 0)
        } else {
            Err(format!("{n} vertices, {len} {name}"))
        }
    };
    let has_normals = fits("normals", normals.len(), false)?;
    let has_colors = fits("colours", mesh.colors.len(), false)? && texture.is_none();
    let has_uvs = texture.is_some() && fits("texture coordinates", uvs.len(), true)?;
    let mut out = header();
    if texture.is_some() {
        let _ = writeln!(out, "mtllib {stem}.mtl");
    }
    for (i, v) in mesh.vertices.iter().enumerate() {
        line(&mut out, "v", v);
        if has_colors {
            out.pop();
            let [r, g, b] = mesh.colors[i].map(|c| f32::from(c) / 255.0);
            let _ = writeln!(out, " {r:.4} {g:.4} {b:.4}");
        }
    }
    if has_uvs {
        uvs.iter().for_each(|[u, v]| line(&mut out, "vt", &[*u, 1.0 - v]));
    }
    if has_normals {
        normals.iter().for_each(|normal| line(&mut out, "vn", normal));
    }
    if texture.is_some() {
        let _ = writeln!(out, "usemtl {stem}");
    }
    let corner = |i: u32| {
        let i = u64::from(i) + 1;
        match (has_uvs, has_normals) {
            (true, true) => format!("{i}/{i}/{i}"),
            (true, false) => format!("{i}/{i}"),
            (false, true) => format!("{i}//{i}"),
            (false, false) => i.to_string(),
        }
    };
    for (evidence, triangles) in textured.by_evidence() {
        if let Some(kind) = evidence {
            let _ = writeln!(out, "{EVIDENCE} {}", kind.name());
        }
        for t in triangles {
            let [a, b, c] = t.map(corner);
            let _ = writeln!(out, "f {a} {b} {c}");
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image_io::read_rgba;
    use artgs_core::{FaceEvidence, Texture};

    fn triangle() -> TexturedMesh {
        TexturedMesh {
            mesh: Mesh {
                vertices: vec![[0.0, 1e-7, -2.5], [1.0, 0.0, -0.0], [0.0, 1.0, 0.0]],
                colors: vec![[255, 0, 51], [0; 3], [0; 3]],
                triangles: vec![[0, 1, 2]],
            },
            normals: vec![[0.0, 0.0, 1.0]; 3],
            uvs: vec![[0.0, 0.0], [1.0, 0.25], [0.5, 1.0]],
            texture: Some(Texture { width: 2, height: 1, rgb: vec![[1, 2, 3], [250, 0, 9]] }),
            evidence: Vec::new(),
        }
    }

    fn body(path: &Path) -> String {
        let text = std::fs::read_to_string(path).unwrap();
        text.split_once('\n').unwrap().1.to_string()
    }

    #[test]
    fn a_texture_comes_with_its_material_and_v_upside_down() {
        let dir = tempfile::tempdir().unwrap();
        let written = write_textured_obj(dir.path(), "m", &triangle()).unwrap();
        assert_eq!(written, ["m.obj", "m.mtl", "m.png"].map(|f| dir.path().join(f)));
        assert_eq!(
            body(&written[0]),
            "mtllib m.mtl\nv 0 0.0000001 -2.5\nv 1 0 0\nv 0 1 0\nvt 0 1\nvt 1 0.75\nvt 0.5 0\nvn 0 0 1\nvn 0 0 1\n\
             vn 0 0 1\nusemtl m\nf 1/1/1 2/2/2 3/3/3\n"
        );
        assert!(std::fs::read_to_string(&written[1]).unwrap().contains("map_Kd m.png\n"));
        assert_eq!(read_rgba(&written[2]).unwrap().pixels, [[1, 2, 3, 255], [250, 0, 9, 255]]);
    }

    #[test]
    fn faces_follow_what_they_rest_on() {
        let dir = tempfile::tempdir().unwrap();
        let mut mesh = triangle();
        mesh.mesh.triangles = vec![[0, 1, 2], [1, 2, 0], [2, 0, 1]];
        mesh.evidence = vec![FaceEvidence::Invented, FaceEvidence::Seen, FaceEvidence::Invented];
        let text = body(&write_textured_obj(dir.path(), "m", &mesh).unwrap()[0]);
        let faces = "usemtl m\n# evidence seen\nf 2/2/2 3/3/3 1/1/1\n# evidence invented\nf 1/1/1 2/2/2 3/3/3\nf 3/3/3 1/1/1 2/2/2\n";
        assert!(text.ends_with(faces), "{text}");
    }

    #[test]
    fn without_a_texture_the_vertices_are_coloured() {
        let dir = tempfile::tempdir().unwrap();
        let mesh = TexturedMesh { texture: None, ..triangle() };
        let written = write_textured_obj(dir.path(), "m", &mesh).unwrap();
        assert_eq!(written.len(), 1);
        let text = body(&written[0]);
        assert!(text.starts_with("v 0 0.0000001 -2.5 1.0000 0.0000 0.2000\n"), "{text}");
        assert!(text.ends_with("f 1//1 2//2 3//3\n") && !text.contains("mtl"), "{text}");
    }

    #[test]
    fn hulls_are_bare_and_counts_must_fit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("h.obj");
        write_hull_obj(&path, &triangle().mesh).unwrap();
        assert_eq!(body(&path), "v 0 0.0000001 -2.5\nv 1 0 0\nv 0 1 0\n\nf 1 2 3\n");
        let mesh = TexturedMesh { uvs: vec![], ..triangle() };
        let message = write_textured_obj(dir.path(), "m", &mesh).unwrap_err().to_string();
        assert!(message.contains("m.obj") && message.contains("3 vertices, 0 texture coordinates"), "{message}");
    }
}
