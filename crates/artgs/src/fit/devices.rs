//! Where training runs: the devices that make the backend of each optimisation of a run.

use super::FitError;
use super::backend::{Backend, TrainConfig};
use super::cpu::CpuBackend;
use super::images::TrainImage;
use std::fmt;

/// Makes backends. Which one is chosen changes the time a run takes, and its result only by rounding.
pub trait Devices: fmt::Debug + Sync {
    /// Name of what trains, for people.
    fn name(&self) -> String;

    /// A backend that holds the images; `seed` decides the order of views and the backgrounds.
    fn backend<'a>(
        &'a self,
        images: Vec<TrainImage<'a>>,
        config: TrainConfig,
        seed: u64,
    ) -> Result<Box<dyn Backend + 'a>, FitError>;

    /// Why training changed to another device, returned once; none if it did not.
    fn notice(&self) -> Option<String> {
        None
    }
}

/// The processor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cpu;

impl Cpu {
    /// Instruction set of the kernels.
    pub fn instructions(&self) -> &'static str {
        artgs_raster::simd::instructions()
    }

    /// Threads that share the work.
    pub fn threads(&self) -> usize {
        rayon::current_num_threads()
    }
}

impl Devices for Cpu {
    fn name(&self) -> String {
        let threads = self.threads();
        format!("CPU ({}, {threads} thread{})", self.instructions(), if threads == 1 { "" } else { "s" })
    }

    fn backend<'a>(
        &'a self,
        images: Vec<TrainImage<'a>>,
        config: TrainConfig,
        seed: u64,
    ) -> Result<Box<dyn Backend + 'a>, FitError> {
        Ok(Box::new(CpuBackend::new(images, config, seed)?))
    }
}
