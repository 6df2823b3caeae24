//! Training on any graphics processor through wgpu: the kernels of `artgs-raster` and `artgs::fit` in WGSL, file by file
//! under the same names.

mod backend;
mod chamfer;
mod constants;
mod device;
mod joints;
mod kernel;
mod kernels;
#[cfg(test)]
mod layout_tests;
mod learnt;
mod picture;
mod resident;
mod scene;
mod shared;
mod step;
#[cfg(test)]
mod testing;
mod trial;

pub use backend::{GpuBackend, GpuDevices};
pub use device::{Adapter, Gpu, GpuError, Kind, adapters};
pub use trial::{Scene, Trial, trial};
