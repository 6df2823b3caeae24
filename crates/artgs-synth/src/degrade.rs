//! Simulated errors of real captures. The ground truth has no errors.

use artgs_core::{Camera, Rigid};
use glam::DVec3;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Simulated errors of a capture. The default is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Degradation {
    /// Standard deviation of depth at distance 1, scene units; grows with the square of the distance.
    pub depth_noise: f64,
    /// No depth where the surface is hit at more than this angle from its normal, degrees, nor at steps of depth.
    pub grazing_deg: Option<f64>,
    /// Fraction of the surface that is covered by glossy patches without depth, 0 to 1.
    pub gloss: f64,
    /// Standard deviation of each stated camera's rotation, degrees.
    pub pose_deg: f64,
    /// Standard deviation of each stated camera's position along each axis, scene units.
    pub pose_shift: f64,
    /// Turn of all stated cameras of the end state against the truth, degrees.
    pub misalign_deg: f64,
    /// Shift of all stated cameras of the end state against the truth, scene units.
    pub misalign_shift: f64,
    /// Cameras only within 60 degrees of the front.
    pub front: bool,
    /// The light moves with the camera.
    pub camera_light: bool,
    /// No depth images.
    pub no_depth: bool,
}

/// Settings of [`Degradation::set`] and their meaning.
pub(crate) const DEGRADATIONS: [(&str, &str); 8] = [
    ("depth=SIGMA", "depth noise, standard deviation at distance 1; grows with the square of the distance"),
    ("edges=on|DEG", "no depth at steps and where surfaces are seen at more than DEG (75) from their normal"),
    ("gloss=FRACTION", "no depth on glossy patches that cover this fraction of the surface"),
    ("pose=DEG,LENGTH", "jitter of the stated cameras: rotation and position, standard deviations"),
    ("misalign=DEG,LENGTH", "the stated cameras of the end state are turned and shifted together"),
    ("front=on", "cameras only within 60 degrees of the front"),
    ("light=camera", "the light moves with the camera"),
    ("no-depth", "no depth images"),
];

impl Degradation {
    /// Adds one degradation, `NAME=VALUE` for example `depth=0.002`. The error names the
    /// correct form.
    pub fn set(&mut self, setting: &str) -> Result<(), String> {
        let (name, value) = setting.split_once('=').unwrap_or((setting, "on"));
        let known = DEGRADATIONS.iter().find(|(usage, _)| usage.split('=').next() == Some(name));
        let Some((usage, meaning)) = known else {
            let names: Vec<&str> = DEGRADATIONS.iter().map(|(usage, _)| *usage).collect();
            return Err(format!("`{setting}`: there is no such degradation; there are {}", names.join(", ")));
        };
        let wrong = || format!("`{setting}`: write {usage} ({meaning})");
        let number = |text: &str, limit: f64| {
            text.trim().parse::<f64>().ok().filter(|v| (0.0..=limit).contains(v)).ok_or_else(wrong)
        };
        let pair = || {
            let (angle, length) = value.split_once(',').ok_or_else(wrong)?;
            Ok::<_, String>((number(angle, 45.0)?, number(length, 1.0)?))
        };
        match name {
            "depth" => self.depth_noise = number(value, 1.0)?,
            "edges" if value == "on" => self.grazing_deg = Some(75.0),
            "edges" => self.grazing_deg = Some(number(value, 90.0)?),
            "gloss" => self.gloss = number(value, 1.0)?,
            "pose" => (self.pose_deg, self.pose_shift) = pair()?,
            "misalign" => (self.misalign_deg, self.misalign_shift) = pair()?,
            "front" if value == "on" => self.front = true,
            "light" if value == "camera" => self.camera_light = true,
            "no-depth" if value == "on" => self.no_depth = true,
            _ => return Err(wrong()),
        }
        Ok(())
    }

    /// The first invalid value, as a message.
    pub(crate) fn invalid(&self) -> Option<&'static str> {
        let is = |v: f64, limit: f64| (0.0..=limit).contains(&v);
        let checks = [
            (is(self.depth_noise, 1.0), "`depth_noise` must be in [0, 1]"),
            (self.grazing_deg.is_none_or(|v| is(v, 90.0)), "`grazing_deg` must be in [0, 90]"),
            (is(self.gloss, 1.0), "`gloss` must be in [0, 1]"),
            (is(self.pose_deg, 45.0) && is(self.pose_shift, 1.0), "pose jitter must be within 45 degrees and 1 unit"),
            (
                is(self.misalign_deg, 45.0) && is(self.misalign_shift, 1.0),
                "misalignment must be within 45 degrees and 1 unit",
            ),
        ];
        checks.into_iter().find(|(good, _)| !good).map(|(_, message)| message)
    }

    /// The camera that the capture states for a view rendered by `camera`.
    pub(crate) fn jittered(&self, camera: Camera, rng: &mut Pcg64Mcg) -> Camera {
        if self.pose_deg == 0.0 && self.pose_shift == 0.0 {
            return camera;
        }
        let mut normal = || DVec3::new(gaussian(rng), gaussian(rng), gaussian(rng));
        let (turn, shift) = (normal() * self.pose_deg.to_radians() / 3_f64.sqrt(), normal() * self.pose_shift);
        let jitter = Rigid { rotation: glam::DQuat::from_scaled_axis(turn), translation: shift };
        Camera { world_to_camera: jitter * camera.world_to_camera, ..camera }
    }

    /// Error of the stated world frame of the end state, about a point.
    pub(crate) fn misalignment(&self, middle: DVec3, rng: &mut Pcg64Mcg) -> Rigid {
        let mut direction = || DVec3::new(gaussian(rng), gaussian(rng), gaussian(rng)).normalize_or(DVec3::Z);
        let turn = Rigid::about(direction(), middle, self.misalign_deg.to_radians());
        Rigid::shift(direction() * self.misalign_shift) * turn
    }

    /// Depth as the simulated sensor reports it: `true_depth` planar, `range` along the ray, scene units.
    pub(crate) fn measured(&self, true_depth: f64, range: f64, rng: &mut Pcg64Mcg) -> f64 {
        if self.depth_noise == 0.0 {
            return true_depth;
        }
        true_depth + self.depth_noise * range * range * gaussian(rng)
    }
}

/// Depth in counts of 1 / `scale` scene units, as in files.
pub(crate) fn depth_count(depth: f64, scale: f64) -> u16 {
    (depth * scale).round().clamp(0.0, f64::from(u16::MAX)) as u16
}

/// A standard normal number (Box and Muller).
pub(crate) fn gaussian(rng: &mut Pcg64Mcg) -> f64 {
    let (u, v) = (rng.random(), rng.random());
    artgs_core::random::box_muller(u, v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_parsed_or_explained() {
        let mut d = Degradation::default();
        for setting in
            ["depth=0.002", "edges=on", "gloss=0.1", "pose=0.5,0.01", "misalign=2,0.03", "front=on", "no-depth"]
        {
            d.set(setting).unwrap();
        }
        d.set("light=camera").unwrap();
        let expected = Degradation {
            depth_noise: 0.002,
            grazing_deg: Some(75.0),
            gloss: 0.1,
            pose_deg: 0.5,
            pose_shift: 0.01,
            misalign_deg: 2.0,
            misalign_shift: 0.03,
            front: true,
            camera_light: true,
            no_depth: true,
        };
        assert_eq!(d, expected);
        assert_eq!(d.invalid(), None);
        for (setting, words) in
            [("depth=-1", "depth=SIGMA"), ("fog=1", "no such"), ("pose=1", "DEG,LENGTH"), ("depth=nan", "SIGMA")]
        {
            let message = d.set(setting).unwrap_err();
            assert!(message.contains(setting) && message.contains(words), "{message}");
        }
        assert_eq!(d, expected);
    }

    #[test]
    fn every_documented_degradation_is_accepted() {
        for (usage, _) in DEGRADATIONS {
            let setting = usage
                .replace("on|DEG", "60")
                .replace("DEG,LENGTH", "1,0.1")
                .replace("SIGMA", "0.1")
                .replace("FRACTION", "0.2");
            let mut d = Degradation::default();
            d.set(&setting).unwrap();
            assert_ne!(d, Degradation::default(), "{setting}");
        }
    }
}
