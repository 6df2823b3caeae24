//! Visual content of a node: a mesh with its material, or Gaussians.

use super::Scene;
use super::buffer::Use;
use crate::FileError;
use crate::asset::values::{Activated, is_textured, linear, unit_normals};
use crate::image_io::rgb_png;
use artgs_core::{AssetLink, FaceEvidence, Splats, Texture};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Band 0 of the real spherical harmonics.
const SH_0: f32 = 0.282_094_8;

impl Scene {
    /// Index of the mesh of a link; none if it is empty.
    pub(super) fn add_mesh(&mut self, path: &Path, link: &AssetLink) -> Result<Option<usize>, FileError> {
        let (visual, mesh) = (&link.visual, &link.visual.mesh);
        if mesh.is_empty() || mesh.vertices.is_empty() {
            return Ok(None);
        }
        let mut attributes = Map::new();
        let mut put = |name: &str, accessor: usize| attributes.insert(name.into(), json!(accessor));
        put("POSITION", self.buffer.floats(&mesh.vertices, Use::Vertices, true));
        let normals = unit_normals(visual);
        if !normals.is_empty() {
            put("NORMAL", self.buffer.floats(&normals, Use::Vertices, false));
        }
        let mut surface = json!({"metallicFactor": 0.0, "roughnessFactor": 0.8});
        match &visual.texture {
            Some(texture) if is_textured(visual) => {
                put("TEXCOORD_0", self.buffer.floats(&visual.uvs, Use::Vertices, false));
                surface["baseColorTexture"] = json!({"index": self.add_texture(path, &link.name, texture)?});
            }
            _ if mesh.colors.len() == mesh.vertices.len() => {
                let rgba = mesh.colors.iter().map(|c| [linear(c[0]), linear(c[1]), linear(c[2]), 1.0]);
                put("COLOR_0", self.buffer.fine_colors(rgba));
            }
            _ => surface["baseColorFactor"] = json!([0.5, 0.5, 0.5, 1.0]),
        }
        let primitives: Vec<Value> = visual
            .by_evidence()
            .into_iter()
            .map(|(evidence, triangles)| {
                let indices = self.buffer.triangles(&triangles);
                let name = match evidence {
                    Some(other @ (FaceEvidence::Derived | FaceEvidence::Invented)) => {
                        format!("{}_{}", link.name, other.name())
                    }
                    Some(FaceEvidence::Seen) | None => link.name.clone(),
                };
                // Double-sided, because an open door may show the inside of a shell that was observed only from outside.
                self.materials.push(json!({"name": name, "pbrMetallicRoughness": surface, "doubleSided": true}));
                let material = self.materials.len() - 1;
                let mut primitive =
                    json!({"attributes": attributes, "indices": indices, "material": material, "mode": 4});
                if let Some(evidence) = evidence {
                    primitive["extras"] = json!({"evidence": evidence.name()});
                }
                primitive
            })
            .collect();
        self.meshes.push(json!({"name": link.name, "primitives": primitives}));
        Ok(Some(self.meshes.len() - 1))
    }

    fn add_texture(&mut self, path: &Path, name: &str, texture: &Texture) -> Result<usize, FileError> {
        let png = rgb_png(path, texture.width, texture.height, &texture.rgb)?;
        let view = self.buffer.view(&png, Use::Other);
        self.images.push(json!({"name": name, "bufferView": view, "mimeType": "image/png"}));
        self.textures.push(json!({"sampler": 0, "source": self.images.len() - 1}));
        Ok(self.textures.len() - 1)
    }

    /// Index of the mesh with the Gaussians of a link; none if there are none.
    pub(super) fn add_splats(&mut self, name: &str, splats: &Splats) -> Result<Option<usize>, String> {
        if splats.is_empty() {
            return Ok(None);
        }
        let activated = Activated::of(splats)?;
        let sh =
            |k: usize| splats.sh.chunks_exact(splats.sh_stride()).map(move |c| [c[3 * k], c[3 * k + 1], c[3 * k + 2]]);
        let mut attributes = Map::new();
        let mut put = |name: String, accessor: usize| attributes.insert(name, json!(accessor));
        put("POSITION".into(), self.buffer.floats(&splats.means, Use::Vertices, true));
        let plain = sh(0).zip(&activated.opacities).map(|(c, a)| {
            let [r, g, b] = c.map(|v| 0.5 + SH_0 * v);
            [r, g, b, *a]
        });
        put("COLOR_0".into(), self.buffer.coarse_colors(plain));
        let extension = |what: &str| format!("KHR_gaussian_splatting:{what}");
        let xyzw: Vec<[f32; 4]> = activated.rotations.iter().map(|q| [q[1], q[2], q[3], q[0]]).collect();
        put(extension("ROTATION"), self.buffer.floats(&xyzw, Use::Vertices, false));
        put(extension("SCALE"), self.buffer.floats(&activated.scales, Use::Vertices, false));
        let opacities: Vec<[f32; 1]> = activated.opacities.iter().map(|a| [*a]).collect();
        put(extension("OPACITY"), self.buffer.floats(&opacities, Use::Vertices, false));
        for degree in 0..=splats.sh_degree {
            for k in 0..2 * degree + 1 {
                let values: Vec<[f32; 3]> = sh(degree * degree + k).collect();
                let accessor = self.buffer.floats(&values, Use::Vertices, false);
                put(extension(&format!("SH_DEGREE_{degree}_COEF_{k}")), accessor);
            }
        }
        let primitive =
            json!({"attributes": attributes, "mode": 0, "extensions": {"KHR_gaussian_splatting": kernel()}});
        self.meshes.push(json!({"name": name, "primitives": [primitive]}));
        Ok(Some(self.meshes.len() - 1))
    }
}

/// How the Gaussians were trained: the kernel, colours, order and projection of 3DGS.
fn kernel() -> Value {
    json!({
        "kernel": "ellipse",
        "colorSpace": "srgb_rec709_display",
        "sortingMethod": "cameraDistance",
        "projection": "perspective",
    })
}
