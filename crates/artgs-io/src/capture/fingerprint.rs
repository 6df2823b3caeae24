//! Whether two captures are the same.

use artgs_core::{Capture, View};
use std::hash::Hasher;
use twox_hash::XxHash3_64;

/// Hash of everything that the training views hold: names, cameras, pixels and depth.
pub fn fingerprint(capture: &Capture) -> String {
    let mut hash = XxHash3_64::new();
    capture.states.iter().flat_map(|s| &s.train).for_each(|view| add(view, &mut hash));
    format!("{:016x}\n", hash.finish())
}

fn add(view: &View, hash: &mut XxHash3_64) {
    hash.write(view.name.as_bytes());
    let (pose, k) = (&view.camera.world_to_camera, &view.camera.intrinsics);
    let numbers =
        pose.rotation.to_array().into_iter().chain(pose.translation.to_array()).chain([k.fx, k.fy, k.cx, k.cy]);
    numbers.for_each(|x| hash.write(&x.to_le_bytes()));
    hash.write(&k.width.to_le_bytes());
    hash.write(&k.height.to_le_bytes());
    hash.write(view.rgba.as_flattened());
    for depth in [&view.depth, &view.derived].into_iter().flatten() {
        hash.write(&depth.per_unit().to_le_bytes());
        let mut bytes = Vec::with_capacity(2 * CHUNK);
        for counts in depth.counts().chunks(CHUNK) {
            bytes.clear();
            counts.iter().for_each(|count| bytes.extend_from_slice(&count.to_le_bytes()));
            hash.write(&bytes);
        }
    }
}

/// Depth values that are hashed at once.
const CHUNK: usize = 8192;

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{Camera, DepthMap, Intrinsics, PerState, State};
    use glam::DVec3;

    fn capture() -> Capture {
        let intrinsics = Intrinsics { fx: 20.0, fy: 21.0, cx: 4.0, cy: 3.5, width: 16, height: 9 };
        let camera = Camera::look_at(intrinsics, DVec3::new(1.0, 0.5, 2.0), DVec3::ZERO, DVec3::Y);
        let view = || {
            let depth: Vec<f32> = (0..144).map(|p| 1.0 + 0.01 * p as f32).collect();
            View::new("a", camera, vec![[9, 8, 7, 255]; 144], Some(DepthMap::nearest(&depth)))
        };
        Capture::new(PerState::from_fn(|_| vec![view(), view()]))
    }

    #[test]
    fn every_number_of_a_capture_changes_its_hash() {
        let right = fingerprint(&capture());
        assert_eq!(right, fingerprint(&capture()));
        let changes: [fn(&mut View); 5] = [
            |v| v.rgba[77][1] ^= 1,
            |v| v.camera.intrinsics.fy *= 1.0 + 1e-12,
            |v| v.camera.intrinsics.cx += 1e-9,
            |v| v.camera.world_to_camera.rotation = v.camera.world_to_camera.rotation.inverse(),
            |v| v.depth = v.depth.as_ref().map(|d| DepthMap::nearest(&d.iter().map(|z| 0.9 * z).collect::<Vec<_>>())),
        ];
        for (i, change) in changes.into_iter().enumerate() {
            let mut other = capture();
            change(&mut other.states[State::END].train[1]);
            assert_ne!(right, fingerprint(&other), "change {i}");
        }
    }
}
