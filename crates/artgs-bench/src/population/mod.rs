//! The benchmark of a population: random objects, each a row, and the report of them.

pub mod report;
mod row;

pub use row::{JointRow, Row, Status};
