//! Training on any graphics processor through wgpu: the kernels of `artgs-raster` and `artgs::fit` in WGSL, file by file
//! under the same names.

mod backend;
mod chamfer;
mod device;
mod joints;
mod kernel;
mod kernels;
mod learnt;
mod picture;
mod resident;
mod scene;
mod step;
#[cfg(test)]
mod testing;
mod trial;

pub use backend::{GpuBackend, GpuDevices};
pub use device::{Adapter, Gpu, GpuError, Kind, adapters};
pub use trial::{Scene, Trial, trial};
