//! Points of noisy depth, moved onto the surfaces that their neighbours form.

use super::cloud::{Cloud, IndexedCloud};
use super::plane_fit::fit_plane;
use glam::Vec3;
use rayon::prelude::*;

/// The cloud with every point on the plane through its neighbours on the same surface, thinned to `spacing` again: where
/// noise spreads points across a surface, more than one is left of each place. Points farther than `tolerance` from the
/// tangent plane of a point are on another surface.
pub(super) fn flattened(cloud: &Cloud, spacing: f32, tolerance: f32) -> Cloud {
    /// Radius of a neighbourhood, spacings, and the largest number of points in it.
    const REACH: f32 = 2.5;
    const NEIGHBOURS: usize = 48;
    /// Points whose normals differ more are on another surface: cosine.
    const SAME_SURFACE: f32 = 0.7;
    /// Fewer points do not give a plane.
    const LEAST: usize = 8;
    let indexed = IndexedCloud::new(cloud);
    let limit = (REACH * spacing).powi(2);
    let moved: Vec<(Vec3, Vec3, f32)> = (0..cloud.len())
        .into_par_iter()
        .with_min_len(256)
        .map_init(Vec::new, |near, i| {
            let (p, n) = (cloud.points[i], cloud.normals[i]);
            near.clear();
            indexed.nearest_n(p, NEIGHBOURS, limit, |j, _| {
                let offset = cloud.points[j] - p;
                if cloud.normals[j].dot(n) > SAME_SURFACE && offset.dot(n).abs() < tolerance {
                    near.push(offset);
                }
            });
            if near.len() < LEAST {
                return (p, n, cloud.roughness[i]);
            }
            let (normal, roughness) = fit_plane(near);
            let normal = if normal.dot(n) < 0.0 { -normal } else { normal };
            let mean = near.iter().sum::<Vec3>() / near.len() as f32;
            if normal.dot(n) < SAME_SURFACE {
                return (p, n, cloud.roughness[i]);
            }
            (p + normal * mean.dot(normal).clamp(-tolerance, tolerance), normal, roughness)
        })
        .collect();
    let mut out = cloud.clone();
    for (i, (point, normal, roughness)) in moved.into_iter().enumerate() {
        (out.points[i], out.normals[i], out.roughness[i]) = (point, normal, roughness);
    }
    out.thinned(spacing)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// Two noisy walls that meet at an edge.
    fn corner(noise: f32) -> Cloud {
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        let mut cloud = Cloud::default();
        for i in 0..20_000 {
            let [u, v] = [0; 2].map(|_| rng.random_range(0.0..1.0_f32));
            let off = noise * (0..12).map(|_| rng.random_range(-0.5..0.5_f32)).sum::<f32>();
            let (point, normal) =
                if i % 2 == 0 { (Vec3::new(off, u, v), Vec3::X) } else { (Vec3::new(u, off, v), Vec3::Y) };
            cloud.points.push(point);
            cloud.normals.push(normal);
            cloud.colors.push(Vec3::ONE);
            cloud.roughness.push(noise);
        }
        cloud.thinned(0.02)
    }

    fn error(cloud: &Cloud) -> f32 {
        let off = |p: &Vec3| p.x.abs().min(p.y.abs());
        (cloud.points.iter().map(|p| off(p).powi(2)).sum::<f32>() / cloud.len() as f32).sqrt()
    }

    #[test]
    fn noise_across_surfaces_becomes_one_layer() {
        let (exact, given) = (corner(0.0), corner(0.006));
        let found = flattened(&given, 0.02, 0.024);
        assert!(error(&found) < 0.5 * error(&given), "{} {}", error(&found), error(&given));
        assert!(given.len() > 3 * exact.len() / 2, "{} {}", given.len(), exact.len());
        assert!(found.len() < 5 * exact.len() / 4, "{} {}", found.len(), exact.len());
        assert!(found.normals.iter().all(|n| n.x.max(n.y) > 0.9));
    }
}
