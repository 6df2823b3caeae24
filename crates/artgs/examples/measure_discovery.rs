//! Measures discovery alone on captures with a ground truth: part count, types, joints and labels.
//!
//! `cargo run --release -p artgs --example measure_discovery -- [--parts auto|given] CAPTURE...`
//! prints one line per capture, and with `--joints` one JSON line per found joint.

#![allow(clippy::print_stdout, reason = "an example prints")]

use artgs::discover::{DepthPicture, DiscoverConfig, Discovery, Scene, discover};
use artgs::evaluate::{axis_angle_deg, axis_position};
use artgs_core::{JointKind, Mesh, PerState, State};
use artgs_io::ground_truth::{GroundTruth, load_ground_truth};
use glam::{DVec3, Vec3};
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let given = arguments.windows(2).any(|w| w[0] == "--parts" && w[1] == "given");
    let joints = arguments.iter().any(|a| a == "--joints");
    let mut folders = Vec::new();
    let mut rest = arguments.iter();
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--parts" => _ = rest.next(),
            "--joints" => {}
            folder => folders.push(folder.to_string()),
        }
    }
    for folder in folders {
        if let Err(error) = measure(Path::new(&folder), given, joints) {
            println!("{folder}: {error}");
        }
    }
    Ok(())
}

/// True part of every point of a state: that of the nearest point sampled on the true meshes.
fn true_labels(truth: &GroundTruth, state: State, points: &[Vec3], spacing: f64) -> Vec<usize> {
    let cell = 2.0 * spacing;
    let key = |p: DVec3| (p / cell).floor().as_ivec3().to_array();
    let mut grid = std::collections::BTreeMap::<[i32; 3], Vec<(DVec3, usize)>>::new();
    let meshes: Vec<&Mesh> =
        std::iter::once(&truth.fixed[state]).chain(truth.movable.iter().map(|m| &m[state])).collect();
    for (part, mesh) in meshes.iter().enumerate() {
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| Vec3::from(mesh.vertices[i as usize]).as_dvec3());
            let longest = (b - a).length().max((c - a).length()).max((c - b).length());
            let n = (longest / (0.5 * spacing)).ceil().max(1.0) as usize;
            for i in 0..=n {
                for j in 0..=n - i {
                    let (u, v) = (i as f64 / n as f64, j as f64 / n as f64);
                    let p = a + (b - a) * u + (c - a) * v;
                    grid.entry(key(p)).or_default().push((p, part));
                }
            }
        }
    }
    let nearest = |p: &Vec3| {
        let p = p.as_dvec3();
        let k = key(p);
        let mut best = (f64::INFINITY, 0);
        for d in 0..27 {
            let at = [k[0] + d % 3 - 1, k[1] + d / 3 % 3 - 1, k[2] + d / 9 - 1];
            for (q, part) in grid.get(&at).map_or(&[][..], |v| v) {
                let distance = p.distance_squared(*q);
                if distance < best.0 {
                    best = (distance, *part);
                }
            }
        }
        best.1
    };
    points.iter().map(nearest).collect()
}

fn measure(folder: &Path, given: bool, joints: bool) -> Result<(), Box<dyn std::error::Error>> {
    let truth = load_ground_truth(&folder.join("gt"))?;
    let capture = artgs_io::load_capture(folder)?;
    let views = PerState::from_fn(|s| {
        let views = capture.states[s].train.iter();
        views.filter_map(|view| Some(DepthPicture { view, depth: view.depth.as_ref()? })).collect::<Vec<_>>()
    });
    let config = DiscoverConfig::default();
    let begun = Instant::now();
    let count = truth.joints.len();
    let scene = Scene::new(views.as_ref().map(Vec::as_slice), &config)?;
    let found = discover(&scene, if given { count..=count } else { 1..=40 }, &config)?;
    let seconds = begun.elapsed().as_secs_f64();
    let labels = PerState::from_fn(|s| true_labels(&truth, s, &found.clouds[s].points, found.spacing));
    let name = folder.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    report(&name, &truth, &found, &labels, seconds, joints);
    Ok(())
}

fn report(
    name: &str,
    truth: &GroundTruth,
    found: &Discovery,
    labels: &PerState<Vec<usize>>,
    seconds: f64,
    joints: bool,
) {
    let (n, m) = (found.parts.len(), truth.joints.len());
    let mut overlap = vec![vec![0usize; m + 1]; n + 1];
    for s in State::ALL {
        found.labels[s].iter().zip(&labels[s]).for_each(|(l, t)| overlap[usize::from(*l)][*t] += 1);
    }
    let iou = |k: usize, t: usize| {
        let own: usize = overlap[k].iter().sum();
        let true_points: usize = overlap.iter().map(|row| row[t]).sum();
        overlap[k][t] as f64 / (own + true_points - overlap[k][t]).max(1) as f64
    };
    let mut pairs: Vec<(f64, usize, usize)> =
        (1..=n).flat_map(|k| (1..=m).map(move |t| (k, t))).map(|(k, t)| (iou(k, t), k, t)).collect();
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut of_truth, mut of_found) = (vec![None; m + 1], vec![None; n + 1]);
    for (v, k, t) in pairs {
        if v > 0.1 && of_truth[t].is_none() && of_found[k].is_none() {
            (of_truth[t], of_found[k]) = (Some(k), Some(t));
        }
    }
    let mut line = Vec::new();
    let (mut worst, mut right) = (0.0f64, 0);
    for k in 1..=n {
        let part = &found.parts[k - 1];
        let size: usize = overlap[k].iter().sum();
        let confidence = part.confidence.unwrap_or(-1.0);
        let Some(t) = of_found[k] else {
            let joint = part.joint_near(&found.parts, found.middle(k, State::START));
            line.push(format!(
                "[{k}: SPURIOUS {} n={size} c={confidence:.2} axis {:.2} at {:.2} by {:.3} middle {:.2}]",
                letter(part.kind),
                joint.axis,
                joint.origin,
                joint.limits[1],
                found.middle(k, State::START)
            ));
            if joints {
                println!(
                    "{{\"capture\":\"{name}\",\"part\":{k},\"correct\":false,\"confidence\":{confidence},\"why\":\"spurious\",\"support\":{}}}",
                    support(found, k)
                );
            }
            continue;
        };
        let motion = truth.start_to_end(t - 1);
        let joint = truth.joints[t - 1];
        let own = part.joint_near(&found.parts, found.middle(k, State::START));
        let axis = axis_angle_deg(own.axis, joint.axis);
        let position = axis_position(&own, &joint).unwrap_or(0.0) / found.diagonal;
        let middle = found.middle(k, State::START);
        let shift = part.motion.apply(middle).distance(motion.apply(middle)) / found.diagonal;
        let size_of_part = extent(found, k) / found.diagonal;
        let type_ok = part.kind == joint.kind;
        let ok =
            type_ok && axis < 5.0 && position < 0.05 * size_of_part.max(0.02) && shift < 0.05 * size_of_part.max(0.02);
        if type_ok && axis < 1.0 && shift < 0.02 {
            right += 1;
        }
        worst = worst.max(axis);
        line.push(format!(
            "[{k}>{t} {}{} {axis:.3}d p{:.4} s{:.4} iou{:.2} n={size} c={confidence:.2}]",
            letter(part.kind),
            if type_ok { "" } else { "!" },
            position,
            shift,
            iou(k, t)
        ));
        if joints {
            println!(
                "{{\"capture\":\"{name}\",\"part\":{k},\"correct\":{ok},\"confidence\":{confidence},\"axis\":{axis:.4},\"position\":{position:.5},\"shift\":{shift:.5},\"type_ok\":{type_ok},\"support\":{}}}",
                support(found, k)
            );
        }
    }
    let missing: Vec<usize> = (1..=m).filter(|t| of_truth[*t].is_none()).collect();
    let verdict = if n == m && right == m { "OK " } else { "BAD" };
    println!(
        "{verdict} {name} {n}/{m} right {right} worst {worst:.3} {seconds:.1}s {} missing {missing:?}",
        line.join(" ")
    );
    found.warnings.iter().for_each(|w| println!("      warning: {w}"));
}

fn support(found: &Discovery, part: usize) -> String {
    let Some(s) = found.support.get(part - 1) else { return "null".into() };
    format!(
        "[{},{:.4},{:.4},{:.4},{:.4},{:.4},{:.3},{:.2},{:.1},{:.4}]",
        s.moved, s.explained, s.exclusive, s.cost, s.margin, s.stiffness, s.residual, s.shift, s.size, s.unexplained
    )
}

fn letter(kind: JointKind) -> char {
    match kind {
        JointKind::Revolute => 'R',
        JointKind::Prismatic => 'P',
        JointKind::Screw => 'S',
    }
}

fn extent(found: &Discovery, part: usize) -> f64 {
    let s = State::START;
    let points = found.clouds[s].points.iter().zip(&found.labels[s]).filter(|(_, l)| usize::from(**l) == part);
    let (lo, hi) = points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), (p, _)| (lo.min(*p), hi.max(*p)));
    f64::from((hi - lo).max(Vec3::ZERO).length())
}
