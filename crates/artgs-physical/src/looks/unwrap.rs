//! Texture atlases: unwraps a surface into charts.

use crate::settings::AtlasSettings;
use artgs_core::{Mesh, TexturedMesh};
use uvunwrap::{Atlas, Density, MeshInput, Options};

/// Settings of [`unwrap`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct UnwrapOptions {
    /// Requested texels per scene unit; fewer if the atlas would become too large.
    pub texels_per_unit: f64,
    /// Size and padding of the atlas.
    pub settings: AtlasSettings,
}

/// Result of [`unwrap`].
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Unwrapped {
    /// The mesh with texture coordinates and without a texture; vertices are split along seams.
    pub mesh: TexturedMesh,
    /// Width and height of the atlas, texels.
    pub size: [u32; 2],
    /// Texels per scene unit of the atlas.
    pub texels_per_unit: f64,
    /// Number of charts.
    pub charts: u32,
}

/// A reason why a mesh has no atlas.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum UnwrapError {
    /// The mesh or a setting is unusable.
    #[error("the surface cannot be unwrapped: {0}")]
    Failed(#[from] uvunwrap::Error),
    /// Too many charts.
    #[error("{charts} charts do not fit in {side}x{side} texels; simplify the mesh, or allow a larger atlas")]
    TooLarge {
        /// Number of charts.
        charts: u32,
        /// Largest side allowed.
        side: u32,
    },
}

/// Unwraps a mesh. Charts do not overlap; normals and colours are kept; positions and the order of triangles stay.
pub(crate) fn unwrap(mesh: &TexturedMesh, options: &UnwrapOptions) -> Result<Unwrapped, UnwrapError> {
    let AtlasSettings { side: most, attempts, spare, .. } = options.settings;
    let mut density = options.texels_per_unit;
    let mut atlas = unwrapped_at(mesh, options, density)?;
    for _ in 0..attempts {
        let side = atlas.width.max(atlas.height);
        if side <= most {
            return Ok(collect(mesh, &atlas));
        }
        density *= spare * f64::from(most) / f64::from(side);
        atlas = unwrapped_at(mesh, options, density)?;
    }
    Err(UnwrapError::TooLarge { charts: atlas.chart_count, side: most })
}

fn unwrapped_at(mesh: &TexturedMesh, options: &UnwrapOptions, texels_per_unit: f64) -> Result<Atlas, UnwrapError> {
    let input = MeshInput::new(&mesh.mesh.vertices, mesh.mesh.triangles.as_flattened());
    let density = Density::Fixed { texels_per_unit: texels_per_unit as f32, page_size: None };
    let settings =
        Options { density, padding: options.settings.padding, packing: uvunwrap::Packing::Fast, ..Options::default() };
    Ok(uvunwrap::generate(&[input], &settings)?)
}

fn collect(mesh: &TexturedMesh, atlas: &Atlas) -> Unwrapped {
    let out = &atlas.meshes[0];
    let pick = |from: &[[f32; 3]]| out.vertices.iter().filter_map(|v| from.get(v.xref as usize).copied()).collect();
    let colors = out.vertices.iter().filter_map(|v| mesh.mesh.colors.get(v.xref as usize).copied()).collect();
    let triangles = out.indices.as_chunks::<3>().0.to_vec();
    Unwrapped {
        mesh: TexturedMesh {
            mesh: Mesh { vertices: pick(&mesh.mesh.vertices), colors, triangles },
            normals: pick(&mesh.normals),
            uvs: out.vertices.iter().map(|v| v.uv).collect(),
            evidence: Vec::new(),
            texture: None,
        },
        size: [atlas.width, atlas.height],
        texels_per_unit: f64::from(atlas.texels_per_unit),
        charts: atlas.chart_count,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::topology::testing::{open_box, sphere};
    use crate::geometry::weld::welded;
    use crate::looks::shade::with_normals;
    use crate::settings::LookSettings;
    use glam::{DVec3, Vec2};

    /// Area of every triangle in texels, and how many triangles own each texel whose centre is well inside of them.
    fn layout(flat: &Unwrapped) -> (Vec<f32>, Vec<Vec<u32>>) {
        let [w, h] = flat.size;
        let mut owners = vec![Vec::new(); (w * h) as usize];
        let mut areas = Vec::new();
        for (i, t) in flat.mesh.mesh.triangles.iter().enumerate() {
            let [a, b, c] = t.map(|v| Vec2::from_array(flat.mesh.uvs[v as usize]) * Vec2::new(w as f32, h as f32));
            areas.push(0.5 * (b - a).perp_dot(c - a));
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            for y in low.y as u32..=(high.y as u32).min(h - 1) {
                for x in low.x as u32..=(high.x as u32).min(w - 1) {
                    let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                    let inside = |a: Vec2, b: Vec2| (b - a).perp_dot(p - a) > 1e-3 * (b - a).length();
                    if inside(a, b) && inside(b, c) && inside(c, a) {
                        owners[(y * w + x) as usize].push(i as u32);
                    }
                }
            }
        }
        (areas, owners)
    }

    #[test]
    fn charts_do_not_overlap_and_have_the_density_asked_for() {
        let block = welded(&open_box(DVec3::new(1.0, 2.0, 0.5), 6, [true; 6]), 1e-6);
        for (mesh, tolerance) in [(block, 0.02), (welded(&sphere(0.7, 16), 1e-6), 0.6)] {
            let options = UnwrapOptions { texels_per_unit: 100.0, settings: AtlasSettings::DEFAULT };
            let flat = unwrap(&with_normals(&mesh, LookSettings::DEFAULT.crease), &options).unwrap();
            let (areas, owners) = layout(&flat);
            assert!(owners.iter().all(|o| o.len() <= 1), "{} charts", flat.charts);
            for (t, area) in flat.mesh.mesh.triangles.iter().zip(&areas) {
                let real = 0.5 * crate::geometry::topology::cross(&flat.mesh.mesh, *t).length() * 1e4;
                assert!((f64::from(*area) / real - 1.0).abs() < tolerance, "{area} for {real}");
            }
            assert_eq!(flat.mesh.normals.len(), flat.mesh.uvs.len());
            assert_eq!(flat.mesh.mesh.triangles.len(), mesh.triangles.len());
        }
    }

    #[test]
    fn a_large_surface_gets_fewer_texels_instead_of_a_larger_atlas() {
        let mesh = with_normals(&welded(&open_box(DVec3::ONE, 2, [true; 6]), 1e-6), LookSettings::DEFAULT.crease);
        let options =
            UnwrapOptions { texels_per_unit: 1000.0, settings: AtlasSettings { side: 256, ..AtlasSettings::DEFAULT } };
        let flat = unwrap(&mesh, &options).unwrap();
        assert!(flat.size.iter().all(|s| *s <= 256) && flat.texels_per_unit > 40.0, "{}", flat.texels_per_unit);
        let none = unwrap(&mesh, &UnwrapOptions { texels_per_unit: f64::NAN, ..options });
        assert!(none.unwrap_err().to_string().contains("unwrapped"));
    }
}
