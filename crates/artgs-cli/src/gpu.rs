//! Graphics processors as the command line sees them; there are some only with the feature `gpu`.

pub(crate) use support::{NONE_LISTED, SUPPORTED, adapters, open, silence_drivers};

use serde::Serialize;

/// A graphics processor of the list.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Listed {
    pub(crate) index: usize,
    pub(crate) name: String,
    pub(crate) kind: String,
    pub(crate) interface: String,
    pub(crate) driver: String,
    /// Bytes.
    pub(crate) largest_buffer: u64,
    pub(crate) subgroup: Option<[u32; 2]>,
    pub(crate) timestamps: bool,
    pub(crate) can_train: bool,
    pub(crate) lacks: Option<String>,
}

#[cfg(feature = "gpu")]
mod support {
    use super::Listed;
    use artgs_gpu::Adapter;
    pub(crate) use artgs_gpu::open;

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
    use super::Listed;
    use artgs::fit::{Chosen, Cpu, DeviceChoice};

    /// True if this program can train on graphics processors.
    pub(crate) const SUPPORTED: bool = false;
    /// Said below an empty list.
    pub(crate) const NONE_LISTED: &str =
        "This program was built without support for graphics processors; the feature `gpu` of artgs-cli adds it.";

    /// Nothing speaks.
    pub(crate) fn silence_drivers() {}

    /// The processor, or why nothing else.
    pub(crate) fn open(choice: DeviceChoice) -> Result<Chosen, String> {
        const NO_SUPPORT: &str =
            "this program was built without support for graphics processors (feature `gpu` of artgs-cli)";
        match choice {
            DeviceChoice::Cpu => Ok(Chosen::new(Box::new(Cpu), "")),
            DeviceChoice::Auto => Ok(Chosen::new(Box::new(Cpu), &format!(", as {NO_SUPPORT}"))),
            DeviceChoice::Gpu(_) => Err(NO_SUPPORT.into()),
        }
    }

    /// None.
    pub(crate) fn adapters() -> Vec<Listed> {
        Vec::new()
    }
}
