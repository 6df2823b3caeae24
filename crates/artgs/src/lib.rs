//! The method: two captures of an articulated object to an interactable replica.

pub mod ablation;
pub mod articulation;
pub mod canonical;
pub mod config;
pub mod discover;
pub mod evaluate;
pub mod fit;
pub mod kernel_constants;
pub mod neighbours;
pub mod observer;
pub mod registration;
pub mod run;
mod shorten;
pub mod surface;

pub use config::Config;
pub use run::{Error, Summary, reconstruct};
