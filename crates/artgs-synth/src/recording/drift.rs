//! Errors of the poses that a device states: a smooth random walk, as tracking without loop closure has, and jitter.

use crate::degrade::gaussian;
use artgs_core::Rigid;
use glam::{DQuat, DVec3};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Share of the velocity of the random walk that is kept from frame to frame.
const MEMORY: f64 = 0.9;
/// Root mean square of the jitter, as a share of the drift: 1 mm and 0.05 degrees at 1 cm and 0.4 degrees.
const JITTER: [f64; 2] = [0.1, 0.125];

/// Size of the drift of the stated poses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Drift {
    /// Largest distance of the drifted camera from the true one, metres.
    pub metres: f64,
    /// Largest angle between the drifted camera and the true one, degrees.
    pub degrees: f64,
}

impl Drift {
    /// Reads `METRES,DEGREES`. The error names the form.
    pub fn parse(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<f64>().ok();
        let pair = text.split_once(',').and_then(|(m, d)| Some(Self { metres: number(m)?, degrees: number(d)? }));
        pair.filter(Self::is_valid).ok_or_else(|| {
            format!("`{text}`: write METRES,DEGREES, for example 0.01,0.4; at most 1 metre and 45 degrees")
        })
    }

    pub(crate) fn is_valid(&self) -> bool {
        (0.0..=1.0).contains(&self.metres) && (0.0..=45.0).contains(&self.degrees)
    }

    /// What is stated in place of each of the true poses (camera to world): the drift begins with none and has its
    /// largest values somewhere on the way; jitter is added.
    pub(crate) fn stated(&self, camera_to_world: &[Rigid], rng: &mut Pcg64Mcg) -> Vec<Rigid> {
        let angle = self.degrees.to_radians();
        let shifts = walk(camera_to_world.len(), self.metres, rng);
        let turns = walk(camera_to_world.len(), angle, rng);
        let mut jitter = |size: f64| normal(rng) * (size / 3_f64.sqrt());
        let state = |((pose, shift), turn): ((&Rigid, DVec3), DVec3)| {
            let turn = DQuat::from_scaled_axis(turn) * DQuat::from_scaled_axis(jitter(JITTER[1] * angle));
            Rigid {
                rotation: (turn * pose.rotation).normalize(),
                translation: pose.translation + shift + jitter(JITTER[0] * self.metres),
            }
        };
        camera_to_world.iter().zip(shifts).zip(turns).map(state).collect()
    }
}

/// A smooth random walk of `count` steps that begins at 0 and whose largest distance from there is `size`.
fn walk(count: usize, size: f64, rng: &mut Pcg64Mcg) -> Vec<DVec3> {
    let (mut at, mut velocity) = (DVec3::ZERO, DVec3::ZERO);
    let mut step = |index: usize| {
        velocity = velocity * MEMORY + normal(rng);
        if index > 0 {
            at += velocity;
        }
        at
    };
    let mut places: Vec<DVec3> = (0..count).map(&mut step).collect();
    let largest = places.iter().map(|p| p.length()).fold(0.0, f64::max);
    if largest > 0.0 {
        places.iter_mut().for_each(|p| *p *= size / largest);
    }
    places
}

fn normal(rng: &mut Pcg64Mcg) -> DVec3 {
    DVec3::new(gaussian(rng), gaussian(rng), gaussian(rng))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn drift_grows_smoothly_to_its_size() {
        let poses: Vec<Rigid> =
            (0..90).map(|i| Rigid::about(DVec3::Y, DVec3::new(1.0, 2.0, 0.5), 0.05 * f64::from(i))).collect();
        for seed in 0..20 {
            let drift = Drift { metres: 0.03, degrees: 0.8 };
            let stated = drift.stated(&poses, &mut Pcg64Mcg::seed_from_u64(seed));
            let off: Vec<DVec3> = poses.iter().zip(&stated).map(|(t, s)| s.translation - t.translation).collect();
            let turn = poses.iter().zip(&stated).map(|(t, s)| (*s * t.inverse()).angle().to_degrees());
            let (largest, turned) = (off.iter().map(|o| o.length()).fold(0.0, f64::max), turn.fold(0.0, f64::max));
            assert!((0.025..0.04).contains(&largest) && (0.65..1.15).contains(&turned), "{largest} {turned}");
            assert!(off[0].length() < 0.01, "{}", off[0]);
            // A walk from frame to frame: steps are much smaller than its size.
            let steps: f64 = off.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>() / 89.0;
            assert!(steps < 0.2 * largest, "{steps} {largest}");
        }
    }

    #[test]
    fn no_drift_states_the_truth() {
        let pose = Rigid::about(DVec3::Y, DVec3::X, 0.3);
        let stated = Drift::default().stated(&[pose; 3], &mut Pcg64Mcg::seed_from_u64(1));
        assert!(stated.iter().all(|s| (*s * pose.inverse()).angle() < 1e-12 && s.translation == pose.translation));
    }

    #[test]
    fn sizes_are_parsed_or_explained() {
        assert_eq!(Drift::parse("0.01, 0.4").unwrap(), Drift { metres: 0.01, degrees: 0.4 });
        for wrong in ["0.01", "-1,0", "2,0", "0,50", "a,b", "nan,0"] {
            let message = Drift::parse(wrong).unwrap_err();
            assert!(message.contains(wrong) && message.contains("METRES,DEGREES"), "{message}");
        }
    }
}
