//! A picture of an asset, drawn from its Gaussians, and from its meshes where it has none.

use crate::settings::PortraitSettings;
use artgs_core::{Asset, AssetLink, Camera, Intrinsics, Mesh, Rigid, Splats, Texture};
use artgs_raster::low_level::SH_C0;
use artgs_raster::{Rasterizer, RenderOptions};
use glam::{DVec3, Vec3};

/// The asset at joint values 0 in front of white; none if nothing of it can be drawn.
pub(crate) fn portrait(asset: &Asset, settings: &PortraitSettings) -> Option<Texture> {
    let own = |link: &AssetLink| link.splats.as_ref().map(|splats| splats.sh_degree);
    let degree = asset.links.iter().filter_map(own).max().unwrap_or(0);
    let spacing = settings.spacing * asset.bounds_diagonal();
    let drawn: Vec<Splats> = asset.links.iter().map(|link| drawn(link, spacing as f32, degree, settings)).collect();
    let poses = asset.poses(&vec![0.0; asset.links.len()]);
    let centers = drawn
        .iter()
        .zip(&poses)
        .flat_map(|(splats, pose)| splats.means.iter().map(|mean| pose.apply(DVec3::from_array(mean.map(f64::from)))));
    let [low, high] = centers.map(|p| [p, p]).reduce(|[l, h], [p, _]| [l.min(p), h.max(p)])?;
    let (middle, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
    if !(radius > 0.0 && radius.is_finite()) {
        return None;
    }
    // The rasteriser drops what is near, so the object gets the size of a unit ball.
    let mut whole = Splats::empty(degree);
    for (splats, pose) in drawn.iter().zip(&poses) {
        let to_ball = Rigid { translation: (pose.translation - middle) / radius, ..*pose };
        whole.extend_from(&artgs_raster::moved(splats, &to_ball, 1.0 / radius), 0..splats.len());
    }
    Some(rendered(&whole, settings))
}

/// The Gaussians of a link, or dots on its mesh if it has none of the degree.
fn drawn(link: &AssetLink, spacing: f32, degree: usize, settings: &PortraitSettings) -> Splats {
    match &link.splats {
        Some(splats) if !splats.is_empty() && splats.sh_degree == degree => splats.clone(),
        _ => dots(&link.visual.mesh, spacing, degree, settings),
    }
}

/// Opaque Gaussians all over a mesh, in the colours of its vertices or grey.
fn dots(mesh: &Mesh, spacing: f32, degree: usize, settings: &PortraitSettings) -> Splats {
    // The picture has no more pixels.
    let most = settings.side as f32;
    let mut out = Splats::empty(degree);
    let colored = mesh.colors.len() == mesh.vertices.len();
    let color = |i: u32| match colored {
        true => Vec3::from(mesh.colors[i as usize].map(f32::from)) / 255.0,
        false => Vec3::splat(settings.grey),
    };
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| Vec3::from_array(mesh.vertices[i as usize]));
        let [red, green, blue] = triangle.map(color);
        let longest = (b - a).length().max((c - a).length()).max((c - b).length());
        let n = (longest / spacing).ceil().clamp(1.0, most) as usize;
        for (i, j) in (0..n).flat_map(|i| (0..n - i).map(move |j| (i, j))) {
            let [u, v] = [i, j].map(|k| (k as f32 + 1.0 / 3.0) / n as f32);
            let base = (red + (green - red) * u + (blue - red) * v - 0.5) / SH_C0;
            out.means.push((a + (b - a) * u + (c - a) * v).to_array());
            out.rotations.push([1.0, 0.0, 0.0, 0.0]);
            out.log_scales.push([(settings.dot * spacing).ln(); 3]);
            out.logit_opacities.push(settings.opacity);
            out.sh.extend(base.to_array());
            out.sh.resize(out.means.len() * out.sh_stride(), 0.0);
        }
    }
    out
}

/// A picture of what is in the unit ball.
fn rendered(splats: &Splats, settings: &PortraitSettings) -> Texture {
    let PortraitSettings { side, view, from, .. } = *settings;
    let (half, angle) = (0.5 * f64::from(side), (0.5 * view).to_radians());
    let focal = half / angle.tan();
    let intrinsics = Intrinsics { fx: focal, fy: focal, cx: half, cy: half, width: side, height: side };
    let camera = Camera::look_at(intrinsics, from.normalize() / angle.sin(), DVec3::ZERO, DVec3::Z);
    let options = RenderOptions { sh_degree: splats.sh_degree, background: [1.0; 3], ..RenderOptions::default() };
    let mut rasterizer = Rasterizer::new();
    let frame = rasterizer.forward(splats.into(), &camera, &options);
    let plane = frame.width * frame.height;
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    let rgb = (0..plane).map(|i| [0, 1, 2].map(|c| byte(frame.rgb[c * plane + i]))).collect();
    Texture { width: side, height: side, rgb }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::TexturedMesh;

    fn at(picture: &Texture, x: u32, y: u32) -> [u8; 3] {
        assert_eq!((picture.width, picture.height), (256, 256));
        picture.rgb[(y * 256 + x) as usize]
    }

    #[test]
    fn the_object_is_in_the_middle_and_its_surroundings_are_white() {
        // A red and a green blob, 2 cm apart along Z, of an object of a few centimetres.
        let blob = |rgb: [f32; 3]| Splats {
            means: vec![[0.0; 3]],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]],
            log_scales: vec![[0.003f32.ln(); 3]],
            logit_opacities: vec![6.0],
            sh_degree: 0,
            sh: rgb.map(|v| (v - 0.5) / SH_C0).to_vec(),
        };
        let link = |z: f64, rgb| AssetLink {
            origin: DVec3::new(3.0, 1.0, z),
            splats: Some(blob(rgb)),
            ..AssetLink::default()
        };
        let links = vec![link(0.0, [1.0, 0.0, 0.0]), link(0.02, [0.0, 1.0, 0.0])];
        let picture = portrait(&Asset { links, ..Asset::default() }, &PortraitSettings::DEFAULT).unwrap();
        let (above, below) = (at(&picture, 128, 40), at(&picture, 128, 216));
        assert!(above[1] > 200 && above[0] < 100 && below[0] > 200 && below[1] < 100, "{above:?} {below:?}");
        assert_eq!(at(&picture, 3, 128), [255; 3]);
        let empty = Asset { links: vec![AssetLink::default()], ..Asset::default() };
        assert_eq!(portrait(&empty, &PortraitSettings::DEFAULT), None);
    }

    #[test]
    fn a_mesh_without_gaussians_is_drawn_in_its_colours() {
        let mesh = Mesh { colors: vec![[200, 40, 40]; 8], ..Mesh::cuboid([-0.5; 3], [0.5; 3]) };
        let visual = TexturedMesh { mesh, ..TexturedMesh::default() };
        let links = vec![AssetLink { visual, ..AssetLink::default() }];
        let picture = portrait(&Asset { links, ..Asset::default() }, &PortraitSettings::DEFAULT).unwrap();
        let middle = at(&picture, 128, 128);
        assert!(middle.iter().zip([200u8, 40, 40]).all(|(a, b)| a.abs_diff(b) < 4), "{middle:?}");
        assert_eq!(at(&picture, 3, 3), [255; 3]);
    }
}
