//! Command line of artgs.
fn main() {}
