//! Scores as text, in the layout of the paper's tables.

use super::geometry::MeshScore;
use super::joints::Motion;
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
            writeln!(f, "{label:<8} {:>9} {:>9} {motion:>12}  {kind}{slide}", number(angle, 2), number(position, 3))?;
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
        self.pictures.map_or(Ok(()), |pictures| write!(f, "\n\n{}", PictureReport { pictures }))
    }
}
