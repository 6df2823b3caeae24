//! The scene of all benchmarks, stored as a seed.
#![allow(dead_code, unreachable_pub, missing_docs)]

use artgs_core::{Camera, Intrinsics, Splats};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

pub const GAUSSIANS: usize = 30_000;

/// A bumpy ball that fills about a fifth of the image; Gaussians are as large as their number asks for.
pub fn ball(gaussians: usize, seed: u64) -> Splats {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut s = Splats::empty(3);
    let finer = (0.5 * (GAUSSIANS as f32 / gaussians as f32).ln()).min(1.0);
    while s.len() < gaussians {
        let p = DVec3::from([0; 3].map(|_| rng.random_range(-1.0..1.0)));
        if !(0.1..1.0).contains(&p.length()) {
            continue;
        }
        let radius = 1.0 + 0.03 * rng.random_range(-1.0..1.0);
        s.means.push((radius * p.normalize()).as_vec3().to_array());
        s.rotations.push([0; 4].map(|_| rng.random_range(-1.0..1.0)));
        s.log_scales.push([0; 3].map(|_| finer + rng.random_range(-5.3..-3.9)));
        s.logit_opacities.push(rng.random_range(-1.5..4.0));
        s.sh.extend((0..s.sh_stride()).map(|_| rng.random_range(-0.2..0.2f32)));
    }
    s
}

pub fn camera(size: u32, turn: f64) -> Camera {
    let (f, c) = (1.1 * f64::from(size), 0.5 * f64::from(size));
    let k = Intrinsics { fx: f, fy: f, cx: c, cy: c, width: size, height: size };
    let away = DVec3::new(2.9, -3.2, 1.4);
    Camera::look_at(k, glam::DQuat::from_rotation_z(turn) * away, DVec3::ZERO, DVec3::Z)
}
