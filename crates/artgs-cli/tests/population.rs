//! Small objects of the population, half of them noisy recordings of rooms: made, reconstructed to their parts and scored by the program
//! itself. The number of parts is not given.

#![cfg(feature = "bench")]

use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// Seed, movable parts, their types in the order of the truth (h hinge, s slide), and the largest error of an axis in degrees.
type Expected = (u64, usize, &'static str, f64);

/// Exact depth and masks.
const EXACT: [Expected; 8] = [
    (5, 3, "hhh", 0.3),
    (6, 1, "h", 0.3),
    (8, 1, "s", 0.3),
    (11, 1, "h", 0.3),
    (31, 3, "hhh", 0.3),
    (32, 1, "h", 0.3),
    (33, 1, "h", 0.3),
    (47, 1, "h", 0.3),
];
/// Rooms with LiDAR, Kinect, Xtion or D435.
const ROOMS: [Expected; 8] = [
    (4, 1, "s", 3.0),
    (8, 1, "s", 3.0),
    (11, 1, "h", 3.0),
    (18, 1, "h", 3.0),
    (29, 1, "h", 3.0),
    (32, 1, "h", 3.0),
    (45, 1, "h", 3.0),
    (47, 1, "h", 3.0),
];

fn rows(sensor: &str, expected: &[Expected], folder: &Path) -> Vec<Value> {
    let seeds: Vec<String> = expected.iter().map(|(seed, ..)| seed.to_string()).collect();
    let status = Command::new(env!("CARGO_BIN_EXE_artgs"))
        .args(["bench", "population", "--stop-after", "discover", "--device", "cpu", "--sensor", sensor, "--seeds"])
        .args([&seeds.join(","), "-o"])
        .arg(folder)
        .output()
        .unwrap();
    assert!(status.status.success(), "{}", String::from_utf8_lossy(&status.stderr));
    let table = std::fs::read_to_string(folder.join("results.jsonl")).unwrap();
    table.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn check(sensor: &str, expected: &[Expected]) {
    let folder = tempfile::tempdir().unwrap();
    let rows = rows(sensor, expected, folder.path());
    assert_eq!(rows.len(), expected.len());
    for (row, (seed, parts, types, most)) in rows.iter().zip(expected) {
        assert_eq!(row["seed"], *seed);
        let found = (row["parts_true"].as_u64(), row["parts_found"].as_u64(), row["right"].as_bool());
        assert_eq!(found, (Some(*parts as u64), Some(*parts as u64), Some(true)), "{sensor} {row}");
        let mut kinds: Vec<(u64, &str, f64)> = row["joints"].as_array().unwrap().iter().map(joint).collect();
        kinds.sort_by_key(|(truth, ..)| *truth);
        let letters: String = kinds.iter().map(|(_, kind, _)| if *kind == "prismatic" { 's' } else { 'h' }).collect();
        assert_eq!(letters, *types, "{sensor} {row}");
        assert!(kinds.iter().all(|(.., axis)| axis <= most), "{sensor} {row}");
    }
}

/// True part, type and axis error of a found joint.
fn joint(joint: &Value) -> (u64, &str, f64) {
    (joint["truth"].as_u64().unwrap(), joint["kind"].as_str().unwrap(), joint["axis_deg"].as_f64().unwrap())
}

#[test]
fn exact_objects_are_found() {
    check("exact", &EXACT);
}

#[test]
fn objects_in_rooms_are_found() {
    check("room", &ROOMS);
}
