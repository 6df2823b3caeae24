//! Random scenes for the tests, and comparisons with the reference.
#![allow(dead_code, unreachable_pub, missing_docs)]

use artgs_core::{Camera, Intrinsics, Splats};
use artgs_raster::{Frame, FrameGrad, Rasterizer, RenderOptions, SplatGrads, SplatView, reference};
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

/// Random gradient of every plane; zero where `keep` is false.
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

/// Below this relative distance of a decision from flipping, f32 may decide otherwise.
const MARGIN: f64 = 1e-3;

fn planes(f: &Frame) -> [&[f32]; 3] {
    [&f.rgb, &f.depth, &f.alpha]
}

pub fn assert_frames_agree(view: SplatView<'_>, camera: &Camera, options: &RenderOptions, what: &str) {
    let want = reference::render_checked(view, camera, options);
    let mut raster = Rasterizer::new();
    let got = raster.forward(view, camera, options);
    let size = got.width * got.height;
    let trusted = want.margin.iter().filter(|&&m| m > MARGIN).count();
    assert!(trusted * 10 >= size * 7, "{what}: only {trusted} of {size} pixels are away from decisions");
    for (got, want_plane) in planes(got).into_iter().zip(planes(&want.frame)) {
        assert_eq!(got.len(), want_plane.len());
        for (i, (a, b)) in got.iter().zip(want_plane).enumerate() {
            let limit = if want.margin[i % size] > MARGIN { 1e-4 } else { 0.05 };
            assert!((a - b).abs() <= limit, "{what}: pixel {i}: {a} instead of {b}");
        }
    }
}

pub fn assert_gradients_agree(view: SplatView<'_>, camera: &Camera, options: &RenderOptions, seed: u64, what: &str) {
    let margin = reference::render_checked(view, camera, options).margin;
    let d = d_frame(&mut rng(seed), margin.len(), |p| margin[p] > MARGIN);
    let want = reference::gradients(view, camera, options, &d);
    let (mut raster, mut got) = (Rasterizer::new(), SplatGrads::default());
    raster.forward(view, camera, options);
    raster.backward(view, camera, options, &d, &mut got);
    for ((name, got), (_, want)) in fields(&got).into_iter().zip(fields(&want)) {
        assert_eq!(got.len(), want.len(), "{what}: {name}");
        let scale = want.iter().map(|x| x.abs()).sum::<f32>() / want.len().max(1) as f32;
        for (i, (a, b)) in got.iter().zip(want).enumerate() {
            if name == "radii" && *a == 0.0 {
                // The reference counts Gaussians that reach a pixel, the rasteriser those that reach a tile.
                assert_eq!(*b, 0.0, "{what}: radius {i}");
            } else if name != "radii" || *b > 0.0 {
                assert!(
                    (a - b).abs() <= 1e-3 * b.abs() + 1e-4 * scale,
                    "{what}: {name}[{i}]: {a} instead of {b}, typically {scale}"
                );
            }
        }
    }
}
