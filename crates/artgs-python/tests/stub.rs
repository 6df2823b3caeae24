//! The stub of the native module names what the module has.

use std::collections::BTreeSet;

/// Words after `before` in the lines that begin with it.
fn names(text: &str, before: &str) -> BTreeSet<String> {
    let rest = text.lines().filter_map(|line| line.strip_prefix(before));
    rest.filter_map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().map(String::from)).collect()
}

#[test]
fn the_stub_has_every_function() {
    let sources = [
        include_str!("../src/arrays.rs"),
        include_str!("../src/objects.rs"),
        include_str!("../src/program.rs"),
        include_str!("../src/replica.rs"),
        include_str!("../src/run.rs"),
    ]
    .concat();
    let name = |piece: &str| piece.lines().find_map(|line| names(line, "pub(crate) fn ").pop_first());
    let functions: BTreeSet<String> = sources.split("#[pyfunction]").skip(1).filter_map(name).collect();
    assert_eq!(functions, names(include_str!("../python/artgs/_native.pyi"), "def "));
    assert!(functions.contains("reconstruct"));
}
