//! Opens the device that a run is asked to train on.

use crate::{Gpu, GpuDevices, GpuError, Kind, Scene, adapters, trial};
use artgs::fit::{Chosen, Cpu, DeviceChoice, Devices, WithFallback};

/// Opens a device; else says why there is none.
pub fn open(choice: DeviceChoice) -> Result<Chosen, String> {
    Ok(match choice {
        DeviceChoice::Cpu => Chosen::new(Box::new(Cpu), ""),
        DeviceChoice::Gpu(index) => Chosen::new(numbered(index)?, ""),
        DeviceChoice::Auto => match fast() {
            Ok(gpu) => Chosen::new(Box::new(WithFallback::new(gpu)), ""),
            Err(reason) => Chosen::new(Box::new(Cpu), &format!(", as {reason}")),
        },
    })
}

/// The device `index`, or without one the most capable; else says why not.
fn numbered(index: Option<usize>) -> Result<Box<dyn Devices>, String> {
    let gpu = Gpu::open(index, true).map_err(|e| e.to_string())?;
    let devices = GpuDevices::new(gpu).map_err(|e| e.to_string())?;
    tried(&devices)?;
    Ok(Box::new(devices))
}

/// The most capable device that is not software, unless it trains no faster than the processor; else says why not.
/// Devices with memory of their own are taken to be faster.
fn fast() -> Result<Box<dyn Devices>, String> {
    let reason = |error: GpuError| match error {
        GpuError::None if adapters().is_empty() => "no graphics processor was found".to_string(),
        GpuError::None => "no GPU was found; the only Vulkan driver is a software driver".to_string(),
        error => error.to_string(),
    };
    let gpu = Gpu::open(None, false).map_err(reason)?;
    let surely = gpu.kind == Kind::Discrete;
    let devices = GpuDevices::new(gpu).map_err(reason)?;
    tried(&devices)?;
    if !surely {
        let time = |devices: &dyn Devices| match trial(devices, Scene::USUAL) {
            Ok(trial) => Ok(1e3 * trial.seconds_per_step),
            Err(error) => Err(error.to_string()),
        };
        let [there, here] = [time(&devices)?, time(&Cpu)?];
        if there >= here {
            return Err(format!("{} takes {there:.1} ms for a step of a trial, the CPU {here:.1}", devices.name()));
        }
    }
    Ok(Box::new(devices))
}

/// Refuses a device that does not compute what the processor does.
fn tried(devices: &GpuDevices) -> Result<(), String> {
    let of = |devices: &dyn Devices| trial(devices, Scene::SMALL).map_err(|e| e.to_string());
    match of(devices)?.disagrees(&of(&Cpu)?) {
        None => Ok(()),
        Some((step, [there, here])) => Err(format!(
            "{} makes mistakes: a loss of {there} after {step} steps of a trial, the CPU {here}; a newer driver may help",
            devices.name()
        )),
    }
}
