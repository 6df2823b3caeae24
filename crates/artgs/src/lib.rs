//! The method: two captures of an articulated object to an interactable replica.

pub mod observer;
pub mod synth;
