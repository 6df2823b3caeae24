//! Texels of an atlas: their points on the surface, and padding between charts.

use super::zbuffer::each_pixel;
use artgs_core::TexturedMesh;
use glam::{DVec2, DVec3, Vec3};

/// A texel on the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Texel {
    /// Row-major position in the atlas.
    pub(super) index: usize,
    /// Place on the surface.
    pub(super) point: DVec3,
    /// Unit normal at that point.
    pub(super) normal: DVec3,
}

/// All texels whose centres lie in a triangle, row by row.
pub(super) fn texels(mesh: &TexturedMesh, size: [u32; 2]) -> Vec<Texel> {
    let [width, height] = size.map(|s| s as usize);
    let mut owner: Vec<Option<(u32, [f32; 2])>> = vec![None; width * height];
    let scale = DVec2::new(width as f64, height as f64);
    for (i, t) in mesh.mesh.triangles.iter().enumerate() {
        let place = t.map(|v| DVec2::from_array(mesh.uvs[v as usize].map(f64::from)) * scale);
        each_pixel(place, [width, height], |x, y, w| {
            owner[y * width + x] = Some((i as u32, [w[0] as f32, w[1] as f32]))
        });
    }
    let texel = |(index, owner): (usize, &Option<(u32, [f32; 2])>)| {
        let (triangle, [u, v]) = (*owner)?;
        let weights = [u, v, 1.0 - u - v];
        let t = mesh.mesh.triangles[triangle as usize];
        let mix = |of: &[[f32; 3]]| -> DVec3 {
            t.iter().zip(weights).map(|(k, w)| (Vec3::from_array(of[*k as usize]) * w).as_dvec3()).sum()
        };
        let p = t.map(|k| DVec3::from_array(mesh.mesh.vertices[k as usize].map(f64::from)));
        // The triangle's normal decides which views see it; vertex normals only make the shading smooth.
        let flat = (p[1] - p[0]).cross(p[2] - p[0]).normalize_or_zero();
        Some(Texel { index, point: mix(&mesh.mesh.vertices), normal: (flat + mix(&mesh.normals)).normalize_or(flat) })
    };
    owner.iter().enumerate().filter_map(texel).collect()
}

/// Spreads colours to `rings` texels around coloured ones; all other texels get the mean colour.
pub(super) fn pad(colors: &mut [Option<Vec3>], size: [u32; 2], rings: u32) -> Vec<[u8; 3]> {
    let [width, height] = size.map(|s| s as usize);
    let known = colors.iter().flatten();
    let mean = known.clone().sum::<Vec3>() / known.count().max(1) as f32;
    let near = |i: usize| {
        let (x, y) = (i % width, i / width);
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        (y.saturating_sub(1)..(y + 2).min(height)).flat_map(move |j| columns.clone().map(move |i| j * width + i))
    };
    let mut edge: Vec<usize> = (0..colors.len()).filter(|i| colors[*i].is_some()).collect();
    for _ in 0..rings {
        let mut ring: Vec<usize> = edge.iter().flat_map(|i| near(*i)).filter(|i| colors[*i].is_none()).collect();
        ring.sort_unstable();
        ring.dedup();
        let blend = |i: &usize| {
            let (sum, n) = near(*i).filter_map(|k| colors[k]).fold((Vec3::ZERO, 0.0), |(s, n), c| (s + c, n + 1.0));
            sum / n
        };
        let values: Vec<Vec3> = ring.iter().map(blend).collect();
        ring.iter().zip(values).for_each(|(i, c)| colors[*i] = Some(c));
        edge = ring;
    }
    colors.iter().map(|c| c.unwrap_or(mean).round().to_array().map(|x| x as u8)).collect()
}
