//! What tests of kernels share.

use crate::{Gpu, GpuError};

/// Any device, also one in software; none with a word about it where there is no driver, unless `ARTGS_REQUIRE_GPU` is set.
///
/// # Panics
/// If there is no device but one is required.
#[allow(clippy::print_stderr)]
pub(crate) fn gpu() -> Option<Gpu> {
    match Gpu::open(None, true) {
        Ok(gpu) => Some(gpu),
        Err(reason @ GpuError::None) if std::env::var_os("ARTGS_REQUIRE_GPU").is_none() => {
            eprintln!("SKIPPED: {reason}");
            None
        }
        Err(reason) => panic!("{reason}"),
    }
}
