//! Renderings of the cabinet: ray casting against its boxes, colours averaged over each pixel, depth of its centre.

use super::scene::{Cabinet, Cuboid};
use artgs_core::{Camera, Rigid, State};
use glam::{DMat3, DVec2, DVec3};

/// Rays per pixel edge; odd, so that the middle one is the pixel centre.
const SAMPLES: usize = 3;

/// A rendering, row-major, `[height * width]` each.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// Straight sRGB colour; alpha is the covered fraction of the pixel.
    pub rgba: Vec<[u8; 4]>,
    /// Planar depth of the pixel centre, scene units, 0 without a surface or if less than half the pixel is covered.
    pub depth: Vec<f64>,
    /// 0 where there is no depth, else 1 + the part that the pixel centre sees.
    pub labels: Vec<u8>,
}

/// Intersection of a ray with the cabinet.
struct Hit {
    depth: f64,
    part: usize,
    color: DVec3,
}

/// A part as seen by one camera: rays are cast in the part's own frame, where its boxes are parallel to the axes.
struct PosedPart<'a> {
    pose: Rigid,
    eye: DVec3,
    camera_to_part: DMat3,
    bounds: (DVec3, DVec3),
    cuboids: &'a [Cuboid],
}

/// Renders the cabinet in a state.
pub fn render(cabinet: &Cabinet, state: State, camera: &Camera) -> Rendering {
    let k = &camera.intrinsics;
    let (width, height) = (k.width as usize, k.height as usize);
    let parts = posed_parts(cabinet, state, camera);
    let mut out = Rendering {
        rgba: vec![[0; 4]; width * height],
        depth: vec![0.0; width * height],
        labels: vec![0; width * height],
    };
    for index in 0..width * height {
        let corner = DVec2::new((index % width) as f64, (index / width) as f64);
        let (mut sum, mut covered) = (DVec3::ZERO, 0usize);
        for sample in 0..SAMPLES * SAMPLES {
            let offset = DVec2::new((sample % SAMPLES) as f64, (sample / SAMPLES) as f64) + 0.5;
            let pixel = corner + offset / SAMPLES as f64;
            let ray = DVec3::new((pixel.x - k.cx) / k.fx, (pixel.y - k.cy) / k.fy, 1.0);
            let Some(hit) = cast(&parts, cabinet.seed, ray) else { continue };
            sum += hit.color;
            covered += 1;
            if sample == SAMPLES * SAMPLES / 2 {
                out.depth[index] = hit.depth;
                out.labels[index] = 1 + hit.part as u8;
            }
        }
        if covered > 0 {
            let rgb = (sum / covered as f64 * 255.0).round().clamp(DVec3::ZERO, DVec3::splat(255.0));
            let alpha = (255.0 * covered as f64 / (SAMPLES * SAMPLES) as f64).round();
            out.rgba[index] = [rgb.x as u8, rgb.y as u8, rgb.z as u8, alpha as u8];
        }
        if covered * 2 < SAMPLES * SAMPLES {
            (out.depth[index], out.labels[index]) = (0.0, 0);
        }
    }
    out
}

fn posed_parts<'a>(cabinet: &'a Cabinet, state: State, camera: &Camera) -> Vec<PosedPart<'a>> {
    let camera_to_world = camera.world_to_camera.inverse();
    let posed = |(index, part): (usize, &'a super::scene::CabinetPart)| {
        let pose = cabinet.pose(index, state);
        let camera_to_part = pose.inverse() * camera_to_world;
        let low = part.cuboids.iter().fold(DVec3::INFINITY, |m, c| m.min(c.center - c.half));
        let high = part.cuboids.iter().fold(DVec3::NEG_INFINITY, |m, c| m.max(c.center + c.half));
        PosedPart {
            pose,
            eye: camera_to_part.translation,
            camera_to_part: camera_to_part.matrix(),
            bounds: ((low + high) / 2.0, (high - low) / 2.0),
            cuboids: &part.cuboids,
        }
    };
    cabinet.parts.iter().enumerate().map(posed).collect()
}

/// Nearest hit of a ray whose direction, in camera axes, has z = 1, so that distances along it are planar depths.
fn cast(parts: &[PosedPart], seed: u64, ray: DVec3) -> Option<Hit> {
    let mut best: Option<(f64, usize, &Cuboid, usize, DVec3)> = None;
    for (index, part) in parts.iter().enumerate() {
        let direction = part.camera_to_part * ray;
        let direction = DVec3::from_array(direction.to_array().map(|v| if v.abs() < 1e-12 { 1e-12 } else { v }));
        let inverse = direction.recip();
        let limit = best.map_or(f64::INFINITY, |b| b.0);
        if slab(part.eye - part.bounds.0, inverse, part.bounds.1).is_none_or(|(t, _)| t >= limit) {
            continue;
        }
        for cuboid in part.cuboids {
            if let Some((t, axis)) = slab(part.eye - cuboid.center, inverse, cuboid.half)
                && best.is_none_or(|b| t < b.0)
            {
                best = Some((t, index, cuboid, axis, direction));
            }
        }
    }
    let (depth, part, cuboid, axis, direction) = best?;
    let point = parts[part].eye + direction * depth;
    let normal = parts[part].pose.turn(DVec3::AXES[axis] * -direction[axis].signum());
    Some(Hit { depth, part, color: cuboid.material.color(point, seed) * light(normal) })
}

/// Distance at which a ray enters a box around the origin, and the axis of the face it enters through. None if the ray
/// starts inside or misses.
fn slab(from: DVec3, inverse: DVec3, half: DVec3) -> Option<(f64, usize)> {
    let (middle, reach) = (-from * inverse, inverse.abs() * half);
    let (enter, leave) = (middle - reach, middle + reach);
    let t = enter.max_element();
    (t > 0.0 && t <= leave.min_element()).then(|| (t, enter.max_position()))
}

/// Brightness of a surface with this outward normal. The lamps are fixed in the world: moving parts change their shading,
/// static ones look the same from every camera.
fn light(normal: DVec3) -> f64 {
    let key = DVec3::new(0.35, -0.75, 0.55).normalize();
    let fill = DVec3::new(-0.8, 0.3, 0.5).normalize();
    0.45 + 0.40 * normal.dot(key).max(0.0) + 0.15 * normal.dot(fill).max(0.0) + 0.08 * normal.z
}
