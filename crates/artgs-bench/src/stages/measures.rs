//! The measures of every stage.

use super::truth::TrueParts;
use artgs::evaluate::{Motion, hungarian, joint_errors};
use artgs::fit::{mean_score, score_views};
use artgs::run::{PublishedTrace, TraceSample};
use artgs_core::{Joint, JointKind, Splats, State};
use artgs_io::run_folder::load_json;
use artgs_io::{GroundTruth, RunFolder, load_capture, load_ground_truth, read_splat_ply};
use glam::DVec3;
use std::path::Path;

/// A Gaussian is on the surface if it is nearer than this share of the diagonal.
const ON_SURFACE: f64 = 0.01;
/// A canonical Gaussian counts for the assignment if it is nearer than this share of the diagonal to the true canonical surface.
const ASSIGNED: f64 = 0.02;

/// One number of one stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Value {
    /// Stage, as in the table.
    pub stage: &'static str,
    /// What was measured, with its unit.
    pub what: String,
    /// The number.
    pub value: f64,
}

/// A number over the steps of a training.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// What was measured, with its unit.
    pub what: &'static str,
    /// Name of the line.
    pub name: String,
    /// Step and number.
    pub points: Vec<(usize, f64)>,
}

/// All measures of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StageMeasures {
    /// In the order of the stages.
    pub values: Vec<Value>,
    /// Over the steps.
    pub curves: Vec<Curve>,
}

impl StageMeasures {
    fn push(&mut self, stage: &'static str, what: impl Into<String>, value: f64) {
        self.values.push(Value { stage, what: what.into(), value });
    }
}

/// Measures the stages that a run of the published method saved, with the ground truth of its capture. The error says what is
/// missing.
pub fn measure_stages(run: &Path, capture: &Path) -> Result<StageMeasures, String> {
    let folder = RunFolder::new(run);
    let path = folder.published_trace();
    let trace: Option<PublishedTrace> = load_json(&path).map_err(|e| e.to_string())?;
    let trace = trace.ok_or_else(|| {
        format!(
            "{}: there is no such file; only runs with --preset paper have measures of their stages",
            path.display()
        )
    })?;
    let truth = load_ground_truth(&capture.join("gt")).map_err(|e| e.to_string())?;
    let views = load_capture(capture).map_err(|e| e.to_string())?;
    let parts = TrueParts::new(&truth).ok_or("a true part has no surface")?;
    let mut out = StageMeasures::default();
    for state in State::ALL {
        let path = folder.single_splats(state);
        let (splats, _) = read_splat_ply(&path).map_err(|e| e.to_string())?;
        let test = &views.states[state].test;
        let psnr = (!test.is_empty()).then(|| mean_score(&score_views(&splats, test)).psnr);
        single(&mut out, &parts, &splats, state, psnr);
        if !trace.clusters[state.index()].is_empty() {
            mask(&mut out, &parts, &splats, state, &trace);
        }
    }
    matching(&mut out, &parts, &trace);
    centres(&mut out, &parts, &trace);
    types(&mut out, &truth, &parts, &trace);
    training(&mut out, &truth, &parts, &trace);
    Ok(out)
}

fn share(part: usize, whole: usize) -> f64 {
    part as f64 / whole.max(1) as f64
}

fn place(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// `psnr` is that of held-out views.
fn single(out: &mut StageMeasures, parts: &TrueParts, splats: &Splats, state: State, psnr: Option<f64>) {
    const STAGE: &str = "1 single";
    let name = state.name();
    if let Some(psnr) = psnr {
        out.push(STAGE, format!("{name}: PSNR of held-out views, dB"), psnr);
    }
    let [mut on, mut total, mut within, mut without] = [0.0f64; 4];
    let mut near = 0;
    for (p, logit) in splats.means.iter().zip(&splats.logit_opacities) {
        let opacity = 1.0 / (1.0 + f64::from(-logit).exp());
        total += opacity;
        if parts.at(*p, state).1 <= ON_SURFACE * parts.diagonal {
            near += 1;
            on += opacity;
        } else if parts.encloses(*p, state) {
            within += opacity;
        } else {
            without += opacity;
        }
    }
    let total = total.max(1e-12);
    out.push(STAGE, format!("{name}: share within 1 % of the surface"), share(near, splats.len()));
    out.push(STAGE, format!("{name}: share of opacity there"), on / total);
    out.push(STAGE, format!("{name}: share of opacity inside"), within / total);
    out.push(STAGE, format!("{name}: share of opacity outside"), without / total);
}

fn mask(out: &mut StageMeasures, parts: &TrueParts, splats: &Splats, state: State, trace: &PublishedTrace) {
    const STAGE: &str = "3 mask";
    let name = state.name();
    let mut moved = vec![false; splats.len()];
    trace.clusters[state.index()].iter().for_each(|&(i, _)| {
        if let Some(flag) = moved.get_mut(i) {
            *flag = true;
        }
    });
    let labels: Vec<usize> = splats.means.iter().map(|p| usize::from(parts.at(*p, state).0)).collect();
    let count =
        |wanted: &dyn Fn(usize, bool) -> bool| labels.iter().zip(&moved).filter(|(l, m)| wanted(**l, **m)).count();
    let right = count(&|l, m| l > 0 && m);
    out.push(STAGE, format!("{name}: precision"), share(right, count(&|_, m| m)));
    out.push(STAGE, format!("{name}: recall"), share(right, count(&|l, _| l > 0)));
    for k in 1..parts.parts() {
        out.push(
            STAGE,
            format!("{name}: recall of true part {k}"),
            share(count(&|l, m| l == k && m), count(&|l, _| l == k)),
        );
    }
}

fn matching(out: &mut StageMeasures, parts: &TrueParts, trace: &PublishedTrace) {
    const STAGE: &str = "2 matching";
    if trace.pairs.is_empty() {
        return;
    }
    let (mut same, mut off) = (0, Vec::new());
    for [start, end] in &trace.pairs {
        let (a, b) = (parts.at(*start, State::START).0, parts.at(*end, State::END).0);
        same += usize::from(a == b);
        let truth = parts.half_motions[usize::from(a)].apply(place(*start));
        off.push((0.5 * (place(*start) + place(*end)) - truth).length() / parts.diagonal);
    }
    off.sort_by(f64::total_cmp);
    out.push(STAGE, "share of pairs on the same part", share(same, trace.pairs.len()));
    out.push(STAGE, "median distance to the true midpoint / diagonal", off[off.len() / 2]);
    out.push(STAGE, "90 % of the distances / diagonal", off[off.len() * 9 / 10]);
}

/// For each true movable part the learnt part with the nearest centre, distinct; and the distances, scene units.
fn centre_pairs(parts: &TrueParts, centres: &[[f32; 3]]) -> Vec<Option<(usize, f64)>> {
    let distance = |k: usize, c: usize| (parts.centres[k] - place(centres[c])).length();
    let learnt = centres.len().saturating_sub(1);
    let costs: Vec<Vec<f64>> = (1..parts.parts()).map(|k| (1..=learnt).map(|c| distance(k, c)).collect()).collect();
    let chosen = hungarian(&costs, learnt);
    chosen.iter().enumerate().map(|(k, c)| c.map(|c| (c + 1, costs[k][c]))).collect()
}

fn centres(out: &mut StageMeasures, parts: &TrueParts, trace: &PublishedTrace) {
    const STAGE: &str = "4 centres";
    for (k, found) in centre_pairs(parts, &trace.centres).iter().enumerate() {
        if let Some((_, distance)) = found {
            out.push(
                STAGE,
                format!("true part {}: distance of the centre / diagonal", k + 1),
                distance / parts.diagonal,
            );
        }
    }
}

/// Degrees of half the true motion, and that of the learnt part with the most places of the true one.
fn types(out: &mut StageMeasures, truth: &GroundTruth, parts: &TrueParts, trace: &PublishedTrace) {
    const STAGE: &str = "5 types";
    let Some(last) = trace.types.last() else { return };
    let (pairs, _) = pairing(parts, last);
    for (k, learnt) in pairs.iter().enumerate() {
        let Some(learnt) = learnt else { continue };
        let true_angle = parts.half_motions[k + 1].angle().to_degrees();
        let what = format!("true part {}: half angle, truly {true_angle:.1} degrees", k + 1);
        out.push(STAGE, what, last.half_angles_deg()[*learnt - 1]);
        let turns = truth.joints[k].kind != JointKind::Prismatic;
        let right = trace.turns.get(*learnt - 1) == Some(&turns);
        out.push(STAGE, format!("true part {}: type right (1) or wrong (0)", k + 1), f64::from(u8::from(right)));
        let angle = |s: &TraceSample| (s.step, s.half_angles_deg().get(*learnt - 1).copied().unwrap_or(0.0));
        let (name, points) =
            (format!("true part {} ({true_angle:.0}°)", k + 1), trace.types.iter().map(angle).collect());
        out.curves.push(Curve { what: "types: half angle, degrees", name, points });
    }
}

/// Learnt part of every true movable part by the places of a sample, and the share of places with the right part.
fn pairing(parts: &TrueParts, sample: &TraceSample) -> (Vec<Option<usize>>, f64) {
    let (truths, learnt) = (parts.parts(), sample.half_motions.len() + 1);
    let mut table = vec![vec![0.0; learnt]; truths];
    for (p, label) in sample.points.iter().zip(&sample.labels) {
        let (part, distance) = parts.at_canonical(*p);
        if distance <= ASSIGNED * parts.diagonal && usize::from(*label) < learnt {
            table[usize::from(part)][usize::from(*label)] += 1.0;
        }
    }
    let costs: Vec<Vec<f64>> = table[1..].iter().map(|row| row[1..].iter().map(|n| -n).collect()).collect();
    let pairs: Vec<Option<usize>> = hungarian(&costs, learnt - 1).into_iter().map(|c| c.map(|c| c + 1)).collect();
    let right = pairs.iter().enumerate().filter_map(|(k, c)| Some(table[k + 1][(*c)?])).sum::<f64>() + table[0][0];
    let total: f64 = table.iter().flatten().sum();
    (pairs, if total > 0.0 { right / total } else { 0.0 })
}

fn training(out: &mut StageMeasures, truth: &GroundTruth, parts: &TrueParts, trace: &PublishedTrace) {
    for (samples, what) in
        [(&trace.types, "types: share of right Gaussians"), (&trace.articulate, "articulate: share of right Gaussians")]
    {
        let points = samples.iter().map(|s| (s.step, pairing(parts, s).1)).collect();
        out.curves.push(Curve { what, name: "right".into(), points });
    }
    for (samples, stage) in [(&trace.types, "5 types"), (&trace.articulate, "6 assignment")] {
        for (sample, name) in [(samples.first(), "first"), (samples.last(), "last")] {
            if let Some(sample) = sample {
                let what = format!("share of right Gaussians at step {} ({name})", sample.step);
                out.push(stage, what, pairing(parts, sample).1);
            }
        }
    }
    let Some(last) = trace.articulate.last() else { return };
    for (k, learnt) in pairing(parts, last).0.iter().enumerate() {
        let Some(learnt) = learnt else { continue };
        let errors = |s: &TraceSample| {
            let half = s.half_motions.get(*learnt - 1)?;
            Some(joint_errors(&Joint::from_motion(truth.joints[k].kind, &(*half * *half)), &truth.joints[k]))
        };
        let points = trace.articulate.iter().filter_map(|s| Some((s.step, errors(s)?.axis_angle_deg))).collect();
        let name = format!("true part {}", k + 1);
        out.curves.push(Curve { what: "joints: error of the axis, degrees", name, points });
        if let Some(e) = errors(last) {
            out.push("7 joints", format!("true part {}: axis, degrees", k + 1), e.axis_angle_deg);
            let unit = if matches!(e.motion, Motion::Degrees(_)) { "degrees" } else { "scene units" };
            out.push("7 joints", format!("true part {}: motion, {unit}", k + 1), e.motion.value());
        }
    }
}

#[cfg(test)]
#[path = "measures_tests.rs"]
mod tests;
