//! Random scenes for the tests.
#![allow(dead_code, unreachable_pub, missing_docs)]

use artgs_core::{Camera, Intrinsics, Splats};
use artgs_raster::{FrameGrad, RenderOptions, SplatGrads};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

pub fn rng(seed: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(seed)
}

/// Odd sizes, unequal focal lengths, principal point off the centre.
pub fn camera() -> Camera {
    let k = Intrinsics { fx: 52.0, fy: 44.0, cx: 19.5, cy: 21.25, width: 45, height: 37 };
    Camera::look_at(k, DVec3::new(1.9, -1.2, 0.8), DVec3::new(0.05, 0.02, -0.03), DVec3::Z)
}

/// Gaussians about the origin, some of them elongated, faint, saturated or beyond the border of the image.
pub fn splats(rng: &mut Pcg64Mcg, n: usize, degree: usize) -> Splats {
    let mut s = Splats::empty(degree);
    for i in 0..n {
        let reach = if i % 8 == 7 { 2.2 } else { 0.6 };
        s.means.push([0; 3].map(|_| rng.random_range(-reach..reach)));
        s.rotations.push([0; 4].map(|_| rng.random_range(-1.0..1.0)));
        s.log_scales.push([0; 3].map(|_| rng.random_range(-4.0..-1.2)));
        s.logit_opacities.push(if i % 9 == 8 { 6.0 } else { rng.random_range(-4.0..3.0) });
        s.sh.extend((0..s.sh_stride()).map(|_| rng.random_range(-0.6..0.6f32)));
    }
    s
}

pub fn options(background: [f32; 3]) -> RenderOptions {
    RenderOptions { background, near: 0.2, ..RenderOptions::default() }
}

/// Random gradient of every plane; zero where `keep` says no.
pub fn d_frame(rng: &mut Pcg64Mcg, size: usize, keep: impl Fn(usize) -> bool) -> FrameGrad {
    let mut plane = |n: usize| -> Vec<f32> {
        (0..n).map(|i| rng.random_range(-1.0..1.0f32) * f32::from(u8::from(keep(i % size)))).collect()
    };
    FrameGrad { rgb: plane(3 * size), depth: plane(size), alpha: plane(size) }
}

/// Every field as plain floats with its name.
pub fn fields(g: &SplatGrads) -> [(&'static str, &[f32]); 7] {
    [
        ("means", g.means.as_flattened()),
        ("rotations", g.rotations.as_flattened()),
        ("log_scales", g.log_scales.as_flattened()),
        ("logit_opacities", &g.logit_opacities),
        ("sh", &g.sh),
        ("mean2d", &g.mean2d),
        ("radii", &g.radii),
    ]
}
