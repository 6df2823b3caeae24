//! The method.

pub mod evaluate;
pub mod surface;
