//! A picture of an asset, drawn from its Gaussians.

use artgs_core::{Asset, Camera, Intrinsics, Rigid, Splats, Texture};
use artgs_raster::{Rasterizer, RenderOptions};
use glam::DVec3;

/// Pixels of a side.
const SIDE: u32 = 256;
/// Field of view, degrees.
const VIEW: f64 = 30.0;
/// Direction from the object to the camera: in front, from the right and above.
const FROM: DVec3 = DVec3::new(0.6, -1.0, 0.5);

/// The asset at joint values 0 in front of white; none without Gaussians.
pub(crate) fn portrait(asset: &Asset) -> Option<Texture> {
    let poses = asset.poses(&vec![0.0; asset.links.len()]);
    let shown = || asset.links.iter().zip(&poses).filter_map(|(link, pose)| Some((link.splats.as_ref()?, pose)));
    let centers = shown()
        .flat_map(|(splats, pose)| splats.means.iter().map(|mean| pose.apply(DVec3::from_array(mean.map(f64::from)))));
    let [low, high] = centers.map(|p| [p, p]).reduce(|[l, h], [p, _]| [l.min(p), h.max(p)])?;
    let (middle, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
    if !(radius > 0.0 && radius.is_finite()) {
        return None;
    }
    // The rasteriser drops what is near, so the object gets the size of a unit ball.
    let degree = shown().map(|(splats, _)| splats.sh_degree).max()?;
    let mut whole = Splats::empty(degree);
    for (splats, pose) in shown().filter(|(splats, _)| splats.sh_degree == degree) {
        let to_ball = Rigid { translation: (pose.translation - middle) / radius, ..*pose };
        whole.extend_from(&artgs_raster::moved(splats, &to_ball, 1.0 / radius), 0..splats.len());
    }
    let half = 0.5 * f64::from(SIDE);
    let focal = half / (0.5 * VIEW).to_radians().tan();
    let intrinsics = Intrinsics { fx: focal, fy: focal, cx: half, cy: half, width: SIDE, height: SIDE };
    let eye = FROM.normalize() / (0.5 * VIEW).to_radians().sin();
    let camera = Camera::look_at(intrinsics, eye, DVec3::ZERO, DVec3::Z);
    let options = RenderOptions { sh_degree: degree, background: [1.0; 3], ..RenderOptions::default() };
    let mut rasterizer = Rasterizer::new();
    let frame = rasterizer.forward((&whole).into(), &camera, &options);
    let plane = frame.width * frame.height;
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    let rgb = (0..plane).map(|i| [0, 1, 2].map(|c| byte(frame.rgb[c * plane + i]))).collect();
    Some(Texture { width: SIDE, height: SIDE, rgb })
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::AssetLink;

    #[test]
    fn the_object_is_in_the_middle_and_its_surroundings_are_white() {
        // A red and a green blob of 1 cm, 2 cm apart along Z, of an object of a few centimetres.
        let blob = |rgb: [f32; 3]| Splats {
            means: vec![[0.0; 3]],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]],
            log_scales: vec![[0.005f32.ln(); 3]],
            logit_opacities: vec![6.0],
            sh_degree: 0,
            sh: rgb.map(|v| (v - 0.5) / 0.282_094_8).to_vec(),
        };
        let link = |z: f64, rgb| AssetLink {
            origin: DVec3::new(3.0, 1.0, z),
            splats: Some(blob(rgb)),
            ..AssetLink::default()
        };
        let links = vec![link(0.0, [1.0, 0.0, 0.0]), link(0.02, [0.0, 1.0, 0.0])];
        let picture = portrait(&Asset { links, ..Asset::default() }).unwrap();
        let at = |x: u32, y: u32| picture.rgb[(y * SIDE + x) as usize];
        assert_eq!((picture.width, picture.height, at(3, 128)), (SIDE, SIDE, [255; 3]));
        let (above, below) = (at(128, 40), at(128, 216));
        assert!(above[1] > 200 && above[0] < 100 && below[0] > 200 && below[1] < 100, "{above:?} {below:?}");
        assert_eq!(portrait(&Asset { links: vec![AssetLink::default()], ..Asset::default() }), None);
    }
}
