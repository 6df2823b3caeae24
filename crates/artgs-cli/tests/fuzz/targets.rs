//! What is read.

use crate::requests;
use artgs::run::found_parts;
use artgs::{Config, observer::NullObserver};
use artgs_io::asset::spz::read_spz;
use artgs_io::export_report::ExportReport;
use artgs_io::recording::{RecordingFormat, RecordingOptions, load_recording};
use artgs_io::{
    Corrections, RunFolder, image_io, load_capture, load_ground_truth, read_mesh_ply, read_replica, read_splat_ply,
};
use std::fs;
use std::path::Path;

/// A reader and the folder that it reads.
pub(crate) struct Target {
    pub(crate) name: &'static str,
    pub(crate) seed: &'static str,
    /// The files that are mutated, relative, sorted.
    pub(crate) files: fn(&Path) -> Vec<String>,
    /// Reads the folder. An error is as good as a result.
    pub(crate) read: fn(&Path),
}

/// All targets, sorted by name.
pub(crate) const ALL: [Target; 27] = [
    Target { name: "capture", seed: "capture", files: of_capture, read: capture },
    Target { name: "capture_paris", seed: "paris", files: of_capture, read: capture },
    Target { name: "colmap", seed: "colmap", files: of_start, read: |dir| recording(dir, RecordingFormat::Colmap) },
    Target {
        name: "corrected_run",
        seed: "found",
        files: |_| vec!["out/corrections.json".into()],
        read: corrected_run,
    },
    Target { name: "corrections", seed: "documents", files: |_| vec!["corrections.json".into()], read: corrections },
    Target {
        name: "found_parts",
        seed: "found",
        files: |dir| below(dir, "out/stages"),
        read: |dir| {
            let _ = found_parts(&RunFolder::new(dir.join("out")));
        },
    },
    Target {
        name: "ground_truth",
        seed: "replica",
        files: |dir| below(dir, "gt"),
        read: |dir| {
            let _ = load_ground_truth(&dir.join("gt"));
        },
    },
    Target {
        name: "images",
        seed: "documents",
        files: |_| vec!["colour.png".into(), "depth.png".into()],
        read: images,
    },
    Target {
        name: "mcap",
        seed: "containers",
        files: |_| vec!["poses.txt".into(), "small.mcap".into()],
        read: |dir| {
            container(dir, "small.mcap", RecordingFormat::Mcap);
        },
    },
    Target { name: "mesh", seed: "documents", files: |_| vec!["ascii.ply".into(), "mesh.ply".into()], read: meshes },
    Target {
        name: "nerfstudio",
        seed: "nerfstudio",
        files: of_start,
        read: |dir| recording(dir, RecordingFormat::Nerfstudio),
    },
    Target {
        name: "npy",
        seed: "npy",
        files: |dir| below(dir, "start/depth"),
        read: |dir| recording(dir, RecordingFormat::Stray),
    },
    Target { name: "polycam", seed: "polycam", files: of_start, read: |dir| recording(dir, RecordingFormat::Polycam) },
    Target {
        name: "realsense_bag",
        seed: "containers",
        files: |_| vec!["packed.bag".into(), "poses.txt".into(), "small.bag".into()],
        read: |dir| {
            container(dir, "packed.bag", RecordingFormat::RealsenseBag);
            container(dir, "small.bag", RecordingFormat::RealsenseBag);
        },
    },
    Target {
        name: "record3d",
        seed: "record3d",
        files: of_start,
        read: |dir| recording(dir, RecordingFormat::Record3d),
    },
    Target {
        name: "record3d_archive",
        seed: "containers",
        files: |_| vec!["small.r3d".into()],
        read: |dir| {
            container(dir, "small.r3d", RecordingFormat::Record3d);
        },
    },
    Target {
        name: "replica",
        seed: "replica",
        files: |_| vec!["meshes/start/part_1.ply".into(), "replica.json".into()],
        read: replica,
    },
    Target {
        name: "report",
        seed: "report",
        files: |_| vec!["exports/export.json".into()],
        read: |dir| {
            let _ = ExportReport::load(&RunFolder::new(dir));
        },
    },
    Target { name: "requests", seed: "requests", files: |dir| below(dir, ""), read: requests::send },
    Target {
        name: "scanner_app",
        seed: "scanner-app",
        files: of_start,
        read: |dir| recording(dir, RecordingFormat::ScannerApp),
    },
    Target {
        name: "seven_scenes",
        seed: "7-scenes",
        files: of_start,
        read: |dir| recording(dir, RecordingFormat::SevenScenes),
    },
    Target {
        name: "settings",
        seed: "documents",
        files: |_| vec!["few.toml".into(), "settings.toml".into()],
        read: settings,
    },
    Target {
        name: "splats",
        seed: "documents",
        files: |_| vec!["splats.ply".into()],
        read: |dir| {
            let _ = read_splat_ply(&dir.join("splats.ply"));
        },
    },
    Target {
        name: "spz",
        seed: "documents",
        files: |_| vec!["splats.spz".into(), "splats_4.spz".into()],
        read: |dir| {
            let _ = read_spz(&dir.join("splats.spz"));
            let _ = read_spz(&dir.join("splats_4.spz"));
        },
    },
    Target { name: "stray", seed: "stray", files: of_start, read: |dir| recording(dir, RecordingFormat::Stray) },
    Target {
        name: "tensors",
        seed: "documents",
        files: |_| vec!["weights.safetensors".into()],
        read: |dir| {
            let _ = artgs_io::read_safetensors(&dir.join("weights.safetensors"));
        },
    },
    Target { name: "tum", seed: "tum", files: of_start, read: |dir| recording(dir, RecordingFormat::Tum) },
];

/// Every file below a folder, relative to the seed, sorted.
fn below(root: &Path, folder: &str) -> Vec<String> {
    let (mut found, mut folders) = (Vec::new(), vec![root.join(folder)]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
            match entry.is_dir() {
                true => folders.push(entry),
                false => found.push(entry.strip_prefix(root).unwrap().to_str().unwrap().to_string()),
            }
        }
    }
    found.sort();
    found
}

fn of_start(root: &Path) -> Vec<String> {
    below(root, "start")
}

fn of_capture(root: &Path) -> Vec<String> {
    below(root, "").into_iter().filter(|file| !file.starts_with("gt") && file != "synth.json").collect()
}

fn capture(dir: &Path) {
    if let Ok(capture) = load_capture(dir) {
        let text = artgs_io::summarize(&capture).to_string();
        assert!(!text.contains("NaN") && !text.contains("inf,"), "{text}");
    }
}

fn recording(dir: &Path, format: RecordingFormat) {
    let _ = RecordingFormat::detect(&dir.join("start"));
    let intrinsics = artgs_io::recording::parse_intrinsics("40 40 16 12").ok();
    let options = RecordingOptions { format: Some(format), intrinsics, ..RecordingOptions::default() };
    let _ = load_recording(&dir.join("start"), &options);
}

fn container(dir: &Path, file: &str, format: RecordingFormat) {
    let poses = Some(dir.join("poses.txt"));
    let options = RecordingOptions { format: Some(format), poses, ..RecordingOptions::default() };
    let _ = load_recording(&dir.join(file), &options);
}

fn corrections(dir: &Path) {
    let text = fs::read(dir.join("corrections.json")).unwrap();
    let Ok(corrections) = Corrections::parse(&text) else { return };
    // What was read can be written and is the same then.
    let again = Corrections::parse(corrections.text().unwrap().as_bytes()).unwrap();
    assert_eq!(again, corrections);
    let _ = corrections.check_parts(4);
    let both = corrections.after(&corrections, 4);
    let _ = both.check();
}

/// Corrections of a run that has found parts.
fn corrected_run(dir: &Path) {
    let capture = load_capture(&dir.join("capture")).unwrap();
    let config = Config { parts: artgs::PartCount::Auto, ..Config::default() };
    let prepared = artgs::Prepared::as_is(capture).with_config(config);
    let reconstruction = artgs::Reconstruction { resume: true, ..artgs::Reconstruction::new(&prepared) };
    let run = RunFolder::new(dir.join("out"));
    let Some(found) = found_parts(&run) else { panic!("the seed has no parts") };
    if let Ok(Some(corrections)) = artgs_io::read_corrections(run.root())
        && corrections.check_parts(found.parts.len()).is_ok()
    {
        let _ = reconstruction.find_parts_in(&run, &mut NullObserver);
    }
}

fn images(dir: &Path) {
    let _ = image_io::read_rgba(&dir.join("colour.png"));
    let _ = image_io::read_depth(&dir.join("depth.png"));
}

fn meshes(dir: &Path) {
    for file in ["ascii.ply", "mesh.ply"] {
        let Ok(mesh) = read_mesh_ply(&dir.join(file)) else { continue };
        assert!(mesh.vertices.iter().flatten().all(|v| v.is_finite()));
        assert!(mesh.triangles.iter().flatten().all(|i| (*i as usize) < mesh.vertices.len()));
        assert!(mesh.colors.is_empty() || mesh.colors.len() == mesh.vertices.len());
    }
}

fn replica(dir: &Path) {
    let Ok(replica) = read_replica(dir) else { return };
    for part in 0..replica.parts.len() {
        let _ = replica.world_motion(part);
    }
    for state in artgs_core::State::ALL {
        let _ = RunFolder::new(dir).load_meshes(&replica, state);
    }
}

fn settings(dir: &Path) {
    for file in ["few.toml", "settings.toml"] {
        let Ok(text) = String::from_utf8(fs::read(dir.join(file)).unwrap()) else { continue };
        let Ok(config) = Config::default().overridden_by(&text) else { continue };
        // Accepted settings can be saved, and are accepted then.
        Config::default().overridden_by(&config.to_toml().unwrap()).unwrap();
    }
}
