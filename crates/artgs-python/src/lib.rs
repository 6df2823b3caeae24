//! The module `artgs._native`: calls of the library with the interpreter released, and arrays. The package around it, in
//! `python/artgs`, has the interface for users.

mod arrays;
mod capture;
mod errors;
mod work;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    use super::{arrays, capture, work};
    use pyo3::prelude::*;

    #[pymodule_export]
    use arrays::{poses, read_mesh, read_replica, read_splats};
    #[pymodule_export]
    use capture::Capture;
    #[pymodule_export]
    use work::{call, command};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        artgs_cli::describe_panics();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
