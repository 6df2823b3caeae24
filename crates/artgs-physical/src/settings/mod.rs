//! Every number that an export depends on and that nothing measures: what users ask for in `config`, all others in one type for each
//! question.

mod bake;
mod collision;
mod config;
mod decompose;
mod describe;
mod dynamics;
mod limits;
mod looks;
mod mass;
mod portrait;
mod repair;

pub use bake::{BakeSettings, FillSettings, GainSettings};
pub use collision::{ClearanceSettings, CollisionSettings, PoseSettings};
pub use config::{Collision, Front, GivenClass, PhysicalConfig, Up};
pub use decompose::{DecomposeSettings, FloorSettings, RegionSettings, RestSettings, SheetSettings, UnionSettings};
pub use describe::{ClassSettings, ClosedSettings, DescribeSettings, FrontSettings, HandleSettings};
pub use dynamics::DynamicsSettings;
pub use limits::{FlushSettings, LimitSettings, SweepSettings};
pub use looks::{AtlasSettings, LookSettings, SideSettings, SimplifySettings};
pub use mass::MassSettings;
pub use portrait::PortraitSettings;
pub use repair::{PassageSettings, RepairSettings};

/// Least cosine between the motion of a part that opens and the normals of its front.
const FACING: f64 = 0.9;

/// Settings by question.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// What are the links?
    pub describe: DescribeSettings,
    /// What is drawn?
    pub looks: LookSettings,
    /// How heavy are the links?
    pub mass: MassSettings,
    /// How are the joints driven, and what holds them?
    pub dynamics: DynamicsSettings,
    /// How far do the joints go?
    pub limits: LimitSettings,
    /// What collides?
    pub collision: CollisionSettings,
    /// How does the picture show the object?
    pub portrait: PortraitSettings,
}
