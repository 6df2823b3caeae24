//! Every instruction set of this machine gives the same images and gradients. One test, as the choice is process-wide.

mod common;

use artgs_raster::simd::{Instructions, use_instructions};
use artgs_raster::{Rasterizer, SplatGrads};
use common::{assert_frames_agree, assert_gradients_agree, camera, d_frame, fields, options, rng, splats};

/// Largest difference of a pixel, and of a gradient relative to the largest of its kind, from the scalar code.
const TOLERANCE: f32 = 2e-5;

#[test]
fn instruction_sets_agree_with_scalar_code_and_with_the_reference() {
    let (camera, options) = (camera(), options([0.3, 0.6, 0.1]));
    let scene = splats(&mut rng(41), 150, 3);
    let d = d_frame(&mut rng(42), 45 * 37, |_| true);
    let mut results = Vec::new();
    for instructions in Instructions::ALL {
        if !use_instructions(instructions) {
            eprintln!("this machine has no {instructions:?}");
            continue;
        }
        let (mut raster, mut grads) = (Rasterizer::new(), SplatGrads::default());
        raster.forward((&scene).into(), &camera, &options);
        raster.backward((&scene).into(), &camera, &options, &d, &mut grads);
        results.push((instructions, raster.frame().clone(), grads));
        for seed in 0..3 {
            let s = splats(&mut rng(200 + seed), 20, seed as usize + 1);
            assert_frames_agree((&s).into(), &camera, &options, &format!("{instructions:?}"));
            assert_gradients_agree((&s).into(), &camera, &options, seed, &format!("{instructions:?}"));
        }
    }
    let (scalar, frame, grads) = results.pop().expect("scalar code is always available");
    assert_eq!(scalar, Instructions::Scalar);
    assert!(results.len() >= 2 || !cfg!(target_arch = "x86_64"), "every current x86-64 has SSE 4.2");
    for (instructions, other, other_grads) in &results {
        for (a, b) in [(&frame.rgb, &other.rgb), (&frame.depth, &other.depth), (&frame.alpha, &other.alpha)] {
            let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst <= TOLERANCE, "{instructions:?}: a pixel differs by {worst}");
        }
        for ((name, a), (_, b)) in fields(&grads).into_iter().zip(fields(other_grads)) {
            let scale = a.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
            let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst <= TOLERANCE * scale, "{instructions:?}: {name} differs by {worst} of {scale}");
        }
    }
}
