//! Rows with known properties.

use super::super::{JointRow, Row, Status};

/// A correct hinge.
pub(super) fn joint(truth: u32) -> JointRow {
    JointRow {
        truth: Some(truth),
        kind: "revolute".into(),
        kind_true: "revolute".into(),
        overlap: 0.9,
        axis_deg: Some(0.5),
        position: Some(0.01),
        motion: Some(0.02),
        axis_of_interval: Some(0.5),
        position_of_interval: Some(0.25),
        motion_of_interval: Some(1.5),
        confidence: Some(0.8),
        correct: true,
    }
}

/// A decidable cabinet with two parts, all of it right.
pub(super) fn right(seed: u64) -> Row {
    Row {
        seed,
        category: "cabinet".into(),
        sensor: "exact".into(),
        decidable: true,
        parts_true: 2,
        parts_found: 2,
        count_right: true,
        types_right: true,
        parents_right: true,
        right: true,
        joints_right: true,
        joints: vec![joint(0), joint(1)],
        seconds: 10.0,
        peak_memory_mib: 300.0,
        ..Row::default()
    }
}

/// Right, but the second joint is not correct.
pub(super) fn off(seed: u64) -> Row {
    let mut row = Row { joints_right: false, ..right(seed) };
    row.joints[1] = JointRow { axis_deg: Some(7.25), correct: false, ..joint(1) };
    row
}

/// The second joint is a slide for a hinge.
pub(super) fn wrong_type(seed: u64) -> Row {
    let mut row = Row { types_right: false, right: false, joints_right: false, ..right(seed) };
    let wrong = JointRow { kind: "prismatic".into(), confidence: Some(0.93), correct: false, ..joint(1) };
    row.joints[1] = JointRow { axis_deg: None, position: None, motion: None, ..wrong };
    row
}

/// Refused.
pub(super) fn refused(seed: u64) -> Row {
    let counts = Row { parts_found: 0, count_right: false, types_right: false, parents_right: false, ..right(seed) };
    let reason = format!("OUT/{seed}: nothing moved");
    Row { status: Status::Refused, reason, right: false, joints_right: false, joints: Vec::new(), ..counts }
}

/// An object that could not be made, as earlier versions wrote it: decidable.
pub(super) fn not_made(seed: u64) -> Row {
    let reason = "the object could not be made: exit code 1".into();
    Row { seed, sensor: "any".into(), status: Status::Failed, reason, decidable: true, ..Row::default() }
}

/// Objects of which about a fifth is wrong, thin ones more often. The same seed gives the same rows.
pub(super) fn synthetic(count: u64, seed: u64) -> Vec<Row> {
    (1..=count).map(|object| synthetic_row(object, seed)).collect()
}

/// Numbers from 0 to 1.
fn random(mut state: u64) -> impl FnMut() -> f64 {
    const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
    move || {
        state = state.wrapping_add(STEP);
        let mixed = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// The object depends only on its number, what was found on the seed as well.
fn synthetic_row(object: u64, seed: u64) -> Row {
    let (mut next, mut luck) = (random(object << 20), random((object << 20) + (seed << 50)));
    let category = ["cabinet", "desk-lamp", "fridge", "laptop", "scissors", "wardrobe"][(next() * 6.0) as usize];
    let features = ["look-alike", "nested", "small-motion", "thin"].into_iter().filter(|_| next() < 0.25);
    let features: Vec<String> = features.map(String::from).collect();
    let parts = 1 + (next() * next() * 12.0) as u32;
    let room = next() < 0.4;
    let risk = 0.08 + if features.iter().any(|f| f == "thin") { 0.35 } else { 0.0 } + if room { 0.1 } else { 0.0 };
    let mut row = Row {
        category: category.into(),
        sensor: if room { "phone".into() } else { "exact".into() },
        features,
        parts_true: parts,
        parts_found: parts,
        decidable: next() < 0.9,
        seconds: 8.0 + 40.0 * luck(),
        joints: (0..parts)
            .map(|truth| JointRow { confidence: Some(1.0 - 0.6 * luck() * luck()), ..joint(truth) })
            .collect(),
        program: "0.1.0".into(),
        ..right(object)
    };
    if !row.decidable {
        row.undecidable = vec!["equal-motion".into()];
    }
    if luck() < risk {
        make_wrong(&mut row, luck(), luck());
    }
    row
}

/// Makes an object wrong in one of several ways.
fn make_wrong(row: &mut Row, way: f64, confidence: f64) {
    (row.right, row.joints_right) = (false, false);
    let last = row.joints.len() - 1;
    match (way * 6.0) as usize {
        0 => {
            (row.status, row.parts_found, row.count_right) = (Status::Refused, 0, false);
            row.reason = refused(row.seed).reason;
            row.joints.clear();
        }
        1 => {
            (row.parts_found, row.missing, row.count_right) = (row.parts_found - 1, 1, false);
            row.joints.pop();
        }
        2 => {
            (row.parts_found, row.extra, row.count_right) = (row.parts_found + 1, 1, false);
            let extra = JointRow { truth: None, correct: false, confidence: Some(confidence), ..joint(0) };
            row.joints.push(extra);
        }
        3 | 4 => {
            row.types_right = false;
            let wrong = JointRow { kind: "prismatic".into(), correct: false, ..joint(last as u32) };
            row.joints[last] = JointRow { axis_deg: None, confidence: Some(confidence), ..wrong };
        }
        _ => {
            row.right = true;
            let off = JointRow { axis_deg: Some(5.0 + 20.0 * confidence), correct: false, ..joint(last as u32) };
            row.joints[last] = JointRow { confidence: Some(confidence), ..off };
        }
    }
}
