//! How far joints go: from the observed values to contacts, to where fronts are flush, or by a default.

pub(crate) mod flush;
mod nearer_state;
mod range;
mod search;
pub(crate) mod sweep;
#[cfg(test)]
mod tests;

pub(crate) use nearer_state::nearer_state;
pub(crate) use range::{Range, Stop, extend};
