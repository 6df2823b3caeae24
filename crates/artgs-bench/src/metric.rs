//! Metrics of tables, and how they are read from the record of a run.

use crate::record::Measured;
use artgs::evaluate::{GeometryScore, MeshScore, Motion};

/// Which surface a Chamfer distance compares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Surface {
    /// The static part: CD-s.
    Fixed,
    /// The movable parts: CD-m.
    Movable,
    /// The whole object: CD-w.
    Whole,
}

/// Which state's surfaces are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum At {
    /// Start state.
    Start,
    /// End state.
    End,
    /// Mean of both.
    Mean,
    /// The state the paper reports for the object, else the mean of both.
    Reported,
}

/// A number of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Metric {
    /// Angle between axes, degrees, mean over movable parts.
    AxisAngle,
    /// Distance between axes x 10, mean over parts that turn.
    AxisPosition,
    /// Distance between axes x 10 as the paper averages it: sliding parts count 0.
    PaperAxisPosition,
    /// Motion error: degrees if all parts turn, scene units if all slide; none for objects that have both.
    PartMotion,
    /// Motion error of parts that turn, degrees.
    MotionDegrees,
    /// Motion error of parts that slide, scene units.
    MotionLength,
    /// Motion error, averaged as in the paper: degrees and lengths together.
    PaperMotion,
    /// Chamfer distance x 1000.
    Cd(Surface, At),
    /// Axis angle of one joint.
    JointAxisAngle(usize),
    /// Axis position x 10 of one joint.
    JointAxisPosition(usize),
    /// Motion error of one joint, degrees or scene units.
    JointMotion(usize),
    /// CD-m of one part, at the reported state.
    JointCd(usize),
    /// Peak signal-to-noise ratio of held-out pictures, dB, mean of both states.
    Psnr,
    /// Structural similarity of held-out pictures, mean of both states.
    Ssim,
    /// Learned perceptual distance (LPIPS) of held-out pictures, mean of both states.
    Lpips,
    /// FLIP of held-out pictures, mean of both states.
    Flip,
    /// Wall-clock time of the reconstruction, minutes.
    Minutes,
    /// Largest resident memory, MiB.
    Memory,
}

fn at(score: &MeshScore, at: At, reported: At) -> &GeometryScore {
    match if at == At::Reported { reported } else { at } {
        At::Start => &score.start,
        At::End => &score.end,
        At::Mean | At::Reported => &score.mean,
    }
}

impl Metric {
    /// Heading in tables.
    pub fn label(self) -> String {
        let surface = |s: Surface| match s {
            Surface::Fixed => "CD-s",
            Surface::Movable => "CD-m",
            Surface::Whole => "CD-w",
        };
        match self {
            Self::AxisAngle => "Axis Ang".into(),
            Self::AxisPosition | Self::PaperAxisPosition => "Axis Pos".into(),
            Self::PartMotion | Self::PaperMotion => "Part Motion".into(),
            Self::MotionDegrees => "Motion (deg)".into(),
            Self::MotionLength => "Motion (length)".into(),
            Self::Cd(s, At::Reported) => surface(s).into(),
            Self::Cd(s, At::Start) => format!("{} start", surface(s)),
            Self::Cd(s, At::End) => format!("{} end", surface(s)),
            Self::Cd(s, At::Mean) => format!("{} mean", surface(s)),
            Self::JointAxisAngle(i) => format!("Axis Ang {i}"),
            Self::JointAxisPosition(i) => format!("Axis Pos {i}"),
            Self::JointMotion(i) => format!("Part Motion {i}"),
            Self::JointCd(i) => format!("CD-m {i}"),
            Self::Psnr => "PSNR".into(),
            Self::Ssim => "SSIM".into(),
            Self::Lpips => "LPIPS".into(),
            Self::Flip => "FLIP".into(),
            Self::Minutes => "Time (min)".into(),
            Self::Memory => "Memory (MiB)".into(),
        }
    }

    /// Name in `results.json`.
    pub fn key(self) -> String {
        match self {
            Self::PaperAxisPosition => "paper_axis_pos".into(),
            Self::PaperMotion => "paper_part_motion".into(),
            Self::Cd(_, At::Reported) => format!("{}_reported", slug(&self.label())),
            _ => slug(&self.label()),
        }
    }

    /// Decimals in tables.
    pub fn digits(self) -> usize {
        match self {
            Self::Ssim | Self::Lpips | Self::Flip => 3,
            Self::MotionLength => 4,
            Self::Memory => 0,
            _ => 2,
        }
    }

    /// True if more is better.
    pub fn higher_is_better(self) -> bool {
        matches!(self, Self::Psnr | Self::Ssim)
    }

    /// The number, if the run has it and it is finite. `reported` is the state the paper reports for the object.
    pub fn read(self, run: &Measured, reported: At) -> Option<f64> {
        let (scores, joints) = (&run.scores, &run.scores.joints);
        let joint = |i: usize| scores.parts.get(i).and_then(|p| p.joint);
        let turns = || joints.axis_position_x10.is_some();
        let motion = |m: Motion| m.value();
        let value = match self {
            Self::AxisAngle => joints.axis_angle_deg,
            Self::AxisPosition => joints.axis_position_x10,
            Self::PaperAxisPosition => joints.paper_axis_position_x10.filter(|_| turns()),
            Self::PartMotion => match (joints.motion_deg, joints.motion_length) {
                (Some(_), Some(_)) => None,
                (degrees, length) => degrees.or(length),
            },
            Self::MotionDegrees => joints.motion_deg,
            Self::MotionLength => joints.motion_length,
            Self::PaperMotion => joints.paper_motion,
            Self::Cd(Surface::Fixed, state) => Some(at(&scores.fixed, state, reported).chamfer),
            Self::Cd(Surface::Movable, state) => Some(at(&scores.movable, state, reported).chamfer),
            Self::Cd(Surface::Whole, state) => Some(at(&scores.whole, state, reported).chamfer),
            Self::JointAxisAngle(i) => joint(i).map(|j| j.axis_angle_deg),
            Self::JointAxisPosition(i) => joint(i).and_then(|j| j.axis_position_x10),
            Self::JointMotion(i) => joint(i).map(|j| motion(j.motion)),
            Self::JointCd(i) => scores.parts.get(i).map(|p| at(&p.mesh, At::Reported, reported).chamfer),
            Self::Psnr => run.picture_mean(|p| Some(p.psnr)),
            Self::Ssim => run.picture_mean(|p| Some(p.ssim)),
            Self::Lpips => run.picture_mean(|p| p.lpips),
            Self::Flip => run.picture_mean(|p| p.flip),
            Self::Minutes => Some(run.metrics.total_seconds / 60.0),
            Self::Memory => run.metrics.peak_memory_mib,
        };
        value.filter(|v| v.is_finite())
    }
}

/// Every metric of `results.json` except those of single joints.
pub(crate) fn all() -> Vec<Metric> {
    let mut list = vec![
        Metric::AxisAngle,
        Metric::AxisPosition,
        Metric::PaperAxisPosition,
        Metric::MotionDegrees,
        Metric::MotionLength,
        Metric::PaperMotion,
    ];
    for surface in [Surface::Fixed, Surface::Movable, Surface::Whole] {
        list.extend([At::Start, At::End, At::Mean, At::Reported].map(|state| Metric::Cd(surface, state)));
    }
    list.extend([Metric::Psnr, Metric::Ssim, Metric::Lpips, Metric::Flip, Metric::Minutes, Metric::Memory]);
    list
}

fn slug(label: &str) -> String {
    let words = label.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty());
    words.collect::<Vec<_>>().join("_").to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::measured;

    #[test]
    fn keys_are_distinct() {
        let mut keys: Vec<String> = all().into_iter().map(Metric::key).collect();
        let count = keys.len();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), count);
        assert!(keys.contains(&"cd_s_reported".into()) && keys.contains(&"motion_deg".into()), "{keys:?}");
    }

    #[test]
    fn the_reported_state_is_the_papers() {
        let mut run = measured(0.5);
        run.scores.whole.start.chamfer = 1.0;
        run.scores.whole.end.chamfer = 2.0;
        run.scores.whole.mean.chamfer = 1.5;
        let read = |reported| Metric::Cd(Surface::Whole, At::Reported).read(&run, reported);
        assert_eq!([At::Start, At::End, At::Mean].map(read), [Some(1.0), Some(2.0), Some(1.5)]);
        assert_eq!(Metric::Cd(Surface::Whole, At::End).read(&run, At::Start), Some(2.0));
    }

    #[test]
    fn mixed_objects_have_no_single_motion_and_pictures_average_over_states() {
        let mut run = measured(0.5);
        assert_eq!(Metric::PartMotion.read(&run, At::Mean), Some(0.5));
        assert_eq!(Metric::Psnr.read(&run, At::Mean), Some(31.0));
        assert_eq!(Metric::Lpips.read(&run, At::Mean), None);
        run.scores.joints.motion_length = Some(0.1);
        assert_eq!(Metric::PartMotion.read(&run, At::Mean), None);
        run.scores.joints.axis_angle_deg = Some(f64::INFINITY);
        assert_eq!(Metric::AxisAngle.read(&run, At::Mean), None);
    }
}
