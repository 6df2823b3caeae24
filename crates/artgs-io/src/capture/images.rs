//! A capture from images in memory, with the checks that a folder gets.

use super::pose::rotation;
use super::views::fault;
use super::{CaptureError, check};
use artgs_core::capture::OBJECT_ALPHA;
use artgs_core::{Camera, Capture, DepthMap, Intrinsics, PerState, Rigid, StateViews, View};
use glam::{DMat3, DVec3};

/// The axes of cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraAxes {
    /// x right, y down, z forward.
    OpenCv,
    /// x right, y up, z backward: those of capture files.
    OpenGl,
}

/// One image with its camera.
#[derive(Clone, Debug)]
pub struct PosedImage {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Straight RGBA, row-major, `[height * width]`; alpha is the mask.
    pub rgba: Vec<[u8; 4]>,
    /// Planar depth, scene units, `[height * width]`; 0 or not finite: none.
    pub depth: Option<Vec<f32>>,
    /// Focal lengths and principal point (fx, fy, cx, cy), pixels.
    pub intrinsics: [f64; 4],
    /// Camera-to-world, rows first.
    pub camera_to_world: [[f64; 4]; 4],
}

/// The capture of images of both states, all of them training views. Errors name the state, the number of the image from 0 and the
/// array.
pub fn capture_of_images(states: PerState<Vec<PosedImage>>, axes: CameraAxes) -> Result<Capture, CaptureError> {
    let mut views = Vec::new();
    let mut warnings = Vec::new();
    for (state, images) in states.enumerate() {
        let opaque = !images.is_empty() && images.iter().all(|i| i.rgba.iter().all(|p| p[3] == u8::MAX));
        if opaque {
            warnings.push(format!("state {}: there is no mask; all pixels count as the object", state.name()));
        }
        let mut train = Vec::new();
        for (i, image) in images.iter().enumerate() {
            let place = format!("state {}, image {i}", state.name());
            let view = view(image, axes, &place)?;
            if image.rgba.iter().all(|p| p[3] < OBJECT_ALPHA) {
                warnings.push(format!("{place}: ignored, its mask is empty"));
            } else {
                train.push(view);
            }
        }
        if train.len() < 2 {
            let reason = format!("{} usable images; two are needed at least", train.len());
            return Err(CaptureError::Image { place: format!("state {}", state.name()), reason });
        }
        views.push(StateViews { train, test: Vec::new() });
    }
    let mut views = views.into_iter();
    let states = PerState::from_fn(|_| views.next().unwrap_or_default());
    check::depth_is_everywhere(&states, &mut warnings);
    check::states_overlap(&states)?;
    Ok(Capture { states, warnings, ..Capture::default() })
}

fn view(image: &PosedImage, axes: CameraAxes, place: &str) -> Result<View, CaptureError> {
    let fail = |reason: String| CaptureError::Image { place: place.into(), reason };
    let [width, height] = image.size;
    let pixels = width as usize * height as usize;
    let lengths = [Some(image.rgba.len()), image.depth.as_ref().map(Vec::len)];
    if pixels == 0 || lengths.into_iter().flatten().any(|n| n != pixels) {
        return Err(fail(format!("colours and depth must have {width}x{height} pixels, and at least one")));
    }
    let [fx, fy, cx, cy] = image.intrinsics;
    let intrinsics = Intrinsics { fx, fy, cx, cy, width, height };
    if let Some(fault) = fault(&intrinsics) {
        return Err(fail(fault));
    }
    let m = &image.camera_to_world;
    if m.iter().flatten().any(|v| !v.is_finite()) || m[3] != [0.0, 0.0, 0.0, 1.0] {
        return Err(fail("`camera_to_world` must be finite with the last row 0 0 0 1".into()));
    }
    let row = |i: usize| DVec3::new(m[i][0], m[i][1], m[i][2]);
    let block = DMat3::from_cols(row(0), row(1), row(2)).transpose();
    let block = rotation(block).map_err(|reason| fail(format!("`camera_to_world`: {reason}")))?;
    let flip = match axes {
        CameraAxes::OpenCv => DMat3::IDENTITY,
        CameraAxes::OpenGl => DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)),
    };
    let pose = Rigid::from_matrix(block * flip, DVec3::new(m[0][3], m[1][3], m[2][3]));
    let masked = |(z, p): (&f32, &[u8; 4])| if p[3] < OBJECT_ALPHA { 0.0 } else { *z };
    let depth = image.depth.as_ref().map(|depth| depth.iter().zip(&image.rgba).map(masked).collect::<Vec<_>>());
    Ok(View {
        name: place.into(),
        camera: Camera { intrinsics, world_to_camera: pose.inverse() },
        rgba: image.rgba.clone(),
        depth: depth.map(|depth| DepthMap::nearest(&depth)),
        derived: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::opengl_pose;

    fn image(x: f64, axes: CameraAxes) -> PosedImage {
        let k = Intrinsics { fx: 8.0, fy: 8.0, cx: 4.0, cy: 3.0, width: 8, height: 6 };
        let camera = Camera::look_at(k, DVec3::new(x, -3.0, 1.0), DVec3::ZERO, DVec3::Z);
        let mut pose = opengl_pose(&camera);
        if axes == CameraAxes::OpenCv {
            pose[..3].iter_mut().for_each(|row| row[1..3].iter_mut().for_each(|v| *v = -*v));
        }
        let rgba = (0..48).map(|p| [p, 2, 3, if p < 8 { 0 } else { 255 }]).collect();
        PosedImage {
            size: [8, 6],
            rgba,
            depth: Some(vec![3.0; 48]),
            intrinsics: [8.0, 8.0, 4.0, 3.0],
            camera_to_world: pose,
        }
    }

    fn images(axes: CameraAxes) -> PerState<Vec<PosedImage>> {
        PerState::from_fn(|_| vec![image(0.0, axes), image(1.0, axes)])
    }

    #[test]
    fn both_axes_give_the_same_cameras_and_masks_remove_depth() {
        let [a, b] =
            [CameraAxes::OpenCv, CameraAxes::OpenGl].map(|axes| capture_of_images(images(axes), axes).unwrap());
        for (a, b) in a.states.iter().zip(b.states.iter()) {
            for (a, b) in a.train.iter().zip(&b.train) {
                let p = DVec3::new(0.1, 0.2, 0.3);
                assert!(a.camera.project(p).0.distance(b.camera.project(p).0) < 1e-9);
                assert!((a.camera.project(DVec3::ZERO).0 - glam::DVec2::new(4.0, 3.0)).length() < 1e-9);
                let depth = a.depth.as_ref().unwrap();
                assert_eq!((depth.at(0), depth.at(47)), (0.0, 3.0));
            }
        }
        assert!(a.warnings.is_empty());
    }

    #[test]
    fn what_cannot_be_used_is_refused_with_its_place() {
        let refused = |change: &dyn Fn(&mut PosedImage), words: &str| {
            let mut images = images(CameraAxes::OpenCv);
            change(&mut images[artgs_core::State::END][1]);
            let error = capture_of_images(images, CameraAxes::OpenCv).unwrap_err().to_string();
            assert!(error.contains("state end") && error.contains(words), "{error}");
        };
        refused(&|i| i.camera_to_world[0][0] = 2.0, "camera_to_world");
        refused(&|i| i.camera_to_world[3][0] = 1.0, "last row");
        refused(&|i| i.intrinsics[0] = 0.0, "focal length");
        refused(&|i| i.rgba.truncate(47), "8x6 pixels");
        refused(&|i| i.rgba.iter_mut().for_each(|p| p[3] = 0), "1 usable images");
    }
}
