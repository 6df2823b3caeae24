//! Training on any graphics processor through wgpu. The kernels in WGSL compute the same as `artgs-raster` and `artgs::fit`
//! on the CPU; each file says which module.

mod backend;
mod choice;
mod constants;
mod device;
mod device_image;
mod joints;
mod kernel;
mod kernels;
#[cfg(test)]
mod layout_tests;
mod published;
mod resident;
mod scene;
mod shared;
mod step;
#[cfg(test)]
mod testing;
mod trial;

pub use backend::{GpuBackend, GpuDevices};
pub use choice::open;
pub use device::{Adapter, Gpu, GpuError, Kind, adapters};
pub use trial::{Scene, Trial, trial};
