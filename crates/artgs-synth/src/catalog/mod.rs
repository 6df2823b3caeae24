//! Catalogue of objects and suites.

mod furniture;
mod hard;
mod kitchen;
mod storage;
mod tools;

use crate::{Object, Part, SynthError};
use artgs_core::JointKind::{self, Prismatic, Revolute, Screw};

/// One object of the catalogue.
#[derive(Clone, Copy, Debug)]
pub struct ObjectInfo {
    /// Name of the object.
    pub name: &'static str,
    /// One-line description.
    pub description: &'static str,
    /// Kinds of its joints, in the order of the movable parts.
    pub joints: &'static [JointKind],
    /// Suite it belongs to: `paris`, `dta`, `multi` or `hard`.
    pub suite: &'static str,
    /// Row of the paper's tables that it replaces; None for the hard cases.
    pub paper: Option<&'static str>,
    /// Builds its parts.
    build: fn() -> Vec<Part>,
    /// True if it is scaled to a bounding box of diagonal 1, false if its lengths are scene units.
    pub(crate) scaled: bool,
}

impl ObjectInfo {
    /// Number of rigid parts, the static part included: K.
    pub fn parts(&self) -> usize {
        self.joints.len() + 1
    }
}

/// Names of the suites; `paper` is `paris`, `dta` and `multi` together, `real-like` is `paper` and the hard cases that are
/// furniture of ordinary size, `all` is every object.
pub const SUITES: [&str; 7] = ["paris", "dta", "multi", "paper", "hard", "real-like", "all"];
/// Hard cases of the suite `real-like`.
const REAL_LIKE: [&str; 5] = ["twin_drawers", "five_drawers", "near_drawers", "door_with_drawer", "counter_7"];

const fn stand_in(
    suite: &'static str,
    name: &'static str,
    paper: &'static str,
    joints: &'static [JointKind],
    description: &'static str,
    build: fn() -> Vec<Part>,
) -> ObjectInfo {
    ObjectInfo { name, description, joints, suite, paper: Some(paper), build, scaled: true }
}

const fn hard_case(
    name: &'static str,
    joints: &'static [JointKind],
    description: &'static str,
    build: fn() -> Vec<Part>,
    scaled: bool,
) -> ObjectInfo {
    ObjectInfo { name, description, joints, suite: "hard", paper: None, build, scaled }
}

const R: JointKind = Revolute;
const P: JointKind = Prismatic;

#[rustfmt::skip]
const OBJECTS: [ObjectInfo; 31] = [
    stand_in("paris", "foldchair", "FoldChair", &[R], "folding chair whose seat swings up", tools::foldchair),
    stand_in("paris", "fridge", "Fridge", &[R], "refrigerator with one door, shelves and food", kitchen::fridge),
    stand_in("paris", "laptop", "Laptop", &[R], "laptop whose lid opens", tools::laptop),
    stand_in("paris", "oven", "Oven", &[R], "oven whose door opens downward in front of a rack", kitchen::oven),
    stand_in("paris", "scissor", "Scissor", &[R], "scissors, standing on their handles", tools::scissor),
    stand_in("paris", "stapler", "Stapler", &[R], "stapler whose arm lifts", tools::stapler),
    stand_in("paris", "usb", "USB", &[R], "USB stick with a cover that turns away", tools::usb),
    stand_in("paris", "washer", "Washer", &[R], "washing machine with a round door and a drum", kitchen::washer),
    stand_in("paris", "blade", "Blade", &[P], "box cutter whose blade slides out", tools::blade),
    stand_in("paris", "storage", "Storage", &[P], "shelf with one drawer", storage::storage),
    stand_in("dta", "fridge2", "Fridge-m", &[R, R], "refrigerator with two doors", kitchen::fridge2),
    stand_in("dta", "storage2", "Storage-m", &[R, P], "cupboard with a door and a drawer", storage::storage2),
    stand_in("multi", "table_3d", "Table 25493", &[P, P, P], "desk with 3 drawers", storage::table_3d),
    stand_in("multi", "table_2d2o", "Table 31249", &[P, R, P, R], "desk with 2 drawers and 2 doors", storage::table_2d2o),
    stand_in("multi", "storage_3o", "Storage 45503", &[R, R, R], "sideboard with 3 doors", storage::storage_3o),
    stand_in("multi", "storage_2d4o", "Storage 47648", &[P, P, R, R, R, R], "cupboard with 2 drawers and 4 doors", storage::storage_2d4o),
    stand_in("multi", "oven_3o", "Oven 101908", &[R, R, R], "range with 3 doors", kitchen::oven_3o),
    hard_case("twin_drawers", &[P, P], "two drawers with the same motion", hard::twin_drawers, true),
    hard_case("near_drawers", &[P, P], "parallel drawers 1 cm apart (1 unit = 1 m)", hard::near_drawers, false),
    hard_case("thin_door", &[R], "door of a sheet 3 mm thick (1 unit = 1 m)", hard::thin_door, false),
    hard_case("hidden_drawer", &[P], "drawer that is closed in one state", hard::hidden_drawer, true),
    hard_case("wide_door", &[R], "door that opens from shut to 120 degrees", hard::wide_door, true),
    hard_case("drawers_12", &[P; 12], "cabinet with 12 drawers", hard::drawers_12, true),
    hard_case("parts_20", &[P, P, P, P, P, P, P, P, P, P, P, P, P, P, P, P, R, R, R, R], "cabinet with 16 drawers and 4 doors", hard::parts_20, true),
    hard_case("door_with_drawer", &[R, P], "door that carries a drawer (chain)", hard::door_with_drawer, true),
    hard_case("five_drawers", &[P; 5], "chest of 5 equal drawers, 2 open at the start, 2 others at the end", hard::five_drawers, true),
    hard_case("counter_7", &[P; 7], "counter with 7 equal drawers in 3 columns, some closing", hard::counter_7, true),
    hard_case("doors_12", &[R; 12], "wardrobe with 12 equal doors", hard::doors_12, true),
    hard_case("mirrored_doors", &[R, R], "cupboard with mirrored doors, one opens while one closes", hard::mirrored_doors, true),
    hard_case("sliding_doors", &[P, P], "cupboard with two overlapping sliding doors", hard::sliding_doors, true),
    hard_case("screw_cap", &[Screw], "bottle with a screw cap", hard::screw_cap, true),
];

/// All objects, suite by suite.
pub fn objects() -> &'static [ObjectInfo] {
    &OBJECTS
}

/// Names of the objects of a suite; None if there is no such suite.
pub fn suite(name: &str) -> Option<Vec<&'static str>> {
    let belongs = |info: &&ObjectInfo| match name {
        "all" => true,
        "paper" => info.paper.is_some(),
        "real-like" => info.paper.is_some() || REAL_LIKE.contains(&info.name),
        _ => info.suite == name,
    };
    SUITES.contains(&name).then(|| OBJECTS.iter().filter(belongs).map(|info| info.name).collect())
}

fn find(name: &str) -> Result<&'static ObjectInfo, SynthError> {
    let found = OBJECTS.iter().find(|info| info.name == name);
    found
        .ok_or_else(|| SynthError::Unknown { name: name.into(), known: OBJECTS.iter().map(|info| info.name).collect() })
}

/// Builds the object of this name; `seed` varies its textures and its placement.
pub fn object(name: &str, seed: u64) -> Result<Object, SynthError> {
    let info = find(name)?;
    Ok(Object::new(info.name, (info.build)(), info.scaled, seed))
}

/// Builds the object of this name in metres. The diagonal of its bounding box, all parts closed, is that of the model, but
/// at least 0.6 and at most 1.5, so that a sensor for rooms can record it.
pub(crate) fn object_in_metres(name: &str, seed: u64) -> Result<Object, SynthError> {
    let info = find(name)?;
    Ok(Object::with_diagonal(info.name, (info.build)(), [0.6, 1.5], seed))
}
