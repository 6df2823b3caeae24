//! `artgs synth`: captures of procedural objects.

use crate::args::{Synth, SynthLayout, SynthScene, SynthSensor};
use crate::failure::Failure;
use crate::folder;
use crate::output::say;
use crate::style::Style;
use crate::threads::use_threads;
use anyhow::Context;
use artgs_core::JointKind;
use artgs_io::recording::RecordingFormat;
use artgs_synth::population::{Device, RandomCapture, RandomInfo, RandomOptions, write_random};
use artgs_synth::recording::{Sensor, write_recorded_object};
use artgs_synth::target::{Kind, TargetError, require_free, targets};
use artgs_synth::{
    CaptureOptions, Layout, ObjectInfo, RecordingCaptureOptions, SUITES, SynthError, objects, write_object,
};
use serde_json::{Value, json};
use std::path::Path;

/// What is made of every object.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Job {
    Capture(CaptureOptions),
    Recording(RecordingCaptureOptions, RecordingFormat),
    Random(u64, RandomOptions),
}

impl Job {
    /// Writes an object into a folder. Returns what was made, in words and as JSON.
    fn write(&self, name: &str, folder: &Path) -> Result<(String, Value), SynthError> {
        let named = |parts: usize| format!("{name}, K = {parts}");
        match self {
            Self::Capture(options) => write_object(name, options, folder).map(|made| (named(made.parts), json!(made))),
            Self::Recording(options, format) => {
                write_recorded_object(name, options, *format, folder).map(|made| (named(made.parts), json!(made)))
            }
            Self::Random(seed, options) => {
                write_random(*seed, options, folder).map(|made| (described(&made), json!(made)))
            }
        }
    }

    fn kind(&self) -> Kind {
        match self {
            Self::Capture(_) => Kind::Capture,
            Self::Recording(..) => Kind::Recording,
            Self::Random(..) => Kind::Random,
        }
    }
}

/// A random object in words.
fn described(made: &RandomInfo) -> String {
    let sensor = match made.capture {
        RandomCapture::Exact(_) => "exact",
        RandomCapture::Room { options, .. } => options.sensor.name(),
    };
    format!("seed {}: {}, K = {}, sensor {sensor}", made.random, made.category, made.parts)
}

pub(crate) fn run(args: &Synth, style: Style) -> Result<(), Failure> {
    use_threads(args.threads)?;
    let (Some(out), false) = (&args.out, args.list) else { return list(style) };
    let (job, targets) = match (args.random, &args.what) {
        (Some(seed), _) => (random(seed, args)?, vec![("random object", out.clone())]),
        (None, Some(what)) => (job(args)?, targets(what, out).map_err(|error| refused(&error))?),
        (None, None) => return list(style),
    };
    for (_, folder) in &targets {
        require_free(job.kind(), folder, args.force).map_err(|error| refused(&error))?;
    }
    for (name, folder) in &targets {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
        let _lock = folder::lock_any(folder, "artgs synth", style)?;
        let (what, written) = job.write(name, folder).map_err(|error| match error {
            SynthError::File(_) | SynthError::Recording(_) => Failure::from(anyhow::Error::from(error)),
            _ => Failure::bad(error),
        })?;
        if style.json {
            say(json!({ "event": "result", "capture": folder, "made": written }))?;
        } else if !style.quiet {
            let shown = folder.display();
            say(format!("{what}, in {shown}; artgs reconstruct {shown} -o ..."))?;
        }
    }
    Ok(())
}

fn job(args: &Synth) -> Result<Job, Failure> {
    if args.states.is_some() {
        return Err(Failure::bad("--states is for random objects; give --random SEED in place of the object"));
    }
    if args.still {
        return Err(Failure::bad("--still is for random objects; give --random SEED in place of the object"));
    }
    let sensor = device(args)?;
    match args.scene {
        None | Some(SynthScene::Studio) => studio(args),
        Some(SynthScene::Room) => room(args, sensor.unwrap_or(Sensor::Lidar)),
    }
}

/// A random object: what is not asked for is drawn.
fn random(seed: u64, args: &Synth) -> Result<Job, Failure> {
    match (args.scene, args.sensor) {
        (Some(SynthScene::Room), Some(SynthSensor::Exact)) => {
            return Err(Failure::bad("--sensor exact has no room; leave --scene room out, or give another --sensor"));
        }
        (Some(SynthScene::Studio), Some(sensor)) if sensor != SynthSensor::Exact => {
            return Err(Failure::bad("this --sensor is in a room; leave --scene studio out, or give --sensor exact"));
        }
        _ => {}
    }
    let device = match (args.sensor, args.scene) {
        (None, None) => Device::Any,
        (None, Some(SynthScene::Room)) | (Some(SynthSensor::Room), _) => Device::Room,
        (None, Some(SynthScene::Studio)) | (Some(SynthSensor::Exact), _) => Device::Exact,
        (Some(SynthSensor::Lidar), _) => Device::Sensor(Sensor::Lidar),
        (Some(SynthSensor::Kinect), _) => Device::Sensor(Sensor::Kinect),
        (Some(SynthSensor::Xtion), _) => Device::Sensor(Sensor::Xtion),
        (Some(SynthSensor::D435), _) => Device::Sensor(Sensor::D435),
    };
    let states = args.states.map(|states| states as usize);
    let test_views = args.test_views.unwrap_or(0);
    Ok(Job::Random(seed, RandomOptions { device, size: args.size, test_views, states, still: args.still }))
}

fn studio(args: &Synth) -> Result<Job, Failure> {
    let of_a_room = [
        ("--sensor", args.sensor.is_some()),
        ("--path", args.path.is_some()),
        ("--drift", args.drift.is_some()),
        ("--own-frames", args.own_frames),
        ("--bystander", args.bystander),
    ];
    if let Some((option, _)) = of_a_room.iter().find(|(_, given)| *given) {
        return Err(Failure::bad(format!("{option} needs a room; add --scene room")));
    }
    let layout = match args.layout {
        None | Some(SynthLayout::Artgs) => Layout::ArtGs,
        Some(SynthLayout::Paris) => Layout::Paris,
        Some(_) => {
            return Err(Failure::bad("this layout is one of recordings; add --scene room, or give artgs or paris"));
        }
    };
    let default = CaptureOptions::default();
    let mut options = CaptureOptions {
        views: args.views.unwrap_or(default.views),
        test_views: args.test_views.unwrap_or(default.test_views),
        size: args.size.unwrap_or(default.size),
        seed: args.seed,
        layout,
        ..default
    };
    for setting in &args.noise {
        options.degradation.set(setting).map_err(Failure::bad)?;
    }
    options.check().map_err(Failure::bad)?;
    Ok(Job::Capture(options))
}

/// The device that records an object of the catalogue; none if none is asked for.
fn device(args: &Synth) -> Result<Option<Sensor>, Failure> {
    let of_random = |name: &str| {
        Failure::bad(format!("--sensor {name} is for random objects; give --random SEED in place of the object"))
    };
    Ok(match args.sensor {
        None => None,
        Some(SynthSensor::Lidar) => Some(Sensor::Lidar),
        Some(SynthSensor::Kinect) => Some(Sensor::Kinect),
        Some(SynthSensor::Xtion) => Some(Sensor::Xtion),
        Some(SynthSensor::D435) => Some(Sensor::D435),
        Some(SynthSensor::Exact) => return Err(of_random("exact")),
        Some(SynthSensor::Room) => return Err(of_random("room")),
    })
}

fn room(args: &Synth, sensor: Sensor) -> Result<Job, Failure> {
    let of_a_studio = [("--noise", !args.noise.is_empty()), ("--test-views", args.test_views.is_some_and(|n| n > 0))];
    if let Some((option, _)) = of_a_studio.iter().find(|(_, given)| *given) {
        return Err(Failure::bad(format!(
            "{option} cannot be used with --scene room; --sensor and --drift set its errors"
        )));
    }
    let format = match args.layout {
        None | Some(SynthLayout::ScannerApp) => RecordingFormat::ScannerApp,
        Some(SynthLayout::Record3d) => RecordingFormat::Record3d,
        Some(SynthLayout::Polycam) => RecordingFormat::Polycam,
        Some(SynthLayout::Nerfstudio) => RecordingFormat::Nerfstudio,
        Some(SynthLayout::Tum) => RecordingFormat::Tum,
        Some(SynthLayout::Colmap) => RecordingFormat::Colmap,
        Some(SynthLayout::Artgs | SynthLayout::Paris) => {
            return Err(Failure::bad("artgs and paris need masks, which a room has not; give another --layout"));
        }
    };
    let default = RecordingCaptureOptions::default();
    let options = RecordingCaptureOptions {
        views: args.views.unwrap_or(default.views),
        width: args.size.unwrap_or(sensor.default_width()),
        sensor,
        drift: args.drift.unwrap_or_default(),
        own_frames: args.own_frames,
        bystander: args.bystander,
        seed: args.seed,
        // The writer chooses what follows from the format.
        ..default
    };
    options.check().map_err(Failure::bad)?;
    Ok(Job::Recording(options, format))
}

/// What is wrong with a target, with the options that are the remedy.
fn refused(error: &TargetError) -> Failure {
    Failure::bad(match error {
        TargetError::Unknown { .. } => error.to_string(),
        TargetError::Foreign(_) => format!("{error} to -o, or add --force to write among them"),
        _ => format!("{error} to -o"),
    })
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
    lines.push(format!(
        "suites: {} (paper = paris + dta + multi; real-like = paper and furniture of hard)",
        SUITES.join(", ")
    ));
    say(lines.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_synth::population::random_info;
    use clap::Parser;

    fn args_of(line: &str) -> Synth {
        let cli = crate::args::Cli::try_parse_from(format!("artgs synth {line}").split_whitespace()).unwrap();
        let crate::args::Command::Synth(args) = cli.command else { panic!("another command") };
        args
    }

    fn job_of(line: &str) -> Result<Job, Failure> {
        job(&args_of(&format!("blade -o x {line}")))
    }

    fn device_of(line: &str) -> Result<Device, Failure> {
        match random(3, &args_of(&format!("--random 3 -o x {line}")))? {
            Job::Random(3, options) => Ok(options.device),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn options_of_a_scene_are_refused_in_the_other() {
        let line = "--scene room --sensor xtion --path handheld --drift 0.02,0.5 --own-frames --layout tum --views 5";
        let Job::Recording(options, RecordingFormat::Tum) = job_of(line).unwrap() else { panic!("no recording") };
        assert_eq!((options.sensor, options.width, options.views), (Sensor::Xtion, 640, 5));
        assert!(options.own_frames && options.drift.metres == 0.02);
        let Job::Capture(options) = job_of("").unwrap() else { panic!("no capture") };
        assert_eq!(options, CaptureOptions::default());
        for (line, words) in [
            ("--drift 0.01,0.4", "--drift needs a room"),
            ("--bystander", "--scene room"),
            ("--layout tum", "--scene room"),
            ("--scene room --noise depth=0.1", "--noise"),
            ("--scene room --layout paris", "masks"),
            ("--scene room --size 65", "multiple of 4"),
            ("--states 3", "--states is for random objects; give --random SEED in place of the object"),
            ("--states 2", "--states is for random objects"),
            ("--sensor exact", "--sensor exact is for random objects; give --random SEED in place of the object"),
            ("--sensor room", "--sensor room is for random objects"),
            ("--scene room --sensor exact", "--sensor exact is for random objects"),
        ] {
            let failure = job_of(line).unwrap_err();
            assert!(failure.exit_code() == 2 && failure.to_string().contains(words), "{line}: {failure}");
        }
    }

    #[test]
    fn the_scene_of_a_random_object_is_not_ignored() {
        for (line, device) in [
            ("", Device::Any),
            ("--scene studio", Device::Exact),
            ("--scene room", Device::Room),
            ("--scene studio --sensor exact", Device::Exact),
            ("--scene room --sensor lidar", Device::Sensor(Sensor::Lidar)),
            ("--sensor room", Device::Room),
        ] {
            assert_eq!(device_of(line).unwrap(), device, "{line}");
        }
        for (line, words) in [
            ("--scene studio --sensor lidar", "leave --scene studio out"),
            ("--scene studio --sensor room", "leave --scene studio out"),
            ("--scene room --sensor exact", "leave --scene room out"),
        ] {
            let failure = device_of(line).unwrap_err();
            assert!(failure.exit_code() == 2 && failure.to_string().contains(words), "{line}: {failure}");
        }
    }

    #[test]
    fn a_random_object_is_described_in_one_line() {
        let dir = tempfile::tempdir().unwrap();
        let options =
            RandomOptions { device: Device::Exact, size: Some(16), test_views: 0, states: None, still: false };
        let (what, _) = Job::Random(6, options).write("random object", dir.path()).unwrap();
        let found = random_info(dir.path()).unwrap();
        assert_eq!(what, format!("seed 6: {}, K = 2, sensor exact", found.category));
    }
}
