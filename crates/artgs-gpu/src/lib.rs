//! Training on any graphics processor through wgpu: the kernels of `artgs-raster` and `artgs::fit` in WGSL, file by file
//! under the same names.

mod backend;
mod device;
#[cfg(test)]
mod testing;

pub use backend::GpuDevices;
pub use device::{Adapter, Gpu, GpuError, Kind, adapters};
