//! Graphics processors as the command line sees them; with the feature `gpu` alone are there any.

pub(crate) use support::{NONE_LISTED, SUPPORTED, adapters, open, open_if_fast, silence_drivers};

#[cfg(feature = "gpu")]
mod support {
    use crate::device::Listed;
    use artgs::fit::{Cpu, Devices};
    use artgs_gpu::{Adapter, Gpu, GpuDevices, GpuError, Kind, Scene, trial};

    /// True if this program can train on graphics processors.
    pub(crate) const SUPPORTED: bool = true;
    /// Said below an empty list.
    pub(crate) const NONE_LISTED: &str =
        "No graphics processor was found: no driver for Vulkan, Metal or Direct3D 12 offers one.";

    /// To be called before the program has a second thread. Mesa's drivers otherwise ask a display which device is best,
    /// and complain on standard error where there is none.
    pub(crate) fn silence_drivers() {
        const SWITCH: &str = "NODEVICE_SELECT";
        if std::env::var_os(SWITCH).is_none() {
            // SAFETY: there is one thread, so nothing else reads or writes the environment meanwhile.
            unsafe { std::env::set_var(SWITCH, "1") };
        }
    }

    /// Opens the device `index`, or without one the most capable; else says why not.
    pub(crate) fn open(index: Option<usize>) -> Result<Box<dyn Devices>, String> {
        let gpu = Gpu::open(index, true).map_err(|e| e.to_string())?;
        let devices = GpuDevices::new(gpu).map_err(|e| e.to_string())?;
        tried(&devices)?;
        Ok(Box::new(devices))
    }

    /// Opens the most capable device that is not software, unless it trains no faster than the processor; else says why not.
    /// Devices with memory of their own are taken to be faster.
    pub(crate) fn open_if_fast() -> Result<Box<dyn Devices>, String> {
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

    /// All there are.
    pub(crate) fn adapters() -> Vec<Listed> {
        artgs_gpu::adapters().into_iter().map(listed).collect()
    }

    fn listed(a: Adapter) -> Listed {
        Listed {
            index: a.index,
            kind: a.kind.to_string(),
            can_train: a.lacks.is_none(),
            largest_buffer: a.largest_buffer,
            subgroup: a.subgroup,
            timestamps: a.timestamps,
            name: a.name,
            interface: a.interface,
            driver: a.driver,
            lacks: a.lacks,
        }
    }
}

#[cfg(not(feature = "gpu"))]
mod support {
    use crate::device::Listed;
    use artgs::fit::Devices;

    /// True if this program can train on graphics processors.
    pub(crate) const SUPPORTED: bool = false;
    /// Said below an empty list.
    pub(crate) const NONE_LISTED: &str =
        "This program was built without support for graphics processors; the feature `gpu` of artgs-cli adds it.";

    /// Nothing speaks.
    pub(crate) fn silence_drivers() {}

    /// Says why not.
    pub(crate) fn open(_: Option<usize>) -> Result<Box<dyn Devices>, String> {
        Err("this program was built without support for graphics processors (feature `gpu` of artgs-cli)".into())
    }

    /// Says why not.
    pub(crate) fn open_if_fast() -> Result<Box<dyn Devices>, String> {
        open(None)
    }

    /// None.
    pub(crate) fn adapters() -> Vec<Listed> {
        Vec::new()
    }
}
