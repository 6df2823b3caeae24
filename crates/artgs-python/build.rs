//! Linking of a module whose symbols of the interpreter are found when it is imported.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
