//! List of graphics processors, and an open one.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Why a graphics processor cannot be used.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum GpuError {
    /// No driver (Vulkan, Metal or Direct3D 12) offers a device.
    #[error("no graphics processor was found: install its Vulkan driver, or train with --device cpu")]
    None,
    /// No device has this index.
    #[error("there is no graphics processor {0}: `artgs devices` lists the available ones")]
    Unknown(usize),
    /// The device lacks something that the kernels need.
    #[error("{name} cannot be used: {lacks}")]
    Unsuitable {
        /// Name of the device.
        name: String,
        /// What is missing.
        lacks: String,
    },
    /// The driver did not open it.
    #[error("{name} does not open: {reason}")]
    Refused {
        /// Name of the device.
        name: String,
        /// Message of the driver.
        reason: String,
    },
    /// It failed in use: lost, out of memory, or an error in a kernel.
    #[error("{0}")]
    Failed(String),
}

/// Type of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A driver that computes on the CPU: for tests, much slower than training on the CPU itself.
    Software,
    /// In a virtual machine, or of unknown type.
    Virtual,
    /// Shares its memory with the CPU.
    Integrated,
    /// Has memory of its own.
    Discrete,
}

/// A graphics processor and what it supports.
#[derive(Clone, Debug)]
pub struct Adapter {
    /// Place in the list, for `--device gpu:N`.
    pub index: usize,
    /// Name in its driver.
    pub name: String,
    /// Type of the device.
    pub kind: Kind,
    /// Interface: Vulkan, Metal or Dx12.
    pub interface: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Largest array that a kernel can use, bytes.
    pub largest_buffer: u64,
    /// Least and largest subgroup size, if kernels may exchange values within subgroups.
    pub subgroup: Option<[u32; 2]>,
    /// True if single kernels can be timed.
    pub timestamps: bool,
    /// The missing limit, if it cannot train.
    pub lacks: Option<String>,
    handle: wgpu::Adapter,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Software => "software",
            Self::Virtual => "virtual",
            Self::Integrated => "integrated",
            Self::Discrete => "discrete",
        })
    }
}

/// Features needed to time single kernels.
const TIMING: wgpu::Features = wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES);

/// Limits that the kernels need.
fn needs() -> wgpu::Limits {
    wgpu::Limits {
        max_storage_buffers_per_shader_stage: 13,
        max_compute_workgroup_storage_size: 24 << 10,
        max_compute_invocations_per_workgroup: 256,
        max_compute_workgroup_size_x: 256,
        ..wgpu::Limits::downlevel_defaults()
    }
}

fn lacks(limits: &wgpu::Limits) -> Option<String> {
    let needs = needs();
    let least = [
        (
            "storage buffers per kernel",
            limits.max_storage_buffers_per_shader_stage,
            needs.max_storage_buffers_per_shader_stage,
        ),
        (
            "bytes of workgroup memory",
            limits.max_compute_workgroup_storage_size,
            needs.max_compute_workgroup_storage_size,
        ),
        (
            "threads per workgroup",
            limits.max_compute_invocations_per_workgroup,
            needs.max_compute_invocations_per_workgroup,
        ),
    ];
    least.iter().find(|(_, has, need)| has < need).map(|(what, has, need)| format!("{has} {what}, {need} are needed"))
}

fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    // Sizes of indirect dispatches are written by the kernels; validating them would add a dispatch to each.
    descriptor.flags = wgpu::InstanceFlags::empty();
    wgpu::Instance::new(descriptor)
}

/// All graphics processors, in the order of the drivers. Empty where there is no driver.
pub fn adapters() -> Vec<Adapter> {
    let all = pollster::block_on(instance().enumerate_adapters(wgpu::Backends::all()));
    all.into_iter().enumerate().map(|(index, handle)| Adapter::new(index, handle)).collect()
}

impl Adapter {
    fn new(index: usize, handle: wgpu::Adapter) -> Self {
        let (info, limits, features) = (handle.get_info(), handle.limits(), handle.features());
        let kind = match info.device_type {
            wgpu::DeviceType::DiscreteGpu => Kind::Discrete,
            wgpu::DeviceType::IntegratedGpu => Kind::Integrated,
            wgpu::DeviceType::Cpu => Kind::Software,
            _ => Kind::Virtual,
        };
        let driver = format!("{} {}", info.driver, info.driver_info).trim().to_string();
        Self {
            index,
            kind,
            interface: format!("{:?}", info.backend),
            driver,
            largest_buffer: limits.max_storage_buffer_binding_size.min(limits.max_buffer_size),
            subgroup: features
                .contains(wgpu::Features::SUBGROUP)
                .then_some([info.subgroup_min_size, info.subgroup_max_size]),
            timestamps: features.contains(TIMING),
            lacks: lacks(&limits),
            name: info.name,
            handle,
        }
    }
}

/// An open graphics processor. Cheap to clone; all clones share its queue.
#[derive(Clone, Debug)]
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    /// Name and interface.
    pub name: String,
    /// Type of the device.
    pub kind: Kind,
    pub(crate) largest_buffer: u64,
    pub(crate) timestamps: bool,
    /// Least and largest subgroup size.
    pub(crate) subgroup: Option<[u32; 2]>,
    failure: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens the device `index` of [`adapters`], or without an index the first one of the most capable type. Devices that
    /// compute on the CPU are opened only by their index or if `software`.
    pub fn open(index: Option<usize>, software: bool) -> Result<Self, GpuError> {
        let mut all = adapters();
        if let Some(index) = index {
            let chosen = all.into_iter().nth(index).ok_or(GpuError::Unknown(index))?;
            return Self::of(&chosen);
        }
        all.retain(|a| software || a.kind != Kind::Software);
        let suitable = all.iter().filter(|a| a.lacks.is_none());
        let best = suitable.rev().max_by_key(|a| a.kind).or(all.first());
        Self::of(best.ok_or(GpuError::None)?)
    }

    fn of(adapter: &Adapter) -> Result<Self, GpuError> {
        if let Some(lacks) = &adapter.lacks {
            return Err(GpuError::Unsuitable { name: adapter.name.clone(), lacks: lacks.clone() });
        }
        let features = adapter.handle.features() & TIMING.union(wgpu::Features::SUBGROUP);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("artgs"),
            required_features: features,
            required_limits: adapter.handle.limits(),
            ..wgpu::DeviceDescriptor::default()
        };
        let opened = pollster::block_on(adapter.handle.request_device(&descriptor));
        let refused =
            |e: wgpu::RequestDeviceError| GpuError::Refused { name: adapter.name.clone(), reason: e.to_string() };
        let (device, queue) = opened.map_err(refused)?;
        let failure = Arc::new(Mutex::new(None));
        let note = |failure: &Arc<Mutex<Option<String>>>, what: String| {
            failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(what);
        };
        let seen = failure.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| note(&seen, error.to_string())));
        let seen = failure.clone();
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                note(&seen, format!("the device was lost: {message}"));
            }
        });
        Ok(Self {
            device,
            queue,
            name: format!("{} ({})", adapter.name, adapter.interface),
            kind: adapter.kind,
            largest_buffer: adapter.largest_buffer,
            timestamps: features.contains(TIMING),
            subgroup: adapter.subgroup,
            failure,
        })
    }

    /// The first error on the device since it was opened.
    pub(crate) fn check(&self) -> Result<(), GpuError> {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.as_ref().map_or(Ok(()), |what| Err(GpuError::Failed(format!("{}: {what}", self.name))))
    }

    /// An array of `count` elements of `bytes` bytes each that kernels read and write; initially 0.
    pub(crate) fn array(&self, label: &str, count: usize, bytes: usize) -> Result<wgpu::Buffer, GpuError> {
        let size = (count.max(1) * bytes).next_multiple_of(16) as u64;
        if size > self.largest_buffer {
            let (mib, most) = (size >> 20, self.largest_buffer >> 20);
            return Err(GpuError::Failed(format!(
                "{}: {label} needs {mib} MiB, arrays have at most {most}",
                self.name
            )));
        }
        use wgpu::BufferUsages as U;
        let usage = U::STORAGE | U::COPY_SRC | U::COPY_DST | U::INDIRECT;
        Ok(self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: false,
        }))
    }

    /// An array with the content `data`.
    pub(crate) fn array_of<T: bytemuck::Pod>(&self, label: &str, data: &[T]) -> Result<wgpu::Buffer, GpuError> {
        let buffer = self.array(label, data.len(), size_of::<T>())?;
        self.write(&buffer, 0, data);
        Ok(buffer)
    }

    /// Overwrites elements of an array from element `at` on; the length in bytes is rounded up to a multiple of four.
    pub(crate) fn write<T: bytemuck::Pod>(&self, buffer: &wgpu::Buffer, at: usize, data: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let offset = (at * size_of::<T>()) as u64;
        let whole = bytes.len() / 4 * 4;
        self.queue.write_buffer(buffer, offset, &bytes[..whole]);
        if whole < bytes.len() {
            let mut last = [0; 4];
            last[..bytes.len() - whole].copy_from_slice(&bytes[whole..]);
            self.queue.write_buffer(buffer, offset + whole as u64, &last);
        }
    }

    /// Waits for all submitted work and returns the first words of each array, as many as its count.
    pub(crate) fn read(&self, arrays: &[(&wgpu::Buffer, usize)]) -> Result<Vec<Vec<u32>>, GpuError> {
        let total: usize = arrays.iter().map(|(_, count)| 4 * count).sum();
        use wgpu::BufferUsages as U;
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("staging"),
            size: (total as u64).max(4),
            usage: U::MAP_READ | U::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut at = 0;
        for (buffer, count) in arrays {
            let size = 4 * *count as u64;
            if size > 0 {
                encoder.copy_buffer_to_buffer(buffer, 0, &staging, at, size);
            }
            at += size;
        }
        self.queue.submit([encoder.finish()]);
        staging.slice(..).map_async(wgpu::MapMode::Read, |_| {});
        let failed = |what: String| GpuError::Failed(format!("{}: {what}", self.name));
        self.check()?;
        // wgpu panics if the device is lost during this wait.
        let wait = || self.device.poll(wgpu::PollType::wait_indefinitely());
        match std::panic::catch_unwind(std::panic::AssertUnwindSafe(wait)) {
            Ok(polled) => polled.map(|_| ()).map_err(|e| failed(e.to_string()))?,
            Err(_) => return Err(failed("the device was lost".into())),
        }
        self.check()?;
        let view = staging.slice(..).get_mapped_range().map_err(|e| failed(e.to_string()))?;
        let mut out = Vec::with_capacity(arrays.len());
        let mut at = 0;
        for (_, count) in arrays {
            let mut words = vec![0_u32; *count];
            bytemuck::cast_slice_mut::<u32, u8>(&mut words).copy_from_slice(&view[at..at + 4 * count]);
            out.push(words);
            at += 4 * count;
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_device_is_an_error_with_advice() {
        let error = Gpu::open(Some(1000), true).unwrap_err();
        assert_eq!(error, GpuError::Unknown(1000));
        assert!(error.to_string().contains("artgs devices"));
    }

    #[test]
    fn missing_limits_are_reported() {
        assert!(lacks(&wgpu::Limits::default()).is_some_and(|l| l.contains("storage buffers")));
        assert!(lacks(&needs()).is_none());
    }

    #[test]
    fn arrays_come_back_as_written() {
        let Some(gpu) = crate::testing::gpu() else { return };
        let a = gpu.array_of("a", &[1_u32, 2, 3]).unwrap();
        let b = gpu.array_of("b", &[7_u16, 8, 9]).unwrap();
        assert_eq!(gpu.read(&[(&a, 2), (&b, 2), (&a, 0)]).unwrap(), [vec![1, 2], vec![7 | 8 << 16, 9], vec![]]);
        assert!(gpu.array("huge", usize::MAX >> 8, 1).is_err());
    }
}
