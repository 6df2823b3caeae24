//! The findings of a check as rules: one line per rule and subject, with what was measured and what is allowed.

use crate::CheckOptions;
use crate::report::{
    CheckReport, CoverageFinding, DropFinding, FingerFinding, FormatFinding, JointFinding, LimitFinding, LinkFinding,
    RuleFinding, StateFinding, Verdict,
};
use artgs_core::{JointKind, State};

const AGAIN: &str = "export again";
const LIMITS: &str = "give the joint its observed limits (artgs export --observed-limits), or correct the parts";
const HULLS: &str = "export with more pieces (--hulls) or with --collision coacd";
const MASS: &str = "give a mass or a density (artgs export --mass, --density), or the scale (--scale)";

/// A value that must not exceed a limit.
fn most(id: &str, checked: impl Into<String>, measured: f64, limit: f64, unit: &str, remedy: &str) -> RuleFinding {
    let verdict = if measured <= limit { Verdict::Passed } else { Verdict::Failed };
    let (id, checked, unit, remedy) = (id.into(), checked.into(), unit.into(), remedy.into());
    RuleFinding {
        id,
        checked,
        verdict,
        measured: Some(measured),
        limit: Some(limit),
        unit,
        remedy,
        ..RuleFinding::default()
    }
}

/// A value that must reach a limit.
fn least(id: &str, checked: &str, measured: f64, limit: f64, unit: &str, remedy: &str) -> RuleFinding {
    let verdict = if measured >= limit { Verdict::Passed } else { Verdict::Failed };
    RuleFinding { verdict, at_least: true, ..most(id, checked, measured, limit, unit, remedy) }
}

fn skipped(id: &str, checked: &str, subject: &str, note: &str, remedy: &str) -> RuleFinding {
    let [id, checked, subject, note, remedy] = [id, checked, subject, note, remedy].map(str::to_owned);
    RuleFinding { id, checked, subject, verdict: Verdict::Skipped, note, remedy, ..RuleFinding::default() }
}

/// The rules of one subject agree with what the check says about it: without a problem none fails. A problem or a warning that no
/// value shows has a line of its own.
fn settled(
    group: &str,
    subject: &str,
    mut rules: Vec<RuleFinding>,
    problems: &[String],
    warnings: &[String],
) -> Vec<RuleFinding> {
    let kept = match (problems.is_empty(), warnings.is_empty()) {
        (false, _) => Verdict::Failed,
        (true, false) => Verdict::Warning,
        (true, true) => Verdict::Passed,
    };
    let mut shown = false;
    for rule in &mut rules {
        rule.subject = subject.into();
        if rule.verdict == Verdict::Failed {
            rule.verdict = kept;
            shown |= kept != Verdict::Passed;
        }
    }
    let said = [problems, warnings].concat().join("; ");
    if kept != Verdict::Passed {
        match rules.iter_mut().find(|rule| rule.verdict == kept && shown) {
            Some(rule) => rule.note = said,
            None => rules.push(RuleFinding {
                id: format!("{group}.other"),
                subject: subject.into(),
                checked: "nothing else is wrong".into(),
                verdict: kept,
                note: said,
                remedy: AGAIN.into(),
                ..RuleFinding::default()
            }),
        }
    }
    rules
}

impl CheckReport {
    /// One line per rule and subject. As many subjects have failed rules as have problems; what could not be checked is skipped.
    pub fn rules(&self) -> Vec<RuleFinding> {
        let options = &self.options;
        let mut out = self.files();
        out.extend(self.formats.iter().flat_map(format));
        out.extend(self.links.iter().flat_map(link));
        out.extend(self.coverage.iter().flat_map(|found| coverage(found, options)));
        out.extend(self.drops.iter().flat_map(drop));
        out.extend(self.fingers.iter().flat_map(finger));
        out.extend(self.joints.iter().flat_map(|found| joint(found, options)));
        out.extend(self.limits.iter().flat_map(|found| limit(found, options)));
        out.extend(self.states.iter().flat_map(|found| state(found, options)));
        out.extend(self.notes.iter().map(|note| skipped("check.note", "what was not checked", "exports", note, "")));
        out
    }

    fn files(&self) -> Vec<RuleFinding> {
        let (id, checked) = ("files.unchanged", "files have the digests that export.json records");
        match &self.files {
            Some(found) => {
                let rule = most(id, checked, found.problems.len() as f64, 0.0, "", AGAIN);
                settled("files", "exports/export.json", vec![rule], &found.problems, &[])
            }
            None => vec![skipped(id, checked, "exports/export.json", "no digests are recorded", AGAIN)],
        }
    }
}

fn format(found: &FormatFinding) -> Vec<RuleFinding> {
    let of_profile = |problem: &&String| found.rules.iter().any(|rule| problem.starts_with(&format!("{}: ", rule.id)));
    let (_, own): (Vec<&String>, Vec<&String>) = found.problems.iter().partition(of_profile);
    let own: Vec<String> = own.into_iter().cloned().collect();
    let is_closed = own.iter().any(|problem| problem.starts_with("does not open"));
    let checked = format!("opens with {}", found.reader);
    let opens = most("format.opens", checked, f64::from(u8::from(is_closed)), 0.0, "", AGAIN);
    let differences = own.len() - usize::from(is_closed);
    let checked = "content is sound and the same as in the other formats";
    let agrees = most("format.agrees", checked, differences as f64, 0.0, "", AGAIN);
    let mut out = settled("format", &found.file, vec![opens, agrees], &own, &[]);
    out.extend(found.rules.iter().cloned());
    out
}

fn link(found: &LinkFinding) -> Vec<RuleFinding> {
    let [a, b, c] = found.moments;
    let rules = vec![
        least("link.mass", "the mass is above 0", found.mass, f64::MIN_POSITIVE, "kg", MASS),
        most(
            "link.inertia",
            "the largest moment of inertia is at most the sum of the others",
            c,
            (a + b) * 1.000_001,
            "kg m^2",
            MASS,
        ),
    ];
    settled("link", &found.link, rules, &found.problems, &[])
}

fn coverage(found: &CoverageFinding, options: &CheckOptions) -> Vec<RuleFinding> {
    let rules = vec![
        least(
            "hulls.cover",
            "share of the visible surface with a hull nearby",
            found.visual,
            options.covered,
            "",
            HULLS,
        ),
        least("hulls.near", "share of the hulls near the visible surface", found.hulls, options.covered, "", HULLS),
        most("hulls.hole", "width of the largest hole", found.hole, options.hole, "m", HULLS),
        most(
            "hulls.obstacle",
            "width of the largest hull before the visible surface",
            found.obstacle,
            options.hole,
            "m",
            HULLS,
        ),
        most("hulls.phantom", "depth of hulls where nothing is visible", found.phantom_depth, options.hole, "m", HULLS),
        most("hulls.lost", "pieces of the surface that lost their hull", found.lost as f64, 0.0, "", HULLS),
    ];
    settled("hulls", &found.link, rules, &found.problems, &found.warnings)
}

fn drop(found: &DropFinding) -> Vec<RuleFinding> {
    let count = |id: &str, checked: &str, n: usize| most(id, checked, n as f64, 0.0, "", HULLS);
    let rules = vec![
        count(
            "drop.fell",
            &format!("of {} balls and boxes dropped, those that fall through", found.dropped),
            found.fell,
        ),
        count("drop.sank", "those that sink", found.sank),
        count("drop.blocked", "those that start inside a hull", found.blocked),
    ];
    settled("drop", &found.link, rules, &found.problems, &found.warnings)
}

fn finger(found: &FingerFinding) -> Vec<RuleFinding> {
    let checked = format!("of {} places behind handles, those where a hull is in the way of a finger", found.gaps);
    let rule = most("handle.reach", checked, found.blocked as f64, (found.gaps / 2) as f64, "", HULLS);
    settled("handle", &found.link, vec![rule], &found.problems, &found.warnings)
}

fn joint(found: &JointFinding, options: &CheckOptions) -> Vec<RuleFinding> {
    let slides = found.kind == JointKind::Prismatic;
    let (unit, near) = if slides { ("m", options.length) } else { ("rad", options.angle) };
    let mut rules = Vec::new();
    for (end, name) in ["lower", "upper"].into_iter().enumerate() {
        let checked = format!("distance from the {name} limit after it was driven there");
        let id = format!("joint.{name}");
        match found.stopped[end] {
            Some(stopped) => rules.push(most(&id, checked, (stopped - found.limits[end]).abs(), near, unit, LIMITS)),
            None => rules.push(skipped(&id, &checked, "", "the engine computed no finite value", LIMITS)),
        }
        let (id, checked) = (format!("joint.{name}.holds"), format!("motion while it is held at the {name} limit"));
        match found.drift[end] {
            Some(drift) => rules.push(most(&id, checked, drift, near, unit, LIMITS)),
            None => rules.push(skipped(&id, &checked, "", "the limit was not reached", LIMITS)),
        }
    }
    let checked = "deepest penetration of two links, other joints at 0";
    rules.push(most("joint.penetration", checked, found.penetration, options.penetration, "m", LIMITS));
    let id = "joint.observed";
    match found.observed {
        Some(observed) => {
            let [lower, upper] = found.limits;
            let beyond = State::ALL.map(|state| (lower - observed[state]).max(observed[state] - upper).max(0.0));
            let checked = "how far the observed values are beyond the limits";
            rules.push(most(id, checked, beyond[0].max(beyond[1]), near, unit, AGAIN));
        }
        None => {
            let note = "no format with observed values is there";
            rules.push(skipped(
                id,
                "the observed values are within the limits",
                "",
                note,
                "export mjcf, usd or glb, too",
            ));
        }
    }
    settled("joint", &found.joint, rules, &found.problems, &[])
}

fn limit(found: &LimitFinding, options: &CheckOptions) -> Vec<RuleFinding> {
    let checked = "share of the visible surface that is inside of another link at a limit";
    let [lower, upper] = found.inside;
    let rule = most("limit.inside", checked, lower.max(upper), options.inside, "", LIMITS);
    settled("limit", &found.joint, vec![rule], &[], &found.warnings)
}

fn state(found: &StateFinding, options: &CheckOptions) -> Vec<RuleFinding> {
    let checked = "deepest penetration of two links, all joints as observed";
    let rule = most("state.penetration", checked, found.penetration, options.penetration, "m", LIMITS);
    settled("state", &found.state, vec![rule], &found.problems, &[])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(problems: &[&str]) -> JointFinding {
        JointFinding {
            joint: "door_joint".into(),
            link: "door".into(),
            kind: JointKind::Revolute,
            limits: [0.0, 1.5],
            stopped: [Some(0.001), Some(0.7)],
            reached: [true, false],
            blocked_by: [None, None],
            force: 1.0,
            drift: [Some(0.0), None],
            penetration: 0.0,
            penetration_at: 0.0,
            penetration_between: None,
            observed: None,
            problems: problems.iter().map(ToString::to_string).collect(),
        }
    }

    fn verdicts(problems: &[&str]) -> Vec<(String, Verdict)> {
        joint(&found(problems), &CheckOptions::default()).into_iter().map(|rule| (rule.id, rule.verdict)).collect()
    }

    #[test]
    fn a_value_beyond_its_limit_fails_and_carries_the_problem() {
        let rules = joint(&found(&["stops early"]), &CheckOptions::default());
        let failed: Vec<&RuleFinding> = rules.iter().filter(|rule| rule.verdict == Verdict::Failed).collect();
        assert_eq!(failed.len(), 1);
        assert_eq!((failed[0].id.as_str(), failed[0].note.as_str()), ("joint.upper", "stops early"));
        assert!((failed[0].measured.unwrap() - 0.8).abs() < 1e-12 && failed[0].unit == "rad");
        assert!(rules.iter().all(|rule| rule.subject == "door_joint"));
        let skipped: Vec<_> = rules.iter().filter(|r| r.verdict == Verdict::Skipped).map(|r| r.id.as_str()).collect();
        assert_eq!(skipped, ["joint.upper.holds", "joint.observed"]);
    }

    #[test]
    fn what_no_value_shows_has_a_line_of_its_own() {
        let mut sound = found(&["cannot be driven"]);
        sound.stopped = [Some(0.0), Some(1.5)];
        let rules = joint(&sound, &CheckOptions::default());
        let last = rules.last().unwrap();
        assert_eq!(
            (last.id.as_str(), last.verdict, last.note.as_str()),
            ("joint.other", Verdict::Failed, "cannot be driven")
        );
        // The check accepts what no problem mentions.
        assert!(verdicts(&[]).iter().all(|(_, verdict)| *verdict != Verdict::Failed));
    }
}
