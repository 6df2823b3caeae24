//! The method.
pub mod discover;
pub mod neighbours;
