//! The method.

pub mod fit;
