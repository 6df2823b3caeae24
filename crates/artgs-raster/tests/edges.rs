//! Degenerate scenes, and independence of the number of threads.

mod common;

use artgs_core::Splats;
use artgs_raster::{Frame, Rasterizer, SplatGrads, reference};
use common::{camera, d_frame, fields, options, rng, splats};

fn bits(f: &Frame) -> Vec<u32> {
    [&f.rgb, &f.depth, &f.alpha].into_iter().flatten().map(|x| x.to_bits()).collect()
}

fn grad_bits(g: &SplatGrads) -> Vec<u32> {
    fields(g).iter().flat_map(|(_, v)| v.iter().map(|x| x.to_bits())).collect()
}

fn one(mean: [f32; 3], log_scale: f32, logit_opacity: f32) -> Splats {
    Splats {
        means: vec![mean],
        rotations: vec![[1.0, 0.0, 0.0, 0.0]],
        log_scales: vec![[log_scale; 3]],
        logit_opacities: vec![logit_opacity],
        sh_degree: 0,
        sh: vec![1.0, 0.5, -0.5],
    }
}

fn run(s: &Splats) -> (Frame, SplatGrads) {
    let (mut raster, mut grads) = (Rasterizer::new(), SplatGrads::default());
    let options = options([0.1, 0.2, 0.3]);
    let frame = raster.forward(s.into(), &camera(), &options).clone();
    let d = d_frame(&mut rng(1), frame.alpha.len(), |_| true);
    raster.backward(s.into(), &camera(), &options, &d, &mut grads);
    assert!(grad_bits(&grads).into_iter().all(|b| f32::from_bits(b).is_finite()));
    assert!(bits(&frame).into_iter().all(|b| f32::from_bits(b).is_finite()));
    (frame, grads)
}

fn assert_empty(s: &Splats, what: &str) {
    let (frame, grads) = run(s);
    let size = frame.alpha.len();
    assert!(frame.alpha.iter().chain(&frame.depth).all(|&x| x == 0.0), "{what}");
    for (c, want) in [0.1, 0.2, 0.3].into_iter().enumerate() {
        assert!(frame.rgb[c * size..(c + 1) * size].iter().all(|&x| x == want), "{what}");
    }
    assert!(grad_bits(&grads).iter().all(|&b| f32::from_bits(b) == 0.0), "{what}");
}

#[test]
fn bits_do_not_depend_on_threads_or_history() {
    let s = splats(&mut rng(21), 6000, 2);
    let other = splats(&mut rng(22), 900, 1);
    let camera = camera().resized(203, 131);
    let options = options([0.4, 0.1, 0.0]);
    let d = d_frame(&mut rng(2), 203 * 131, |_| true);
    let render = |threads: usize, warm: bool| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (mut raster, mut grads) = (Rasterizer::new(), SplatGrads::default());
            if warm {
                let small = camera.resized(64, 300);
                raster.forward((&other).into(), &small, &options);
                let d = d_frame(&mut rng(3), 64 * 300, |_| true);
                raster.backward((&other).into(), &small, &options, &d, &mut grads);
            }
            raster.forward((&s).into(), &camera, &options);
            raster.backward((&s).into(), &camera, &options, &d, &mut grads);
            (bits(raster.frame()), grad_bits(&grads))
        })
    };
    let want = render(1, false);
    assert!(want.1.iter().filter(|&&b| b << 1 != 0).count() > 10_000, "the scene has gradients");
    for threads in [1, 2, 3] {
        assert!(render(threads, true) == want, "{threads} threads");
    }
}

#[test]
fn nothing_is_drawn_of_nothing() {
    assert_empty(&Splats::empty(3), "no Gaussians");
    assert_empty(&one([4.0, -2.5, 1.7], -2.0, 3.0), "behind the camera");
    assert_empty(&one([0.0; 3], -2.0, -6.0), "fainter than 1/255");
    assert_empty(&one([-10.0, 30.0, 0.0], -2.0, 3.0), "beside the image");
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert_empty(&one([bad, 0.0, 0.0], -2.0, 3.0), "no centre");
        let mut s = one([0.0; 3], -2.0, 3.0);
        s.rotations[0][1] = bad;
        assert_empty(&s, "no rotation");
    }
    assert_empty(&one([0.0; 3], f32::INFINITY, 3.0), "infinitely large");
    assert_empty(&one([0.0; 3], f32::NAN, 3.0), "no scale");
    assert_empty(&one([0.0; 3], -2.0, f32::NAN), "no opacity");
}

#[test]
fn a_huge_opaque_gaussian_covers_the_image() {
    let (frame, grads) = run(&one([0.0; 3], 6.0, 20.0));
    assert!(frame.alpha.iter().all(|&a| (a - 0.99).abs() < 1e-6), "alpha is held at 0.99");
    assert_eq!(grads.logit_opacities[0], 0.0, "held alpha has no gradient");
    assert!(grads.log_scales[0].iter().chain(&grads.rotations[0]).all(|&g| g == 0.0));
    assert!(grads.sh.iter().any(|&g| g != 0.0) && grads.radii[0] > 1000.0);
    let (frame, _) = run(&one([0.0; 3], -40.0, 20.0));
    assert!(frame.alpha.iter().any(|&a| a > 0.3), "a point is as large as the blur");
    let mut s = one([0.0; 3], -2.0, 1.0);
    s.rotations[0] = [0.0; 4];
    assert!(run(&s).0.alpha.iter().any(|&a| a > 0.5), "a quaternion without direction turns nothing");
}

#[test]
fn a_finished_pixel_keeps_the_gaussian_that_finished_it() {
    let mut s = Splats::empty(0);
    let camera = camera();
    let pose = camera.world_to_camera.inverse();
    for i in 0..5 {
        let mean = pose.apply(glam::DVec3::new(0.0, 0.0, 2.0 + 0.1 * f64::from(i))).as_vec3().to_array();
        s.extend_from(&one(mean, 5.0, 20.0), [0]);
    }
    // 0.01 after one, 1e-4 after two, in f32 either side of the limit; three at the most are drawn.
    let (frame, grads) = run(&s);
    assert!(frame.alpha.iter().all(|&a| a >= 0.9998), "the last one counts");
    assert!(grads.sh[9..].iter().all(|&g| g == 0.0), "what is behind does not");
}

#[test]
fn gaussians_at_one_depth_are_drawn_in_order_of_index() {
    let mut s = one([0.0; 3], -1.0, 1.5);
    s.extend_from(&one([0.0; 3], -1.0, 1.5), [0]);
    s.sh = vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let options = options([0.0; 3]);
    let mut raster = Rasterizer::new();
    let got = raster.forward((&s).into(), &camera(), &options);
    let want = reference::render((&s).into(), &camera(), &options);
    assert!(got.rgb.iter().zip(&want.rgb).all(|(a, b)| (a - b).abs() < 1e-4));
}
