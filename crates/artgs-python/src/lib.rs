//! The module `artgs._native`: calls of the library with the interpreter released, and arrays. The package around it, in
//! `python/artgs`, has the interface for users.

mod arrays;
mod capture;
mod errors;
mod objects;
mod program;
mod replica;
mod run;
mod settings;
mod work;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    use super::{arrays, capture, objects, program, replica, run};
    use pyo3::prelude::*;

    #[pymodule_export]
    use arrays::{poses, read_mesh, read_replica, read_splats};
    #[pymodule_export]
    use capture::Capture;
    #[pymodule_export]
    use objects::synth;
    #[pymodule_export]
    use program::command;
    #[pymodule_export]
    use replica::{check, evaluate, export, page};
    #[pymodule_export]
    use run::{discover, inspect, reconstruct};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        artgs_cli::describe_panics();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
