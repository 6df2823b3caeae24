//! The direction in which an object opens: its open drawers and doors stand out of what stays.

use super::cloud::IndexedCloud;
use super::poses::PoseSettings;
use super::visibility::Occupancy;
use artgs_core::{PerState, State};
use glam::{DVec3, Vec3};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// Settings of the search for the front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrontSettings {
    /// Fraction of the resting points that may stand out of what stays, on each side: mislabelled ones.
    pub(crate) outliers: f32,
    /// Least distance of a point that stands out, fraction of the diagonal.
    pub(crate) margin: f32,
    /// Least fraction of the moved points that stands out on the side of the front.
    pub(crate) least_share: f32,
}

/// The side on which an object opens, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Front {
    /// Unit direction.
    pub(crate) direction: Vec3,
    /// Points beyond this height along `direction` stand out of what stays, scene units.
    pub(crate) height: f32,
}

impl Front {
    /// Share of the points that stand out.
    pub(super) fn share_standing_out(&self, points: impl ExactSizeIterator<Item = Vec3>) -> f32 {
        let total = points.len().max(1) as f32;
        points.filter(|p| p.dot(self.direction) > self.height).count() as f32 / total
    }
}

/// The direction near `front` that `normals` of what rests determine, if it clearly differs: perpendicular to the sides of the object, those
/// normals that are nearly so, and parallel to those that are nearly so; `front` if they leave it open. Doors that are ajar face nearly as the
/// front does, and noise joins their directions to one.
fn of_resting(front: Vec3, normals: impl Iterator<Item = Vec3>) -> Vec3 {
    /// Normals within this angle of parallel or perpendicular count, degrees, in each round.
    const NEARLY_DEG: [f64; 3] = [15.0, 8.0, 8.0];
    /// Turns up to this are errors of either direction, degrees.
    const SAME_DEG: f64 = 2.0;
    /// Least difference of the mean squares of normals along the front and along the next axis: sides in one direction leave a turn about
    /// them open.
    const LEAST_GAP: f64 = 0.1;
    let normals: Vec<DVec3> = normals.map(|n| n.as_dvec3()).collect();
    let mut direction = front.as_dvec3();
    for degrees in NEARLY_DEG {
        let most = degrees.to_radians().sin();
        let (mut moments, mut count) = (Matrix3::<f64>::zeros(), 0);
        for n in &normals {
            let sign = match n.dot(direction).abs() {
                along if along < most => 1.0,
                along if along * along > 1.0 - most * most => -1.0,
                _ => continue,
            };
            let n = Vector3::new(n.x, n.y, n.z);
            moments += sign * n * n.transpose();
            count += 1;
        }
        let eigen = SymmetricEigen::new(moments / f64::from(count.max(1)));
        let least = eigen.eigenvalues.imin();
        let next = (0..3).filter(|k| *k != least).map(|k| eigen.eigenvalues[k]).fold(f64::INFINITY, f64::min);
        if next - eigen.eigenvalues[least] < LEAST_GAP {
            return front;
        }
        let v = eigen.eigenvectors.column(least);
        let found = DVec3::new(v[0], v[1], v[2]);
        direction = if found.dot(direction) < 0.0 { -found } else { found };
    }
    let cosine = direction.dot(front.as_dvec3());
    let turned = (NEARLY_DEG[0].to_radians().cos()..SAME_DEG.to_radians().cos()).contains(&cosine);
    if turned { direction.as_vec3() } else { front }
}

impl Default for FrontSettings {
    fn default() -> Self {
        Self { outliers: 0.01, margin: 0.02, least_share: 0.15 }
    }
}

impl FrontSettings {
    /// The side on which most of the moved points stand out of the resting ones; none if few do (sliding doors, tools). Where
    /// depth is noisy, the sides of the object determine the direction.
    pub(super) fn find(
        &self,
        clouds: &PerState<IndexedCloud<'_>>,
        occupancy: &PerState<Vec<Occupancy>>,
        poses: &PoseSettings,
        diagonal: f32,
        noisy: bool,
    ) -> Option<Front> {
        let total = occupancy.iter().flatten().filter(|o| **o == Occupancy::Empty).count();
        let standing_out = |direction: Vec3| {
            let heights = |what: Occupancy| {
                let of_state = move |s: State| {
                    let points = clouds[s].cloud.points.iter().zip(&occupancy[s]);
                    points.filter(move |(_, o)| **o == what).map(move |(p, _)| p.dot(direction))
                };
                State::ALL.into_iter().flat_map(of_state).collect::<Vec<f32>>()
            };
            let mut resting = heights(Occupancy::Surface);
            let last = resting.len().checked_sub(1)?;
            let index = last - (self.outliers * last as f32) as usize;
            let top = *resting.select_nth_unstable_by(index, f32::total_cmp).1 + self.margin * diagonal;
            Some((heights(Occupancy::Empty).into_iter().filter(|h| *h > top).count(), top))
        };
        let faces = poses.face_directions(clouds[State::END].cloud);
        let sides = faces.into_iter().flat_map(|f| [f.normalize(), -f.normalize()]);
        let sides = sides.filter_map(|direction| Some((standing_out(direction)?, direction)));
        let (most, direction) = sides.max_by_key(|((count, _), _)| *count)?;
        let resting = |s: State| {
            let normals = clouds[s].cloud.normals.iter().zip(&occupancy[s]);
            normals.filter(|(_, o)| **o == Occupancy::Surface).map(|(n, _)| *n)
        };
        let resting = State::ALL.into_iter().flat_map(resting);
        let direction = if noisy { of_resting(direction, resting) } else { direction };
        let (count, height) = if noisy { standing_out(direction)? } else { most };
        (count as f32 >= self.least_share * total as f32).then_some(Front { direction, height })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rests_determines_the_front_of_a_noisy_object() {
        let found = Vec3::new(0.12, -0.99, 0.03).normalize();
        // A side, a top and a front, each with the same noise on both sides.
        let wobble = [-0.1, -0.03, 0.0, 0.03, 0.1];
        let side = wobble.map(|y| Vec3::new(1.0, y, 0.0).normalize());
        let top = wobble.map(|y| Vec3::new(0.0, y, 1.0).normalize());
        let face = wobble.map(|x| Vec3::new(x, -1.0, 0.0).normalize());
        for others in [top.as_slice(), &face] {
            let front = of_resting(found, side.into_iter().chain(others.iter().copied()));
            assert!(front.angle_between(Vec3::NEG_Y) < 0.01, "{front}");
        }
        // Normals in one direction leave turns about it open.
        assert_eq!(of_resting(found, side.into_iter()), found);
        // A direction that hardly differs is kept.
        let near = Vec3::new(0.02, -1.0, 0.0).normalize();
        assert_eq!(of_resting(near, side.into_iter().chain(top)), near);
    }
}
