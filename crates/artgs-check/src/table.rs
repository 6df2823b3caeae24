//! A report as text.

use crate::report::{CheckReport, CoverageFinding, FormatFinding, JointFinding, Verdict};
use artgs_core::{JointKind, State};
use std::fmt;

/// A joint value in degrees or millimetres.
pub(crate) fn quantity(kind: JointKind, value: f64) -> String {
    // Adding zero converts -0 to 0.
    let round = |v: f64| (v * 10.0).round() / 10.0 + 0.0;
    match kind {
        JointKind::Prismatic => format!("{:.1} mm", round(1e3 * value)),
        JointKind::Revolute | JointKind::Screw => format!("{:.1} deg", round(value.to_degrees())),
    }
}

/// The value at which a joint stopped.
pub(crate) fn stopped_at(kind: JointKind, value: Option<f64>) -> String {
    value.map_or("an unknown value".into(), |value| quantity(kind, value))
}

fn verdict(problems: &[String]) -> &'static str {
    if problems.is_empty() { "ok" } else { "FAILED" }
}

/// Rows padded to columns; every row is followed by its problems, indented.
struct Table {
    rows: Vec<(Vec<String>, Vec<String>)>,
}

impl Table {
    fn new(head: &[&str]) -> Self {
        Self { rows: vec![(head.iter().map(ToString::to_string).collect(), Vec::new())] }
    }

    fn push(&mut self, cells: Vec<String>, problems: &[String]) {
        self.rows.push((cells, problems.to_vec()));
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let columns = self.rows[0].0.len();
        let width = |c: usize| self.rows.iter().map(|(r, _)| r[c].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..columns).map(width).collect();
        for (cells, problems) in &self.rows {
            let padded: Vec<String> = cells.iter().zip(&widths).map(|(c, w)| format!("{c:<w$}")).collect();
            writeln!(f, "{}", padded.join("  ").trim_end())?;
            for problem in problems {
                writeln!(f, "    - {problem}")?;
            }
        }
        Ok(())
    }
}

fn content(found: &FormatFinding) -> String {
    let counts = [
        (found.links, "links"),
        (found.joints, "joints"),
        (found.meshes, "meshes"),
        (found.hulls, "hulls"),
        (found.textures, "textures"),
        (found.splats, "Gaussians"),
    ];
    let texts: Vec<String> = counts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")).collect();
    texts.join(", ")
}

/// Problems, then warnings, marked as such.
fn warned(problems: &[String], warnings: &[String]) -> Vec<String> {
    problems.iter().cloned().chain(warnings.iter().map(|w| format!("warning: {w}"))).collect()
}

fn graded(problems: &[String], warnings: &[String]) -> &'static str {
    if problems.is_empty() && !warnings.is_empty() { "warning" } else { verdict(problems) }
}

fn coverage_row(found: &CoverageFinding) -> Vec<String> {
    let verdict = graded(&found.problems, &found.warnings);
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let mm = |length: f64| format!("{:.0} mm", 1e3 * length);
    vec![
        found.link.clone(),
        verdict.into(),
        percent(found.visual),
        percent(found.hulls),
        mm(found.hole),
        mm(found.obstacle),
        format!("{:.2} l, {}", 1e3 * found.phantom_volume, mm(found.phantom_depth)),
        found.lost.to_string(),
    ]
}

fn joint_row(found: &JointFinding) -> Vec<String> {
    let range = |v: [f64; 2]| format!("{} to {}", quantity(found.kind, v[0]), quantity(found.kind, v[1]));
    let unit = if found.kind == JointKind::Prismatic { "N" } else { "N m" };
    let drift = found.drift.iter().flatten().fold(0.0, |a: f64, b| a.max(*b));
    vec![
        found.joint.clone(),
        verdict(&found.problems).into(),
        range(found.limits),
        format!("{} to {}", stopped_at(found.kind, found.stopped[0]), stopped_at(found.kind, found.stopped[1])),
        found.observed.map_or("unknown".into(), |v| range([v[State::START], v[State::END]])),
        format!("{:.2} {unit}", found.force),
        format!("{:.2} mm", 1e3 * found.penetration),
        if found.drift.iter().all(Option::is_none) { "-".into() } else { quantity(found.kind, drift) },
    ]
}

impl fmt::Display for CheckReport {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let mut formats = Table::new(&["format", "", "file", "reader", "content"]);
        for found in &self.formats {
            let cells = vec![
                found.format.clone(),
                verdict(&found.problems).into(),
                found.file.clone(),
                found.reader.clone(),
                content(found),
            ];
            formats.push(cells, &found.problems);
        }
        write!(f, "{formats}")?;
        if let Some(found) = &self.files {
            let mut files = Table::new(&["files", "", "compared with"]);
            let cells = vec![found.written.to_string(), verdict(&found.problems).into(), "exports/export.json".into()];
            files.push(cells, &found.problems);
            write!(f, "\n{files}")?;
        }
        if !self.links.is_empty() {
            let mut links = Table::new(&["link", "", "mass", "moments of inertia", "hulls"]);
            for found in &self.links {
                let [a, b, c] = found.moments;
                let moments = format!("{a:.2e} {b:.2e} {c:.2e} kg m^2");
                let mass = format!("{:.3} kg", found.mass);
                let cells =
                    vec![found.link.clone(), verdict(&found.problems).into(), mass, moments, found.hulls.to_string()];
                links.push(cells, &found.problems);
            }
            write!(f, "\n{links}")?;
        }
        if !self.coverage.is_empty() {
            let head = [
                "hulls of",
                "",
                "visual covered",
                "hulls near it",
                "widest hole",
                "obstacle",
                "without surface",
                "lost",
            ];
            let mut hulls = Table::new(&head);
            for found in &self.coverage {
                let said = warned(&found.problems, &found.warnings);
                hulls.push(coverage_row(found), &said);
            }
            write!(f, "\n{hulls}")?;
        }
        if !self.drops.is_empty() {
            let mut drops =
                Table::new(&["drops onto", "", "flat places", "balls and boxes", "in the way", "sink", "fall through"]);
            for found in &self.drops {
                let counts =
                    [found.places, found.dropped, found.blocked, found.sank, found.fell].map(|n| n.to_string());
                let verdict = graded(&found.problems, &found.warnings);
                let cells = [found.link.clone(), verdict.into()].into_iter().chain(counts).collect();
                drops.push(cells, &warned(&found.problems, &found.warnings));
            }
            write!(f, "\n{drops}")?;
        }
        if !self.fingers.is_empty() {
            let mut fingers = Table::new(&["fingers behind the handles of", "", "places", "blocked"]);
            for found in &self.fingers {
                let verdict = graded(&found.problems, &found.warnings);
                let [places, blocked] = [found.gaps, found.blocked].map(|n| n.to_string());
                let said = warned(&found.problems, &found.warnings);
                fingers.push(vec![found.link.clone(), verdict.into(), places, blocked], &said);
            }
            write!(f, "\n{fingers}")?;
        }
        if !self.joints.is_empty() {
            let mut joints =
                Table::new(&["joint", "", "limits", "reached", "observed", "force", "penetration", "drift"]);
            self.joints.iter().for_each(|found| joints.push(joint_row(found), &found.problems));
            write!(f, "\n{joints}")?;
        }
        if !self.limits.is_empty() {
            let mut limits = Table::new(&["visual meshes at limits", "", "inside of others"]);
            for found in &self.limits {
                let [lower, upper] = found.inside.map(|share| format!("{:.1} %", 100.0 * share));
                let graded = graded(&[], &found.warnings);
                let cells = vec![found.joint.clone(), graded.into(), format!("{lower} to {upper}")];
                limits.push(cells, &warned(&[], &found.warnings));
            }
            write!(f, "\n{limits}")?;
        }
        if !self.states.is_empty() {
            let mut states = Table::new(&["state", "", "penetration"]);
            for found in &self.states {
                let depth = format!("{:.2} mm", 1e3 * found.penetration);
                states.push(vec![found.state.clone(), verdict(&found.problems).into(), depth], &found.problems);
            }
            write!(f, "\n{states}")?;
        }
        for note in &self.notes {
            write!(f, "\nnote: {note}")?;
        }
        if !self.notes.is_empty() {
            writeln!(f)?;
        }
        match self.warnings {
            0 => {}
            1 => writeln!(f, "\n1 warning")?,
            n => writeln!(f, "\n{n} warnings")?,
        }
        match self.failures {
            0 if self.links.is_empty() => writeln!(f, "\nall checks that ran passed; no joint was driven"),
            0 => writeln!(f, "\nall checks passed"),
            1 => writeln!(f, "\n1 problem"),
            n => writeln!(f, "\n{n} problems"),
        }?;
        let mut remedies: Vec<String> = Vec::new();
        for rule in self.rules().into_iter().filter(|rule| rule.verdict == Verdict::Failed && !rule.remedy.is_empty()) {
            if !remedies.contains(&rule.remedy) {
                remedies.push(rule.remedy);
            }
        }
        remedies.iter().try_for_each(|remedy| writeln!(f, "to do: {remedy}"))
    }
}
