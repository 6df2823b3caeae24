//! From where an object was recorded: what faces away from all cameras is not measured.

use artgs_core::Camera;
use artgs_io::summary::visual_center;
use glam::DVec3;
use serde::Serialize;
use std::fmt;

/// Places of cameras around the point that they look at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Viewpoints {
    /// The arc of the directions that cameras look from, seen from above: 360 degrees less the widest one without a camera.
    around_deg: f64,
    /// How far the lowest and the highest camera are above the point, seen from it, degrees.
    above_deg: [f64; 2],
}

/// An arc without a camera that is narrower is none, degrees.
const NARROW: f64 = 45.0;
/// Cameras on a smaller arc do not show all sides, degrees.
const ALL_SIDES: f64 = 240.0;

impl Viewpoints {
    /// Of cameras in a world where `up` is up, or else what is up in most of their images. None where they do not look at one point.
    pub(super) fn of<'a>(cameras: impl Iterator<Item = &'a Camera> + Clone, up: Option<DVec3>) -> Option<Self> {
        let count = cameras.clone().count();
        if count < 3 {
            return None;
        }
        let middle = visual_center(cameras.clone())?.point;
        let ahead = cameras.clone().filter(|camera| (middle - camera.position()).dot(forward(camera)) > 0.0).count();
        if 10 * ahead < 9 * count {
            return None;
        }
        let above = |camera: &Camera| camera.world_to_camera.inverse().turn(DVec3::NEG_Y);
        let up = up.unwrap_or_else(|| cameras.clone().map(above).sum()).try_normalize()?;
        let (east, north) = up.any_orthonormal_pair();
        let from = |camera: &Camera| (camera.position() - middle).normalize_or(up);
        let heights = cameras.clone().map(|camera| from(camera).dot(up).clamp(-1.0, 1.0).asin().to_degrees());
        let above_deg = heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
        let around = |d: DVec3| d.dot(north).atan2(d.dot(east)).to_degrees();
        let mut angles: Vec<f64> = cameras.map(|camera| around(from(camera))).collect();
        angles.sort_by(f64::total_cmp);
        let next = angles.iter().skip(1).copied().chain([angles[0] + 360.0]);
        let widest = next.zip(&angles).map(|(b, a)| b - a).fold(0.0, f64::max);
        let around_deg = if widest < NARROW { 360.0 } else { 360.0 - widest };
        Some(Self { around_deg, above_deg })
    }
}

impl fmt::Display for Viewpoints {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let [low, high] = self.above_deg;
        write!(f, "from {:.0} of 360 degrees around, {low:.0} to {high:.0} degrees above", self.around_deg)?;
        if self.around_deg < ALL_SIDES {
            write!(f, "; sides that face away are not recorded: their surface will be missing or invented")?;
        }
        Ok(())
    }
}

fn forward(camera: &Camera) -> DVec3 {
    camera.world_to_camera.inverse().turn(DVec3::Z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{Intrinsics, Rigid};

    /// Cameras 2 units from a point, at these angles around it and above it, degrees, in a world that is turned.
    fn cameras(places: &[[f64; 2]]) -> (Vec<Camera>, DVec3) {
        let intrinsics = Intrinsics { fx: 50.0, fy: 50.0, cx: 32.0, cy: 32.0, width: 64, height: 64 };
        let world = Rigid::about(DVec3::new(1.0, 2.0, 0.5).normalize(), DVec3::X, 1.1);
        let middle = DVec3::new(0.3, -0.2, 0.7);
        let camera = |[around, above]: &[f64; 2]| {
            let (a, h) = (around.to_radians(), above.to_radians());
            let eye = middle + 2.0 * DVec3::new(a.cos() * h.cos(), a.sin() * h.cos(), h.sin());
            Camera::look_at(intrinsics, world.apply(eye), world.apply(middle), world.turn(DVec3::Z))
        };
        (places.iter().map(camera).collect(), world.turn(DVec3::Z))
    }

    #[test]
    fn arcs_and_heights_are_those_of_the_cameras() {
        let places: Vec<[f64; 2]> = (0..19).map(|i| [350.0 + 10.0 * f64::from(i), f64::from(i)]).collect();
        let (half, up) = cameras(&places);
        let all = Viewpoints::of(half.iter(), Some(up)).unwrap();
        assert!((all.around_deg - 180.0).abs() < 1e-6, "{all:?}");
        assert!(all.above_deg[0].abs() < 1e-6 && (all.above_deg[1] - 18.0).abs() < 1e-6, "{all:?}");
        assert!(
            all.to_string().starts_with("from 180 of 360 degrees around, 0 to 18 degrees above; sides that face away")
        );
        // Without a direction that is up the images say it, nearly.
        let guessed = Viewpoints::of(half.iter(), None).unwrap();
        assert!((guessed.around_deg - 180.0).abs() < 15.0, "{guessed:?}");
        let (round, up) = cameras(&(0..12).map(|i| [30.0 * f64::from(i), 20.0]).collect::<Vec<_>>());
        let all = Viewpoints::of(round.iter(), Some(up)).unwrap();
        assert_eq!(all.to_string(), "from 360 of 360 degrees around, 20 to 20 degrees above");
    }

    #[test]
    fn cameras_that_look_at_no_point_have_no_arc() {
        let (few, up) = cameras(&[[0.0, 10.0], [50.0, 10.0]]);
        assert_eq!(Viewpoints::of(few.iter(), Some(up)), None);
        let same = Camera::look_at(few[0].intrinsics, DVec3::ZERO, DVec3::X, DVec3::Z);
        let aside = |y: f64| same.moved_with(&Rigid::shift(DVec3::Y * y));
        assert_eq!(Viewpoints::of([aside(0.0), aside(1.0), aside(2.0)].iter(), None), None, "parallel");
        // Cameras that turn in one place look outwards.
        let (out, up) = cameras(&[[0.0, 10.0], [120.0, 10.0], [240.0, 10.0], [300.0, 5.0]]);
        let middle = out.iter().map(Camera::position).sum::<DVec3>() / 4.0;
        let turned = |c: &Camera| Camera::look_at(c.intrinsics, c.position(), 2.0 * c.position() - middle, up);
        assert_eq!(Viewpoints::of(out.iter().map(turned).collect::<Vec<_>>().iter(), Some(up)), None);
    }
}
