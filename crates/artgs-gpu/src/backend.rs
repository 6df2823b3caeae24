//! Training on a graphics processor.

use crate::Gpu;
use artgs::fit::{Backend, Devices, FitError, TrainConfig, TrainImage};

/// An open graphics processor as runs use it.
#[derive(Clone, Debug)]
pub struct GpuDevices {
    gpu: Gpu,
}

impl GpuDevices {
    /// Trains on this device.
    pub fn new(gpu: Gpu) -> Self {
        Self { gpu }
    }
}

impl Devices for GpuDevices {
    fn name(&self) -> String {
        self.gpu.name.clone()
    }

    fn backend<'a>(
        &'a self,
        _: Vec<TrainImage<'a>>,
        _: TrainConfig,
        _: u64,
    ) -> Result<Box<dyn Backend + 'a>, FitError> {
        Err(FitError::Device("there are no kernels for graphics processors yet".into()))
    }
}
