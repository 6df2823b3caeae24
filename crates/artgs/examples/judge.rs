//! Energies of the truth, of what discovery finds, and of what an adversary finds below the truth, by term and part. Truth below found:
//! the search is at fault. Truth above found: the energy is.
//!
//! `cargo run --release -p artgs --example judge -- [--tries N] CAPTURE[=RUN]...`, for captures with ground truth under `gt`, and recordings
//! with such a capture as they are in the folder of a run.
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "a tool for developers")]

use artgs::discover::{DepthPicture, DiscoverConfig, Scene, discover};
use artgs::explain::judge::truth;
use artgs::explain::{ExplainSettings, Explanation, Problem, SearchSettings, Surfels, Terms};
use artgs_core::{PerState, State};
use artgs_io::{GroundTruth, RunFolder};
use rand::SeedableRng;
use std::path::Path;
use std::time::Instant;

/// Most parts that are searched.
const MOST: usize = 24;
/// Points of the true surface of each part that label the surfels.
const SAMPLES: usize = 30_000;
/// Surfels that cost more nats are counted as unexplained.
const UNEXPLAINED: f32 = 1.0;

fn main() {
    let (mut captures, mut raw, mut tries) = (Vec::new(), std::env::args().skip(1), 60);
    while let Some(arg) = raw.next() {
        match arg.as_str() {
            "--tries" => tries = raw.next().unwrap().parse().unwrap(),
            _ => captures.push(arg),
        }
    }
    for capture in &captures {
        let (capture, run) = capture.split_once('=').map_or((&**capture, None), |(capture, run)| (capture, Some(run)));
        judged(Path::new(capture), run.map(RunFolder::new), tries);
    }
}

fn judged(folder: &Path, run: Option<RunFolder>, tries: usize) {
    let (capture, gt) = match run {
        None => (artgs_io::load_capture(folder), artgs_io::load_ground_truth(&folder.join("gt"))),
        Some(run) => (artgs_io::load_capture(&run.aligned()), artgs_io::load_ground_truth_of_run(folder, &run)),
    };
    let (capture, gt) = (capture.unwrap(), gt.unwrap());
    let pictures: PerState<Vec<DepthPicture<'_>>> = PerState::from_fn(|s: State| {
        let train = capture.states[s].train.iter();
        train.map(|view| DepthPicture { view, depth: view.depth.as_ref().unwrap() }).collect()
    });
    let (config, begun) = (DiscoverConfig::default(), Instant::now());
    let scene = Scene::new(pictures.as_ref().map(Vec::as_slice), &config).unwrap();
    let found = discover(&scene, 1..=MOST, &config.without_refusals());
    let seconds = begun.elapsed().as_secs_f64();
    let (settings, search) = (ExplainSettings::DEFAULT, SearchSettings::default());
    let surfels = Surfels::new(&scene, &settings);
    let mut problem = Problem::new(&scene, &surfels, settings);
    let found = match &found {
        Ok(found) => problem.explained(found, &search),
        Err(_) => Explanation::without_parts(problem.surfels()),
    };
    let right = true_explanation(&problem, &gt);
    let right = problem.settled(&right, &search);
    let judgement = problem.judged(&right, &found, tries, 1);
    println!(
        "{}: {} true motions, {} found in {seconds:.0} s; {:.1} neighbouring surfels count as one",
        folder.display(),
        right.motions.len(),
        found.motions.len(),
        problem.shared
    );
    let [right, found, lowest] = &judgement.explanations;
    for (name, explanation) in [("truth", right), ("found", found), ("adversary", lowest)] {
        let terms = problem.terms(explanation);
        println!("  {name:9} {}", stated(&terms));
        if name != "adversary" {
            by_part(&mut problem, explanation, &terms);
        }
    }
    for (k, motion) in right.motions.iter().enumerate() {
        let [rough, fitted] = problem.change_by(found, *motion);
        let with_surfels = problem.change_by_part(found, right, k + 1);
        println!(
            "  true motion {} added to what was found: {rough:+.0} nats at first, {fitted:+.0} at last, {with_surfels:+.0} with its true surfels",
            k + 1
        );
    }
    judgement.added.iter().for_each(|(name, saved)| println!("  the adversary added {name}: {saved:.0} nats"));
}

fn true_explanation(problem: &Problem<'_>, gt: &GroundTruth) -> Explanation {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    let surfaces = PerState::from_fn(|s: State| {
        let meshes = std::iter::once(&gt.fixed[s]).chain(gt.movable.iter().map(|m| &m[s]));
        meshes.map(|m| artgs::evaluate::sample_surface(m, SAMPLES, &mut rng)).collect::<Vec<_>>()
    });
    let motions = (0..gt.joints.len()).map(|k| gt.start_to_end(k)).collect();
    truth(problem, motions, gt.joints.iter().map(|j| j.kind.numbers()).collect(), &surfaces)
}

fn stated(terms: &Terms) -> String {
    let Terms { visible, hidden, border, length } = terms;
    format!(
        "{:.0} nats: seen {visible:.0}, hidden {hidden:.0}, borders {border:.0}, numbers {length:.0}",
        terms.total()
    )
}

/// Prints each part with its energy, what it saves, and how much of it is not explained.
fn by_part(problem: &mut Problem<'_>, explanation: &Explanation, terms: &Terms) {
    for (k, (surfels, visible, hidden)) in problem.by_part(explanation).into_iter().enumerate() {
        let unexplained = problem.unexplained(explanation, k as u16, UNEXPLAINED);
        let mut line = format!(
            "    part {k}: {surfels} surfels, seen {visible:.0}, hidden {hidden:.0}, {unexplained} unexplained"
        );
        if let Some(motion) = k.checked_sub(1).map(|k| &explanation.motions[k]) {
            let screw = motion.screw();
            let fewer = problem.relabelled(&explanation.without(k));
            let saved = problem.terms(&fewer).total() - terms.total();
            line += &format!(
                "; drift {:.1}; {:.1} degrees, {:.3} along {:.2}; saves {saved:.0}",
                problem.drift(explanation, k),
                screw.angle.to_degrees(),
                screw.slide,
                screw.axis
            );
        }
        println!("{line}");
    }
}
