//! `artgs synth`: captures of procedural objects.

use crate::args::{Synth, SynthLayout};
use crate::commands::{Style, use_threads};
use crate::failure::Failure;
use crate::output::say;
use artgs_core::JointKind;
use artgs_synth::{CaptureOptions, Layout, ObjectInfo, SUITES, SynthError, capture_info, objects, suite, write_object};
use serde_json::json;
use std::path::{Path, PathBuf};

pub(crate) fn run(args: &Synth, style: Style) -> Result<(), Failure> {
    use_threads(args.threads)?;
    let (Some(what), Some(out), false) = (&args.what, &args.out, args.list) else { return list(style) };
    let options = options(args)?;
    let targets = targets(what, out)?;
    for (_, folder) in &targets {
        check(folder, args.force)?;
    }
    for (name, folder) in &targets {
        let written = write_object(name, &options, folder).map_err(|error| match error {
            SynthError::File(_) => Failure::from(anyhow::Error::from(error)),
            _ => Failure::bad(error),
        })?;
        if style.json {
            say(json!({ "event": "result", "capture": folder, "made": written }))?;
        } else if !style.quiet {
            let (shown, k) = (folder.display(), written.parts);
            say(format!("{name}, K = {k}, in {shown}; artgs reconstruct {shown} -o ..."))?;
        }
    }
    Ok(())
}

fn options(args: &Synth) -> Result<CaptureOptions, Failure> {
    let layout = match args.layout {
        SynthLayout::Artgs => Layout::ArtGs,
        SynthLayout::Paris => Layout::Paris,
    };
    let Synth { views, test_views, size, seed, .. } = *args;
    let mut options = CaptureOptions { views, test_views, size, seed, layout, ..CaptureOptions::default() };
    for setting in &args.noise {
        options.degradation.set(setting).map_err(Failure::bad)?;
    }
    options.check().map_err(Failure::bad)?;
    Ok(options)
}

/// Objects to make and their folders.
fn targets(what: &str, out: &Path) -> Result<Vec<(&'static str, PathBuf)>, Failure> {
    if let Some(info) = objects().iter().find(|info| info.name == what) {
        return Ok(vec![(info.name, out.to_path_buf())]);
    }
    let Some(names) = suite(what) else {
        let objects: Vec<&str> = objects().iter().map(|info| info.name).collect();
        return Err(Failure::bad(format!(
            "there is no object or suite `{what}`; suites: {}; objects: {}",
            SUITES.join(", "),
            objects.join(", ")
        )));
    };
    Ok(names.into_iter().map(|name| (name, out.join(name))).collect())
}

/// Refuses a folder with files that `artgs synth` did not write.
fn check(folder: &Path, force: bool) -> Result<(), Failure> {
    let shown = folder.display();
    if folder.exists() && !folder.is_dir() {
        return Err(Failure::bad(format!("{shown} is a file; give a folder to -o")));
    }
    let empty = std::fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none());
    if empty || capture_info(folder).is_some() {
        return Ok(());
    }
    // A capture of ours replaces these folders whole.
    let taken = ["start", "end", "gt"].into_iter().find(|name| folder.join(name).exists());
    if let Some(name) = taken {
        return Err(Failure::bad(format!("{shown} holds `{name}` of another capture; give another folder to -o")));
    }
    if force {
        return Ok(());
    }
    Err(Failure::bad(format!(
        "{shown} holds files that artgs synth did not write; give an empty folder to -o, or add --force to write among them"
    )))
}

fn kinds(info: &ObjectInfo) -> String {
    let letter = |kind: &JointKind| match kind {
        JointKind::Revolute => 'r',
        JointKind::Prismatic => 'p',
        JointKind::Screw => 's',
    };
    info.joints.iter().map(letter).collect()
}

fn list(style: Style) -> Result<(), Failure> {
    if style.json {
        let entry = |info: &ObjectInfo| {
            json!({
                "name": info.name, "description": info.description, "suite": info.suite, "parts": info.parts(),
                "joints": info.joints, "paper": info.paper,
            })
        };
        return say(json!({ "suites": SUITES, "objects": objects().iter().map(entry).collect::<Vec<_>>() }));
    }
    let mut lines = vec![format!("{:<17} {:<6} {:>2}  {:<14} what", "object", "suite", "K", "stands in for")];
    lines.extend(objects().iter().map(|info| {
        let (paper, kinds) = (info.paper.unwrap_or("-"), kinds(info));
        format!("{:<17} {:<6} {:>2}  {paper:<14} {} ({kinds})", info.name, info.suite, info.parts(), info.description)
    }));
    lines.push("K counts the static part; r turns, p slides, s screws.".into());
    lines.push(format!("suites: {} (paper = paris + dta + multi)", SUITES.join(", ")));
    say(lines.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foreign_folders_are_refused_and_own_ones_are_not() {
        let dir = tempfile::tempdir().unwrap();
        check(dir.path(), false).unwrap();
        check(&dir.path().join("missing"), false).unwrap();
        let file = dir.path().join("thesis.tex");
        std::fs::write(&file, "x").unwrap();
        let failure = check(dir.path(), false).unwrap_err();
        assert!(failure.exit_code() == 2 && failure.to_string().contains("--force"), "{failure}");
        assert!(check(&file, true).is_err());
        check(dir.path(), true).unwrap();
        let own = dir.path().join("own");
        let options = CaptureOptions { views: 2, test_views: 0, size: 16, ..CaptureOptions::default() };
        write_object("blade", &options, &own).unwrap();
        check(&own, false).unwrap();
    }

    #[test]
    fn a_suite_makes_a_folder_per_object() {
        let paris = targets("paris", Path::new("x")).unwrap();
        assert_eq!((paris.len(), &paris[9].1), (10, &PathBuf::from("x/storage")));
        assert_eq!(targets("storage", Path::new("x")).unwrap(), [("storage", PathBuf::from("x"))]);
        assert_eq!(targets("sofa", Path::new("x")).unwrap_err().exit_code(), 2);
    }
}
