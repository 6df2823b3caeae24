//! Every front door takes the same steps: the program and the library make the same files of the same input.

#![allow(clippy::unwrap_used, reason = "tests")]

use artgs::observer::{Event, NullObserver};
use artgs::{Config, Input, Prepared, Reconstruction, Request};
use artgs_core::{Rigid, State};
use artgs_io::capture::{RecordedNames, write_capture};
use artgs_io::{RunFolder, load_capture};
use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};
use glam::DVec3;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const SETTINGS: &str = "parts = 3\n[articulate]\nsteps = 30\n[surface]\nresolution = 80.0\n";

const CPU: &[&str] = &["--device", "cpu", "--quiet"];

fn artgs(args: &[&str]) {
    let status = Command::new(env!("CARGO_BIN_EXE_artgs")).args(args).status();
    assert!(status.expect("the program starts").success(), "{args:?}");
}

fn str(path: &Path) -> &str {
    path.to_str().expect("temporary paths are UTF-8")
}

/// A cabinet whose end state is stated beside its place, so that the capture is corrected.
fn misaligned(folder: &Path) {
    let options = CabinetOptions { views: 20, test_views: 2, size: 96, ..CabinetOptions::default() };
    let mut capture = cabinet_capture(&options).unwrap().0;
    let shift = Rigid { translation: DVec3::new(0.02, -0.012, 0.01), ..Rigid::IDENTITY };
    let end = &mut capture.states[State::END];
    for view in end.train.iter_mut().chain(&mut end.test) {
        view.camera.world_to_camera = view.camera.world_to_camera * shift;
    }
    write_capture(folder, &capture, &RecordedNames::new()).unwrap();
}

/// Every file of a run but those that name folders and times.
fn files(run: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    fn all(folder: &Path, out: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { all(&path, out) } else { out.push(path) }
        }
    }
    let mut paths = Vec::new();
    all(run, &mut paths);
    paths.sort();
    let differ = ["metrics.json", "events.jsonl", "times.json", "capture_folder.txt", ".artgs.lock"];
    let named = |path: &Path| path.strip_prefix(run).unwrap().to_path_buf();
    let kept = paths.iter().filter(|path| !differ.iter().any(|name| path.ends_with(name)));
    kept.map(|path| (named(path), fs::read(path).unwrap())).collect()
}

fn assert_same(a: &Path, b: &Path) {
    let (a, b) = (files(a), files(b));
    let names = |files: &[(PathBuf, Vec<u8>)]| files.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&a), names(&b));
    a.iter().zip(&b).for_each(|((name, a), (_, b))| assert!(a == b, "{} differs", name.display()));
}

#[test]
fn files_and_images_in_memory_give_the_replica_of_the_program() {
    let root = tempfile::tempdir().unwrap();
    let [folder, settings, program, library, images] =
        ["capture", "settings.toml", "program", "library", "images"].map(|name| root.path().join(name));
    misaligned(&folder);
    fs::write(&settings, SETTINGS).unwrap();
    artgs(&[&["reconstruct", str(&folder), "-o", str(&program), "--config", str(&settings)], CPU].concat());

    let config = Config::default().overridden_by(SETTINGS).unwrap();
    let inputs =
        [(Input::new(&[&folder]).unwrap(), &library), (Input::Images(load_capture(&folder).unwrap()), &images)];
    for (input, out) in inputs {
        let request = Request { config: config.clone(), ..Request::new(input) };
        request.run(out, &mut NullObserver).unwrap();
        assert_same(&program, out);
    }

    // The images were corrected, and the run saved them: from its folder it continues where it ended.
    let run = RunFolder::new(&program);
    let photos = run.capture_folder().unwrap();
    assert_eq!(photos, run.aligned().canonicalize().unwrap());
    let mut events: Vec<Event> = Vec::new();
    let saved = Prepared::saved(&photos, config).unwrap();
    Reconstruction { resume: true, ..Reconstruction::new(&saved) }.run(&program, &mut events).unwrap();
    let reused = |name: &str| {
        events.iter().any(|e| matches!(e, Event::StageFinished { stage, reused: true, .. } if stage == name))
    };
    assert!(reused("discover") && reused("articulate"), "{events:?}");
    assert_same(&program, &library);
}

#[test]
fn recordings_are_aligned_in_the_library_as_in_the_program() {
    let root = tempfile::tempdir().unwrap();
    let [room, program, library] = ["room", "program", "library"].map(|name| root.path().join(name));
    let size = ["--views", "16", "--size", "200", "--layout", "nerfstudio", "-q"];
    artgs(&[&["synth", "storage2", "--scene", "room", "-o", str(&room)], &size[..]].concat());
    let paths = [room.join("start"), room.join("end")];
    let mut images: Vec<PathBuf> =
        fs::read_dir(paths[0].join("images")).unwrap().map(|entry| entry.unwrap().path()).collect();
    images.sort();
    fs::remove_file(images.remove(2)).unwrap();
    artgs(
        &[&["reconstruct", str(&paths[0]), str(&paths[1]), "-o", str(&program), "--stop-after", "discover"], CPU]
            .concat(),
    );
    let prepared = Request::new(Input::new(&paths).unwrap()).prepare(&mut NullObserver).unwrap();
    Reconstruction::new(&prepared).find_parts_in(&RunFolder::new(&library), &mut NullObserver).unwrap();
    assert_same(&program, &library);
    let cameras = fs::read_to_string(program.join("stages/aligned/transforms_train_start.json")).unwrap();
    let cameras: serde_json::Value = serde_json::from_str(&cameras).unwrap();
    let recorded = cameras["frames"].as_array().unwrap().iter().map(|frame| frame["recorded_as"].as_str().unwrap());
    let names = images.iter().map(|path| path.file_name().unwrap().to_str().unwrap());
    assert!(recorded.zip(names).all(|(recorded, name)| recorded.ends_with(name)), "{cameras:#}");
}
