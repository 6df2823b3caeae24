//! Checks exports: opens every file with an independent reader, compares the formats with each other, and drives every joint
//! of the URDF in a physics engine.
//!
//! Readers: `urdf-rs`, `mjcf-rs`, `roxmltree` (SDF), `openusd` (usda, usdc, usdz), `gltf`, `tobj` for the meshes, `image`
//! for textures. PLY and SPZ of Gaussians are read by `artgs-io`, because no other reader is available. `openusd` also writes
//! the USD files, so only their content is checked here; `validate/` checks them with Pixar's library.
//!
//! Physics: Rapier. One joint at a time moves, the rest is locked at 0; a screw is driven as a hinge, as in URDF.

mod balance;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod chain_tests;
mod compare;
mod coverage;
mod drawn;
mod drive;
mod drop;
mod finger;
mod limits;
mod mass;
mod meshes;
mod model;
mod observed;
mod options;
mod page;
mod passing;
mod places;
mod poses;
mod readers;
mod report;
mod rules;
mod shadow;
mod table;

pub use options::CheckOptions;
pub use readers::is_reading;
pub use report::{
    CheckReport, CoverageFinding, DropFinding, FilesFinding, FingerFinding, FormatFinding, JointFinding, LimitFinding,
    LinkFinding, RuleFinding, StateFinding, Verdict,
};

use artgs_core::{JointKind, PerState, Replica, State};
use artgs_io::export_report::ExportReport;
use artgs_io::replica::ReplicaFileError;
use artgs_io::{FileError, RunFolder};
use model::Model;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Why a check cannot run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckError {
    /// `replica.json` is missing, invalid or of another version, or one of its meshes is missing.
    #[error(transparent)]
    Replica(#[from] ReplicaFileError),
    /// `export.json`, or a file of the replica, cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// There are no exports.
    #[error("{}: no exports exist; create them with `artgs export {} --to urdf,mjcf,usd`", dir.display(), out.display())]
    NoExports {
        /// The missing folder of exports.
        dir: PathBuf,
        /// The replica folder.
        out: PathBuf,
    },
}

/// Checks the replica folder `out` and everything below `out/exports`. Problems of exports are in the report; an error means
/// that the check cannot run.
pub fn check(out: &Path, options: &CheckOptions) -> Result<CheckReport, CheckError> {
    let replica = artgs_io::read_replica(out)?;
    let exports = RunFolder::new(out).exports();
    let mut opened = readers::open_all(&exports);
    if opened.is_empty() {
        return Err(CheckError::NoExports { dir: exports, out: out.into() });
    }
    let reference = compare::compare_all(&mut opened, options);
    for read in &mut opened {
        if let Some(model) = &read.model {
            read.finding.problems.extend(against_replica(&replica, model, options));
        }
    }
    let mut report = CheckReport { options: options.clone(), ..CheckReport::default() };
    // The URDF is driven. That of the PartNet folder describes the same object with rotated frames.
    let first = opened.iter().find(|o| o.model.is_some()).filter(|o| o.finding.format == "urdf");
    let size = reference.as_ref().filter(|model| model.faults().is_empty()).and_then(odd_size);
    match reference.filter(|_| first.is_some()) {
        Some(_) if size.is_some() => {
            report.notes.push("no joint was driven, because of the size of the object, see above".into());
        }
        Some(model) if !model.faults().is_empty() => {
            report.notes.push("invalid numbers, see above: no joint was driven".into());
        }
        Some(mut model) => {
            let exported = ExportReport::load(&RunFolder::new(out))?.unwrap_or_default();
            add_observed(&mut model, &exported);
            let observed = observed::all(&RunFolder::new(out), &replica, &exported, &model);
            physics(&model, &exported, &observed, options, &mut report);
        }
        None => report.notes.push("no readable URDF: no joint was driven; export one with `--to urdf`".into()),
    }
    files(&RunFolder::new(out), &mut report)?;
    if let Some(driven) = opened.iter_mut().find(|o| o.finding.format == "urdf") {
        driven.finding.problems.extend(size);
    }
    report.formats = opened.into_iter().map(|o| o.finding).collect();
    report.count();
    Ok(report)
}

/// The joint values of both states from `export.json`, where the files of the model do not hold them: URDF has no place for them.
fn add_observed(model: &mut Model, exported: &ExportReport) {
    for link in &mut model.links {
        let report = exported.links.iter().find(|report| report.name == link.name);
        if let (Some(motion), Some(report)) = (&mut link.motion, report) {
            motion.observed = motion.observed.or(report.observed.map(|[start, end]| PerState::new(start, end)));
        }
    }
}

/// Says what is wrong with the size of an object; none if the physics engine can compute with it.
fn odd_size(model: &Model) -> Option<String> {
    let shapes = |link: &model::Link| link.visuals.iter().chain(&link.hulls).cloned().collect::<Vec<_>>();
    let boxes = model.links.iter().filter_map(|link| link.bounds(&shapes(link)));
    let [low, high] = model::bounds(boxes.flatten())?;
    artgs_core::odd_size((high - low).length())
}

/// Compares the exported files with what `export.json` recorded of them.
fn files(run: &RunFolder, report: &mut CheckReport) -> Result<(), CheckError> {
    let recorded = ExportReport::load(run)?.unwrap_or_default();
    let Some(mut problems) = recorded.altered(run) else {
        let note =
            "exports/export.json has no digests: whether files were altered is not known; export again to record them";
        report.notes.push(note.into());
        return Ok(());
    };
    if recorded.replica.is_some() && recorded.replica != run.replica_digest()? {
        problems.push("the replica has changed since it was exported; export again".into());
    }
    report.files = Some(FilesFinding { written: recorded.digests.len(), problems });
    Ok(())
}

/// Drives the URDF. `model` is the URDF completed by values of other formats.
fn physics(
    model: &Model,
    exported: &ExportReport,
    observed: &[Option<observed::Observed>],
    options: &CheckOptions,
    report: &mut CheckReport,
) {
    let (scene, flat) = poses::Scene::of(model);
    let flat_hulls = |i: usize| flat.iter().filter(move |(link, _)| *link == i).map(|(_, problem)| problem.clone());
    let bodies = (0..model.links.len()).filter(|i| model.links[*i].is_body());
    report.links = bodies
        .map(|i| {
            let mut found = mass::link(&model.links[i], options);
            found.problems.extend(flat_hulls(i));
            found
        })
        .collect();
    let lost = |name: &str| exported.links.iter().find(|l| l.name == name).map_or(0, |l| l.lost_pieces);
    let drawn: Vec<_> = model.links.par_iter().map(|link| drawn::Drawn::new(&link.visuals)).collect();
    let compared = |i: usize| {
        let (link, hulls) = (&model.links[i], &scene.hulls[i]);
        let passing = passing::Passing::of(model, &drawn, i);
        coverage::link(link, hulls, drawn[i].as_ref(), observed[i].as_ref(), &passing, lost(&link.name), options)
    };
    report.coverage = (0..model.links.len()).into_par_iter().filter_map(compared).collect();
    if !scene.is_empty() {
        let dropped = |i: usize| drop::link(model, &scene, i, &drawn, observed[i].as_ref(), options);
        report.drops = (0..model.links.len()).into_par_iter().filter_map(dropped).collect();
        let named = |i: usize| exported.links.iter().find(|l| l.name == model.links[i].name);
        let touched = |i: usize| finger::link(model, &scene, i, &drawn, &named(i)?.handles, options);
        report.fingers = (0..model.links.len()).into_par_iter().filter_map(touched).collect();
    }
    report.limits = (0..model.links.len()).filter_map(|i| limits::joint(model, observed, i, options)).collect();
    report.notes.extend(balance::notes(model));
    if scene.is_empty() {
        report.notes.push("no link has collision hulls: no collision can stop a joint".into());
    }
    if model.links.iter().any(|l| l.motion.as_ref().is_some_and(|m| m.pitch.is_some())) {
        report.notes.push("screws were driven as hinges, as in URDF".into());
    }
    let joints: Vec<usize> = (0..model.links.len()).filter(|i| model.links[*i].motion.is_some()).collect();
    report.joints = joints.into_par_iter().filter_map(|i| drive::joint(model, &scene, i, options)).collect();
    if report.joints.iter().any(|j| j.observed.is_none()) {
        report.notes.push("only MJCF, USD and GLB contain observed values; export one of them to check these".into());
        return;
    }
    report.states = State::ALL.iter().map(|state| poses::state(model, &scene, *state, options)).collect();
}

/// Whether an export belongs to this replica: the same number of parts and the same rotations of hinges. Order and names of
/// links differ between formats, so sorted values are compared.
fn against_replica(replica: &Replica, model: &Model, options: &CheckOptions) -> Vec<String> {
    let (parts, links) = (replica.parts.len(), model.links.iter().filter(|l| l.is_body()).count());
    if parts != links {
        return vec![format!("{links} links, but the replica has {parts} parts; export again")];
    }
    let hinges = model.links.iter().filter_map(|l| l.motion.as_ref()).filter(|m| m.turns());
    let Some(observed) = hinges.map(|m| m.observed).collect::<Option<Vec<PerState<f64>>>>() else { return Vec::new() };
    let joints = (0..parts).filter_map(|i| replica.joint(i)).filter(|j| j.kind != JointKind::Prismatic);
    let sorted = |values: Vec<PerState<f64>>| {
        let mut turned: Vec<f64> = values.iter().map(|v| (v[State::END] - v[State::START]).abs()).collect();
        turned.sort_by(f64::total_cmp);
        turned
    };
    let (is, was) = (sorted(observed), sorted(joints.map(|j| j.state_values).collect()));
    if is.len() == was.len() && is.iter().zip(&was).all(|(a, b)| (a - b).abs() <= options.angle) {
        return Vec::new();
    }
    let text = |values: &[f64]| values.iter().map(|v| format!("{:.1}", v.to_degrees())).collect::<Vec<_>>().join(", ");
    vec![format!("hinges turned by [{}] deg, in the replica by [{}] deg; export again", text(&is), text(&was))]
}
