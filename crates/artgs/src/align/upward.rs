//! Which way is up in the world of a recording: as its format states, or by the floor and the walls that it shows.
//!
//! Cameras are held roughly upright, so the mean upward direction of the images says which of the bounding
//! planes is the floor; its normal is far more exact. Where images are recorded on their side, their horizontal axis takes
//! that place: it keeps its direction while the camera turns.

use super::planes::Plane;
use artgs_core::{Rigid, UpSource, Upward};
use glam::DVec3;

/// Least share of the image's upward direction along the normal of a floor: the camera is pitched by less than 63 degrees.
const FLOOR: f64 = 0.45;
/// The same against the normal of a ceiling, and along a direction that only walls give.
const OTHER: f64 = 0.5;
/// By how much the horizontal axis of images must be steadier than the vertical one in images that lie on their side.
const STEADIER: f64 = 0.05;
/// Images whose mean horizontal axis is shorter were taken from many sides.
const AROUND: f64 = 0.7;
/// A direction within this angle of an axis of the world is that axis: worlds with an upright axis are more exact than planes.
const SNAP: f64 = 1.0 * std::f64::consts::PI / 180.0;

/// Mean upward direction of images; shorter than 1 where they differ.
#[derive(Clone, Copy, Debug)]
struct ImageUp {
    mean: DVec3,
    /// False if images lie on their side, to either side.
    signed: bool,
    /// True if the camera turned by half a turn or so: only then do pitched cameras have an upright mean.
    around: bool,
}

impl ImageUp {
    fn of(poses: &[Rigid]) -> Self {
        let count = poses.len().max(1) as f64;
        let mean = |axis: DVec3| poses.iter().map(|pose| pose.turn(axis)).sum::<DVec3>() / count;
        let (upright, sideways) = (mean(DVec3::NEG_Y), mean(DVec3::X));
        let signed = sideways.length() <= upright.length() + STEADIER;
        Self { mean: if signed { upright } else { sideways }, signed, around: sideways.length() < AROUND }
    }

    /// How far a direction is that of the images, -1 to 1.
    fn along(&self, direction: DVec3) -> f64 {
        let cosine = self.mean.dot(direction);
        if self.signed { cosine } else { cosine.abs() }
    }
}

/// The upward direction of a world. `stated` is that of the format, `planes` bound the scene, `poses` are the cameras (camera to
/// world). Axes of the world count only where it is `metric`: others are turned at random.
pub(crate) fn upward(stated: Option<DVec3>, planes: &[Plane], poses: &[Rigid], metric: bool) -> Upward {
    if let Some(direction) = stated.and_then(DVec3::try_normalize) {
        return Upward { direction, source: UpSource::Format, confidence: 1.0 };
    }
    let image = ImageUp::of(poses);
    let found = floor(planes, &image).or_else(|| walls(planes, &image));
    let mut found = found.unwrap_or_else(|| nearest_axis(&image, metric));
    let axes = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
    if let Some(axis) = axes.into_iter().find(|axis| axis.angle_between(found.direction) < SNAP) {
        found.direction = axis;
    }
    found
}

/// The plane whose normal is most that of the images.
fn floor(planes: &[Plane], image: &ImageUp) -> Option<Upward> {
    let best = planes.iter().max_by(|a, b| image.along(a.normal).total_cmp(&image.along(b.normal)))?;
    let share = image.along(best.normal);
    let others = planes.iter().filter(|p| p.normal.dot(best.normal).abs() < 0.9).map(|p| image.along(p.normal));
    let second = others.fold(0.0, f64::max);
    let confidence = (0.5 + share - second).clamp(0.0, 0.99);
    (share >= FLOOR).then_some(Upward { direction: best.normal, source: UpSource::Floor, confidence })
}

/// The direction in two walls that are not parallel, or against the normal of a ceiling.
fn walls(planes: &[Plane], image: &ImageUp) -> Option<Upward> {
    let pairs = planes.iter().enumerate().flat_map(|(i, a)| planes[..i].iter().map(move |b| (a.normal, b.normal)));
    let edges = pairs.filter(|(a, b)| a.dot(*b).abs() < 0.5).filter_map(|(a, b)| a.cross(b).try_normalize());
    let ceilings = planes.iter().map(|plane| -plane.normal);
    let directed = edges.map(|edge| if image.mean.dot(edge) < 0.0 { -edge } else { edge });
    let best = ceilings.chain(directed).max_by(|a, b| image.along(*a).total_cmp(&image.along(*b)))?;
    let share = image.along(best);
    // Images on their side do not say which end of the edge is up.
    (share >= OTHER && image.signed).then_some(Upward {
        direction: best,
        source: UpSource::Walls,
        confidence: (0.3 + 0.6 * share).min(0.9),
    })
}

/// The axis of the world that is most the direction of the images; certain only if it is theirs within 13 degrees and they were
/// taken from many sides.
fn nearest_axis(image: &ImageUp, metric: bool) -> Upward {
    let mut axes: Vec<DVec3> = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]).collect();
    axes.sort_by(|a, b| image.along(*b).total_cmp(&image.along(*a)));
    let share = image.along(axes[0]) / image.mean.length().max(1e-9);
    let clear = metric && image.signed && image.around && image.mean.length() >= 0.3 && share >= 0.975;
    Upward { direction: axes[0], source: UpSource::Assumed, confidence: if clear { 0.6 } else { 0.2 } }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{Camera, Intrinsics};
    use glam::DQuat;

    fn plane(normal: DVec3) -> Plane {
        Plane { normal, offset: 0.0, spread: 0.002 }
    }

    /// Cameras on an arc in front of the origin (z up), pitched down, rolled by `roll`, then turned by `world`.
    fn poses(arc: f64, pitch: f64, roll: f64, world: DQuat) -> Vec<Rigid> {
        let intrinsics = Intrinsics { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 32.0, cy: 24.0 };
        let pose = |i: usize| {
            let angle = arc * (i as f64 / 19.0 - 0.5);
            let eye = 2.0 * DVec3::new(angle.sin() * pitch.cos(), -angle.cos() * pitch.cos(), pitch.sin());
            let camera = Camera::look_at(intrinsics, eye, DVec3::ZERO, DVec3::Z).world_to_camera.inverse();
            let world = Rigid { rotation: world, translation: DVec3::new(0.3, 0.1, -0.2) };
            world * camera * Rigid::about(DVec3::Z, DVec3::ZERO, roll)
        };
        (0..20).map(pose).collect()
    }

    #[test]
    fn the_floor_says_it_in_every_world_even_with_images_on_their_side() {
        let turns = [DQuat::IDENTITY, DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2), DQuat::from_rotation_x(2.0)];
        for (world, roll) in turns.into_iter().flat_map(|w| [0.0, 0.3, 1.57, -1.57].map(|roll| (w, roll))) {
            // Behind the object, at its side, and the floor.
            let planes = [DVec3::NEG_Y, DVec3::X, DVec3::Z].map(|n| plane(world * n));
            let found = upward(None, &planes, &poses(1.6, 0.5, roll, world), true);
            assert!(found.direction.distance(world * DVec3::Z) < 0.02, "{roll}: {found:?}");
            assert_eq!(found.source, UpSource::Floor);
            assert!(found.is_certain(), "{found:?}");
        }
    }

    #[test]
    fn walls_say_it_where_no_floor_was_seen() {
        let world = DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2);
        let planes = [DVec3::NEG_Y, DVec3::X].map(|n| plane(world * n));
        let found = upward(None, &planes, &poses(1.2, 0.3, 0.0, world), false);
        assert!(found.direction.distance(DVec3::X) < 1e-9 && found.source == UpSource::Walls, "{found:?}");
        assert!(found.is_certain());
        // The wall behind the object is no floor, even if the camera looks up a little.
        let found = upward(None, &planes[..1], &poses(1.2, -0.3, 0.0, world), false);
        assert!(found.source == UpSource::Assumed && !found.is_certain(), "{found:?}");
    }

    #[test]
    fn what_the_format_states_counts_and_nothing_makes_it_uncertain() {
        let stated = upward(Some(2.0 * DVec3::Y), &[plane(DVec3::Z)], &poses(1.0, 0.5, 0.0, DQuat::IDENTITY), true);
        assert_eq!(stated, Upward { direction: DVec3::Y, source: UpSource::Format, confidence: 1.0 });
        // All around, without a plane: the axis of a metric world.
        let around = poses(6.0, 0.4, 0.0, DQuat::IDENTITY);
        let assumed = upward(None, &[], &around, true);
        assert_eq!((assumed.direction, assumed.source), (DVec3::Z, UpSource::Assumed));
        assert!(assumed.is_certain());
        assert!(!upward(None, &[], &around, false).is_certain());
        assert!(!upward(None, &[], &poses(1.0, 1.3, 0.0, DQuat::IDENTITY), true).is_certain());
        assert!(!upward(None, &[], &[], true).is_certain());
    }
}
