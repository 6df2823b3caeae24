//! Graphics processors as the command line sees them; with the feature `gpu` alone are there any.

pub(crate) use support::{NONE_LISTED, SUPPORTED, adapters, open, quieten};

#[cfg(feature = "gpu")]
mod support {
    use crate::device::Listed;
    use artgs::fit::Devices;
    use artgs_gpu::{Adapter, Gpu, GpuDevices, GpuError};

    /// True if this program can train on graphics processors.
    pub(crate) const SUPPORTED: bool = true;
    /// Said below an empty list.
    pub(crate) const NONE_LISTED: &str =
        "No graphics processor was found: no driver for Vulkan, Metal or Direct3D 12 offers one.";

    /// To be called before the program has a second thread. Mesa's drivers otherwise ask a display which device is best,
    /// and complain on standard error where there is none.
    pub(crate) fn quieten() {
        const SWITCH: &str = "NODEVICE_SELECT";
        if std::env::var_os(SWITCH).is_none() {
            // SAFETY: there is one thread, so nothing else reads or writes the environment meanwhile.
            unsafe { std::env::set_var(SWITCH, "1") };
        }
    }

    /// Opens the device `index`, or without one the most capable, `software` included or not; else says why not.
    pub(crate) fn open(index: Option<usize>, software: bool) -> Result<Box<dyn Devices>, String> {
        let reason = |error: GpuError| match error {
            GpuError::None if !software => "no graphics processor was found".to_string(),
            error => error.to_string(),
        };
        let gpu = Gpu::open(index, software).map_err(reason)?;
        Ok(Box::new(GpuDevices::new(gpu).map_err(reason)?))
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
    pub(crate) fn quieten() {}

    /// Says why not.
    pub(crate) fn open(_: Option<usize>, _: bool) -> Result<Box<dyn Devices>, String> {
        Err("this program was built without support for graphics processors (feature `gpu` of artgs-cli)".into())
    }

    /// None.
    pub(crate) fn adapters() -> Vec<Listed> {
        Vec::new()
    }
}
