//! The fast rasteriser against the f64 oracle.

mod common;

use artgs_core::Camera;
use artgs_raster::{Colors, Frame, Rasterizer, RenderOptions, ShFrames, SplatGrads, SplatView, reference};
use common::{camera, d_frame, fields, options, rng, splats};
use rand::RngExt;

/// Below this relative distance of a decision from flipping, f32 may decide otherwise.
const MARGIN: f64 = 1e-3;

fn planes(f: &Frame) -> [&[f32]; 3] {
    [&f.rgb, &f.depth, &f.alpha]
}

fn assert_frames_agree(view: SplatView<'_>, camera: &Camera, options: &RenderOptions, what: &str) {
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

fn assert_gradients_agree(view: SplatView<'_>, camera: &Camera, options: &RenderOptions, seed: u64, what: &str) {
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
                // The oracle asks whether a pixel was reached, the rasteriser whether a tile was.
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

#[test]
fn frames_agree_with_the_oracle() {
    for seed in 0..24 {
        let s = splats(&mut rng(seed), 12 + 6 * seed as usize, seed as usize % 4);
        let background = if seed % 2 == 0 { [0.0; 3] } else { [0.9, 0.2, 0.5] };
        assert_frames_agree((&s).into(), &camera(), &options(background), &format!("seed {seed}"));
    }
}

#[test]
fn gradients_agree_with_the_oracle_for_every_degree() {
    for seed in 0..8 {
        let s = splats(&mut rng(100 + seed), 18, seed as usize % 4);
        assert_gradients_agree((&s).into(), &camera(), &options([0.3, 0.6, 0.1]), seed, &format!("seed {seed}"));
    }
}

#[test]
fn gradients_agree_with_the_oracle_below_the_stored_degree() {
    let s = splats(&mut rng(7), 14, 3);
    for sh_degree in 0..3 {
        let options = RenderOptions { sh_degree, ..options([0.0; 3]) };
        assert_frames_agree((&s).into(), &camera(), &options, "lower degree");
        assert_gradients_agree((&s).into(), &camera(), &options, 5, "lower degree");
    }
}

#[test]
fn harmonics_turn_with_their_frames() {
    let mut random = rng(11);
    let s = splats(&mut random, 16, 3);
    let index: Vec<u16> = (0..s.len()).map(|i| (i % 3) as u16).collect();
    let world_to_frame: Vec<_> = (0..3)
        .map(|_| {
            let axis = glam::DVec3::from([0; 3].map(|_| random.random_range(-1.0..1.0))).normalize();
            let m = glam::DMat3::from_axis_angle(axis, random.random_range(0.3..2.5)).as_mat3();
            m.transpose().to_cols_array_2d()
        })
        .collect();
    let frames = Some(ShFrames { index: &index, world_to_frame: &world_to_frame });
    let view = SplatView { colors: Colors::Sh { sh: &s.sh, degree: 3, frames }, ..(&s).into() };
    assert_frames_agree(view, &camera(), &options([0.2; 3]), "frames");
    assert_gradients_agree(view, &camera(), &options([0.2; 3]), 3, "frames");
    let plain = reference::render((&s).into(), &camera(), &options([0.2; 3]));
    let turned = reference::render(view, &camera(), &options([0.2; 3]));
    assert!(plain.rgb.iter().zip(&turned.rgb).any(|(a, b)| (a - b).abs() > 0.05), "the frames matter");
}

#[test]
fn fixed_colours_are_drawn_as_they_are() {
    let s = splats(&mut rng(12), 20, 0);
    let colors: Vec<[f32; 3]> = (0..s.len()).map(|i| [i as f32 - 9.0, 0.25, -2.0]).collect();
    let view = SplatView { colors: Colors::Fixed(&colors), ..(&s).into() };
    assert_gradients_agree(view, &camera(), &options([0.0; 3]), 4, "fixed");
    let s = splats(&mut rng(13), 20, 0);
    let colors: Vec<[f32; 3]> = (0..s.len()).map(|i| [i as f32 / 20.0, 0.25, -0.5]).collect();
    assert_frames_agree(
        SplatView { colors: Colors::Fixed(&colors), ..(&s).into() },
        &camera(),
        &options([0.0; 3]),
        "fixed",
    );
}

/// Wide Gaussians whose centres lie beyond the range in which the Jacobian follows the point.
#[test]
fn gradients_stop_at_the_limits_of_the_jacobian() {
    let camera = camera();
    let mut s = splats(&mut rng(14), 6, 1);
    let pose = camera.world_to_camera.inverse();
    for (i, p) in
        [[-1.3, 0.1, 2.0], [1.5, 0.2, 2.05], [0.1, -1.6, 2.1], [0.0, 1.3, 1.9], [1.6, 1.4, 1.95], [0.3, 0.1, 1.5]]
            .into_iter()
            .enumerate()
    {
        s.means[i] = pose.apply(p.into()).as_vec3().to_array();
        s.log_scales[i] = [-0.9 + 0.1 * i as f32, -0.9, -0.6];
        s.logit_opacities[i] = 0.5;
    }
    assert_frames_agree((&s).into(), &camera, &options([0.0; 3]), "limits");
    assert_gradients_agree((&s).into(), &camera, &options([0.0; 3]), 6, "limits");
}

#[test]
#[ignore = "ten seconds: many random scenes"]
fn fuzz() {
    for seed in 1000..1400 {
        let mut random = rng(seed);
        let n = random.random_range(1..60);
        let s = splats(&mut random, n, seed as usize % 4);
        let mut camera = camera();
        let (width, height) = (random.random_range(1..70), random.random_range(1..70));
        camera = camera.resized(width, height);
        camera.intrinsics.cx += random.random_range(-10.0..10.0);
        let options = options([0; 3].map(|_| random.random_range(0.0..1.0)));
        assert_gradients_agree((&s).into(), &camera, &options, seed, &format!("fuzz {seed}"));
    }
}
