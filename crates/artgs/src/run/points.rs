//! From labelled surface points to the first canonical Gaussians, and from labelled points to labelled pixels.

use crate::articulation::{MotionModel, MotionParameters};
use crate::discover::{Cloud, Discovery};
use crate::fit::densify::logit;
use crate::fit::init::random_box;
use crate::fit::{FitError, RandomInit, Region};
use crate::neighbours::PointTree;
use crate::start::StartConfig;
use crate::surface::BACKGROUND;
use artgs_core::{Camera, JointEstimate, JointKind, Rigid, Splats, State};
use glam::{DVec2, DVec3, Quat, Vec3};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Zeroth real spherical harmonic.
const SH0: f32 = 0.282_094_8;

/// Canonical Gaussians on the labelled points of both states, each point moved to the canonical frame with its part;
/// what both states show appears once. Also returns the part of each.
pub(super) fn canonical_start(found: &Discovery, config: &StartConfig) -> (Splats, Vec<u16>) {
    // Noise spreads points across the surface: their number must follow the surface.
    let planned = found.spacing * config.spacing;
    let spacing = planned.max(found.tolerance.min(2.0 * planned)) as f32;
    let mut splats = Splats::empty(config.sh_degree);
    let mut labels = Vec::new();
    for part in 0..=found.parts.len() {
        let half = if part == 0 { Rigid::IDENTITY } else { found.parts[part - 1].motion.power(0.5) };
        let mut cloud = Cloud::default();
        for state in State::ALL {
            let to_canonical = half.away_from(state);
            let members: Vec<usize> =
                (0..found.labels[state].len()).filter(|&i| found.labels[state][i] as usize == part).collect();
            cloud.append(&moved(&found.clouds[state].select(&members), &to_canonical));
        }
        let cloud = cloud.thinned(spacing);
        for i in 0..cloud.len() {
            push_disc(&mut splats, &cloud, i, spacing, config);
            labels.push(part as u16);
        }
    }
    (splats, labels)
}

/// As many Gaussians as in a labelled start, uniform in its box, near-grey and as faint as random Gaussians are, each
/// with the part of the nearest of that start.
pub(super) fn scattered(
    start: &(Splats, Vec<u16>),
    sh_degree: usize,
    rng: &mut Pcg64Mcg,
) -> Result<(Splats, Vec<u16>), FitError> {
    let (surface, labels) = start;
    let position = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    surface.means.iter().map(position).for_each(|p| (low, high) = (low.min(p), high.max(p)));
    let random = RandomInit { count: surface.len(), ..RandomInit::default() };
    let splats = random_box(&Region { low, high }, &random, sh_degree, rng)?;
    let tree = PointTree::new(&surface.means);
    let nearest = |p: &[f32; 3]| tree.nearest(p).map_or(0, |(i, _)| labels[i]);
    let labels = splats.means.par_iter().with_min_len(256).map(nearest).collect();
    Ok((splats, labels))
}

/// Labelled points as small Gaussians, for saving and for looking at.
pub(super) fn points_as_splats(cloud: &Cloud, spacing: f64) -> Splats {
    discs(cloud, spacing, &StartConfig { sh_degree: 0, ..StartConfig::default() })
}

/// Surface points `spacing` apart as flat Gaussians.
pub(super) fn discs(cloud: &Cloud, spacing: f64, config: &StartConfig) -> Splats {
    let mut splats = Splats::empty(config.sh_degree);
    (0..cloud.len()).for_each(|i| push_disc(&mut splats, cloud, i, spacing as f32, config));
    splats
}

/// Inverse of [`points_as_splats`] but for the roughness, which is not kept.
pub(super) fn splats_as_points(splats: &Splats) -> Cloud {
    let mut cloud = Cloud::default();
    let stride = splats.sh_stride();
    for i in 0..splats.len() {
        let [w, x, y, z] = splats.rotations[i];
        cloud.points.push(Vec3::from_array(splats.means[i]));
        cloud.normals.push(Quat::from_xyzw(x, y, z, w).normalize() * Vec3::Z);
        let c = &splats.sh[i * stride..i * stride + 3];
        cloud.colors.push(Vec3::new(c[0], c[1], c[2]) * SH0 + 0.5);
        cloud.roughness.push(0.0);
    }
    cloud
}

fn push_disc(splats: &mut Splats, cloud: &Cloud, i: usize, spacing: f32, config: &StartConfig) {
    let turn = Quat::from_rotation_arc(Vec3::Z, cloud.normals[i].normalize_or(Vec3::Z));
    let wide = spacing * config.spread as f32;
    splats.means.push(cloud.points[i].to_array());
    splats.rotations.push([turn.w, turn.x, turn.y, turn.z]);
    splats.log_scales.push([wide.ln(), wide.ln(), (wide * config.flatness as f32).ln()]);
    splats.logit_opacities.push(logit(config.opacity as f32));
    let sh = splats.sh.len();
    splats.sh.resize(sh + splats.sh_stride(), 0.0);
    let dc = (cloud.colors[i] - 0.5) / SH0;
    splats.sh[sh..sh + 3].copy_from_slice(&dc.to_array());
}

/// Optimiser's form of found motions. That of a part which another movable part carries is no joint in the world: it is
/// free.
pub(super) fn motion_parameters(parts: &[JointEstimate]) -> Vec<MotionParameters> {
    let model = |part: &JointEstimate| match part.kind {
        _ if part.parent > 0 => MotionModel::Free,
        JointKind::Prismatic => MotionModel::Prismatic,
        JointKind::Revolute => MotionModel::Hinge,
        JointKind::Screw => MotionModel::Screw,
    };
    parts.iter().map(|p| MotionParameters::from_motion(model(p), &p.motion)).collect()
}

fn moved(cloud: &Cloud, motion: &Rigid) -> Cloud {
    let mut out = cloud.clone();
    out.points.iter_mut().for_each(|p| *p = motion.apply(p.as_dvec3()).as_vec3());
    out.normals.iter_mut().for_each(|n| *n = motion.turn(n.as_dvec3()).as_vec3());
    out
}

/// Part of every pixel that has depth, by the nearest labelled points of the view's state; [`BACKGROUND`] elsewhere.
pub(super) fn label_pixels(cameras: &[Camera], depths: &[&[f32]], cloud: &Cloud, labels: &[u16]) -> Vec<Vec<u16>> {
    let points: Vec<[f32; 3]> = cloud.points.iter().map(|p| p.to_array()).collect();
    let tree = PointTree::new(&points);
    cameras
        .par_iter()
        .zip(depths)
        .map(|(camera, depth)| {
            let width = camera.intrinsics.width as usize;
            let label = |(i, d): (usize, &f32)| {
                if *d <= 0.0 {
                    return BACKGROUND;
                }
                let pixel = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
                let p = camera.unproject(pixel, f64::from(*d)).as_vec3().to_array();
                tree.nearest(&p).map_or(BACKGROUND, |(j, _)| labels[j])
            };
            depth.iter().enumerate().map(label).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_survive_being_splats() {
        let mut cloud = Cloud::default();
        for i in 0..20 {
            let t = i as f32;
            cloud.points.push(Vec3::new(t, t.sin(), 0.5));
            cloud.normals.push(Vec3::new(t.sin(), t.cos(), (0.3 * t).cos()).normalize());
            cloud.colors.push(Vec3::new(0.1, 0.5, t / 20.0));
            cloud.roughness.push(0.0);
        }
        let back = splats_as_points(&points_as_splats(&cloud, 0.1));
        for i in 0..20 {
            assert!(back.points[i] == cloud.points[i] && back.normals[i].dot(cloud.normals[i]) > 0.99999);
            assert!((back.colors[i] - cloud.colors[i]).length() < 1e-5);
        }
    }
}
