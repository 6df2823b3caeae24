//! Every number that an export depends on, that nothing measures and that no option gives: one type for each question.

mod collision;
mod decompose;
mod dynamics;
mod limits;
mod mass;

pub use collision::{ClearanceSettings, CollisionSettings, PoseSettings};
pub use decompose::{DecomposeSettings, FloorSettings, RegionSettings, RestSettings, SheetSettings, UnionSettings};
pub use dynamics::DynamicsSettings;
pub use limits::{FlushSettings, LimitSettings, SweepSettings};
pub use mass::MassSettings;

/// Settings by question.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// How heavy are the links?
    pub mass: MassSettings,
    /// How are the joints driven, and what holds them?
    pub dynamics: DynamicsSettings,
    /// How far do the joints go?
    pub limits: LimitSettings,
    /// What collides?
    pub collision: CollisionSettings,
}
