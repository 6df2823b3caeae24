//! The method.

pub mod articulation;
pub mod canonical;
