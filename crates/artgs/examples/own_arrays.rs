//! Own images and cameras as a capture: arrays of pixels, depth and poses, without files.

#![allow(clippy::print_stdout, reason = "an example prints")]

use artgs::prelude::*;
use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};

/// An image as other programs hold it.
struct Image {
    /// Straight RGBA, row-major; alpha is 0 where the object is not.
    rgba: Vec<[u8; 4]>,
    /// Distance along the viewing direction, scene units, row-major; 0 where unknown.
    depth: Vec<f32>,
    /// Focal lengths and principal point, pixels; the centre of the first pixel is at (0.5, 0.5).
    k: [f64; 4],
    /// Width and height, pixels.
    size: [u32; 2],
    /// World to camera: x right, y down, z forward.
    world_to_camera: artgs_core::Rigid,
}

fn view(name: &str, image: Image) -> View {
    let [fx, fy, cx, cy] = image.k;
    let [width, height] = image.size;
    let intrinsics = Intrinsics { fx, fy, cx, cy, width, height };
    let camera = Camera { intrinsics, world_to_camera: image.world_to_camera };
    View::new(name, camera, image.rgba, Some(DepthMap::nearest(&image.depth)))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let views = images()?.map(|images| {
        let views = images.into_iter().enumerate();
        views.map(|(i, image)| view(&format!("image {i}"), image)).collect()
    });
    let capture = Capture::new(views);
    let prepared = Request::new(Input::Images(capture)).prepare(&mut NullObserver)?;
    let found = Reconstruction::new(&prepared).find_parts(&mut NullObserver)?;
    println!("{} movable parts", found.parts.len());
    Ok(())
}

/// Rendered images in place of your own.
fn images() -> Result<PerState<Vec<Image>>, Box<dyn std::error::Error>> {
    let options = CabinetOptions { views: 20, test_views: 0, size: 96, ..CabinetOptions::default() };
    let image = |view: View| {
        let k = view.camera.intrinsics;
        Image {
            rgba: view.rgba,
            depth: view.depth.map(|depth| depth.iter().collect()).unwrap_or_default(),
            k: [k.fx, k.fy, k.cx, k.cy],
            size: [k.width, k.height],
            world_to_camera: view.camera.world_to_camera,
        }
    };
    let states = cabinet_capture(&options)?.0.states;
    Ok(states.map(|views| views.train.into_iter().map(image).collect()))
}
