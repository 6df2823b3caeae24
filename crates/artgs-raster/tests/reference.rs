//! The fast rasteriser against the f64 reference.

mod common;

use artgs_raster::{Colors, RenderOptions, ShFrames, SplatView, reference};
use common::{assert_frames_agree, assert_gradients_agree, camera, options, rng, splats};
use rand::RngExt;

#[test]
fn frames_agree_with_the_reference() {
    for seed in 0..24 {
        let s = splats(&mut rng(seed), 12 + 6 * seed as usize, seed as usize % 4);
        let background = if seed % 2 == 0 { [0.0; 3] } else { [0.9, 0.2, 0.5] };
        assert_frames_agree((&s).into(), &camera(), &options(background), &format!("seed {seed}"));
    }
}

#[test]
fn gradients_agree_with_the_reference_for_every_degree() {
    for seed in 0..8 {
        let s = splats(&mut rng(100 + seed), 18, seed as usize % 4);
        assert_gradients_agree((&s).into(), &camera(), &options([0.3, 0.6, 0.1]), seed, &format!("seed {seed}"));
    }
}

#[test]
fn gradients_agree_with_the_reference_below_the_stored_degree() {
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
