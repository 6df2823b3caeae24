//! A benchmark over random objects: each is made, reconstructed and scored in processes of their own, and removed. What remains is a
//! row and a small picture per object, and the tables of all rows.

mod object;
mod overlap;
mod preview;
mod read;
pub mod report;
mod row;
mod run;
mod score;
mod table;
#[cfg(test)]
mod testing;
mod truth;

pub use object::verdict;
pub use read::{WriteError, read_rows, write_rows};
pub use row::{JointRow, Row, Status};
pub use run::{Event, Finished, Options, RESERVED, run};
