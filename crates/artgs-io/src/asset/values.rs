//! Conversions for scene formats: linear colours, activated Gaussians, unit normals.

use artgs_core::{Splats, TexturedMesh};

/// Scene-linear value of an sRGB byte, in [0, 1].
pub(super) fn linear(srgb: u8) -> f32 {
    let v = f32::from(srgb) / 255.0;
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Normals of unit length; empty if there is not one per vertex. A zero normal becomes +Z.
pub(super) fn unit_normals(mesh: &TexturedMesh) -> Vec<[f32; 3]> {
    if mesh.normals.len() != mesh.mesh.vertices.len() {
        return Vec::new();
    }
    let unit = |n: &[f32; 3]| glam::Vec3::from_array(*n).normalize_or(glam::Vec3::Z).to_array();
    mesh.normals.iter().map(unit).collect()
}

/// Whether the mesh has a texture and texture coordinates.
pub(super) fn is_textured(mesh: &TexturedMesh) -> bool {
    mesh.texture.is_some() && mesh.uvs.len() == mesh.mesh.vertices.len()
}

/// Gaussians with activated parameters.
pub(super) struct Activated {
    /// Standard deviations, metres.
    pub(super) scales: Vec<[f32; 3]>,
    /// In [0, 1].
    pub(super) opacities: Vec<f32>,
    /// Unit quaternions (w, x, y, z).
    pub(super) rotations: Vec<[f32; 4]>,
}

impl Activated {
    pub(super) fn of(splats: &Splats) -> Result<Self, String> {
        let n = splats.len();
        let lengths = [splats.rotations.len(), splats.log_scales.len(), splats.logit_opacities.len()];
        if lengths != [n; 3] || splats.sh.len() != n * splats.sh_stride() || splats.sh_degree > 3 {
            return Err(format!("{n} Gaussians with arrays of other lengths, or a degree above 3"));
        }
        let unit = |q: &[f32; 4]| {
            let length = q.iter().map(|v| v * v).sum::<f32>().sqrt();
            if length > 1e-12 { q.map(|v| v / length) } else { [1.0, 0.0, 0.0, 0.0] }
        };
        Ok(Self {
            scales: splats.log_scales.iter().map(|s| s.map(f32::exp)).collect(),
            opacities: splats.logit_opacities.iter().map(|v| 1.0 / (1.0 + (-v).exp())).collect(),
            rotations: splats.rotations.iter().map(unit).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        assert_eq!((linear(0), linear(255)), (0.0, 1.0));
        assert!((linear(188) - 0.5029).abs() < 1e-4 && (linear(10) - 0.003035).abs() < 1e-6);
        let splats = Splats {
            means: vec![[0.0; 3]],
            rotations: vec![[0.0, 0.0, 2.0, 0.0]],
            log_scales: vec![[0.0, 2f32.ln(), -(2f32.ln())]],
            logit_opacities: vec![0.0],
            sh_degree: 0,
            sh: vec![0.0; 3],
        };
        let a = Activated::of(&splats).unwrap();
        assert_eq!((a.opacities[0], a.rotations[0]), (0.5, [0.0, 0.0, 1.0, 0.0]));
        assert!((a.scales[0][1] - 2.0).abs() < 1e-6 && (a.scales[0][2] - 0.5).abs() < 1e-6);
        assert!(Activated::of(&Splats { sh: vec![], ..splats }).is_err());
    }
}
