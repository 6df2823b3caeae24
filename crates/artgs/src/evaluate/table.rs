//! Scores as text, in the layout of the paper's tables.

use super::closing::Closing;
use super::geometry::MeshScore;
use super::joints::{JointErrors, Motion};
use super::pictures::PictureReport;
use super::scores::Scores;
use std::fmt::{Display, Formatter, Result};

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".into(), |v| format!("{v:.digits$}"))
}

fn mesh_row(f: &mut Formatter, label: &str, m: &MeshScore) -> Result {
    let s = &m.mean;
    writeln!(
        f,
        "{label:<8} {:>9.2} {:>9.2} {:>9.2} {:>9.2} {:>9.3} {:>9.3} {:>8.3}",
        m.start.chamfer, m.end.chamfer, s.chamfer, s.floor, s.dense_chamfer, s.dense_floor, s.f_score
    )
}

impl Scores {
    /// One sentence: whether parts, joint types and parents are right, and how far off the worst joint is.
    pub fn verdict(&self) -> String {
        let c = &self.counts;
        let faults = [
            (c.missing, "missing"),
            (c.extra, "without a true part"),
            (c.wrong_type, "of wrong type"),
            (c.wrong_parent, "on the wrong part"),
            (c.missing_meshes, "without a mesh"),
        ];
        let named: Vec<String> = faults.iter().filter(|f| f.0 > 0).map(|(n, what)| format!("{n} {what}")).collect();
        if !named.is_empty() {
            return format!("verdict: wrong: {}", named.join(", "));
        }
        let worst = |pick: &dyn Fn(&JointErrors) -> Option<f64>| {
            self.parts.iter().filter_map(|p| p.joint.as_ref().and_then(pick)).reduce(f64::max)
        };
        let turn = |e: &JointErrors| matches!(e.motion, Motion::Degrees(_)).then(|| e.motion.value());
        let slide = |e: &JointErrors| matches!(e.motion, Motion::Length(_)).then(|| e.motion.value());
        let exact = [
            worst(&|e| Some(e.axis_angle_deg)).map(|v| format!("; axes within {v:.2} degrees")),
            worst(&|e| e.axis_position_x10).map(|v| format!(" and {:.4} scene units", 0.1 * v)),
            worst(&turn).map(|v| format!("; turns within {v:.2} degrees")),
            worst(&|e| slide(e).or(e.slide)).map(|v| format!("; slides within {v:.4} scene units")),
        ];
        let closing = |pick: fn(&Motion) -> bool| {
            self.parts
                .iter()
                .filter_map(|p| p.closing.as_ref())
                .map(Closing::error)
                .filter(pick)
                .map(Motion::value)
                .reduce(f64::max)
        };
        let closes = [
            closing(|m| matches!(m, Motion::Degrees(_))).map(|v| format!("{v:.1} degrees")),
            closing(|m| matches!(m, Motion::Length(_))).map(|v| format!("{v:.3} scene units")),
        ];
        let closes: Vec<String> = closes.into_iter().flatten().collect();
        let closes = (!closes.is_empty())
            .then(|| format!("; closing limits within {} of the zeros of the true joints", closes.join(" and ")));
        let exact: String = exact.into_iter().flatten().chain(closes).collect();
        format!("verdict: parts, joint types and parents are right{exact}")
    }
}

impl Display for Scores {
    fn fmt(&self, f: &mut Formatter) -> Result {
        writeln!(f, "{:<8} {:>9} {:>9} {:>12}  joint", "part", "axis deg", "pos x10", "motion")?;
        for p in &self.parts {
            let label = format!("true {}", p.truth + 1);
            let kind = match (p.part, p.kind) {
                (None, _) | (_, None) => format!("{}, missing", p.true_kind.name()),
                (Some(part), Some(kind)) if kind == p.true_kind => format!("{}, part {part}", kind.name()),
                (Some(part), Some(kind)) => format!("{}, not {}, part {part}", kind.name(), p.true_kind.name()),
            };
            let slide = p.joint.and_then(|j| j.slide).map_or_else(String::new, |s| format!(", slide off by {s:.4}"));
            let motion = p.joint.map_or_else(
                || "-".into(),
                |j| match j.motion {
                    Motion::Degrees(d) => format!("{d:.2} deg"),
                    Motion::Length(l) => format!("{l:.4}    "),
                },
            );
            let (angle, position) = (p.joint.map(|j| j.axis_angle_deg), p.joint.and_then(|j| j.axis_position_x10));
            let closing = p.closing.map_or_else(String::new, |c| match c.error() {
                Motion::Degrees(off) => format!(", closes {off:.1} deg from the true zero"),
                Motion::Length(off) => format!(", closes {off:.3} from the true zero"),
            });
            let (angle, position) = (number(angle, 2), number(position, 3));
            writeln!(f, "{label:<8} {angle:>9} {position:>9} {motion:>12}  {kind}{slide}{closing}")?;
        }
        let m = &self.joints;
        let (angle, position) = (number(m.axis_angle_deg, 2), number(m.axis_position_x10, 3));
        let (degrees, length) = (number(m.motion_deg, 2), number(m.motion_length, 4));
        writeln!(f, "{:<8} {angle:>9} {position:>9} {:>12}  or {length}", "mean", format!("{degrees} deg"))?;
        writeln!(f)?;
        let columns = ["start", "end", "mean", "floor", "dense", "floor", "F"];
        write!(f, "{:<8}", "CD x1000")?;
        columns[..6].iter().try_for_each(|c| write!(f, " {c:>9}"))?;
        writeln!(f, " {:>8}", columns[6])?;
        mesh_row(f, "CD-s", &self.fixed)?;
        for p in self.parts.iter().filter(|_| self.parts.len() > 1) {
            mesh_row(f, &format!("CD-m {}", p.truth + 1), &p.mesh)?;
        }
        mesh_row(f, "CD-m", &self.movable)?;
        mesh_row(f, "CD-w", &self.whole)?;
        let c = &self.counts;
        writeln!(
            f,
            "floor: what the true mesh itself scores, by sampling; dense: 100,000 samples, not 10,000; F: F-score at 1 % \
             of the diagonal"
        )?;
        write!(
            f,
            "\nparts: {} of {} found, {} missing, {} extra, {} of wrong type; {} meshes missing",
            c.found, c.truths, c.missing, c.extra, c.wrong_type, c.missing_meshes
        )?;
        if c.wrong_parent > 0 {
            write!(f, "\n{} on another part than the true one: compared by motion against that", c.wrong_parent)?;
        }
        write!(f, "\n{}", self.verdict())?;
        self.pictures.map_or(Ok(()), |pictures| write!(f, "\n\n{}", PictureReport { pictures }))
    }
}
