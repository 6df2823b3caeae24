//! What parts collide with: convex pieces that keep a gap in all relative motions.

pub(crate) mod apart;
pub(crate) mod clearance;
pub(crate) mod coacd;
pub mod decompose;
pub(crate) mod islands;
pub(crate) mod motions;
pub(crate) mod redundant;
