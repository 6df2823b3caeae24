//! Compiled kernels and how they are called.

use crate::constants::ROW;
use crate::{Gpu, GpuError};

/// How a kernel uses a binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Use {
    /// The uniform of a step; each call chooses the step.
    Step,
    /// Small constants.
    Constant,
    /// Reads.
    Read,
    /// Reads and writes.
    Write,
}

/// How many workgroups are started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Groups {
    /// This many, in rows of at most [`ROW`].
    Count(u32),
    /// A grid.
    Grid([u32; 3]),
    /// As many as the device wrote into this entry of `arguments`.
    Indirect(u32),
}

/// A compiled kernel.
#[derive(Debug)]
pub(crate) struct Kernel {
    name: &'static str,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    uses: Vec<Use>,
}

/// A kernel with its arrays.
#[derive(Clone, Debug)]
pub(crate) struct Call {
    pub(crate) name: &'static str,
    pipeline: wgpu::ComputePipeline,
    arrays: wgpu::BindGroup,
    /// True if it reads the uniform of a step.
    stepwise: bool,
}

impl Kernel {
    /// Compiles entry point `name` of the source; `uses` are those of binding 0, 1, ...
    pub(crate) fn new(gpu: &Gpu, name: &'static str, source: String, uses: &[Use]) -> Self {
        let descriptor =
            wgpu::ShaderModuleDescriptor { label: Some(name), source: wgpu::ShaderSource::Wgsl(source.into()) };
        // SAFETY: all kernels keep their indices within their arrays: they compare with the lengths in `Step` and `control`,
        // by which the host sizes the arrays; and all their loops end.
        let module = unsafe { gpu.device.create_shader_module_trusted(descriptor, checks()) };
        let entry = |(binding, what): (usize, &Use)| wgpu::BindGroupLayoutEntry {
            binding: binding as u32,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: match what {
                    Use::Step | Use::Constant => wgpu::BufferBindingType::Uniform,
                    Use::Read => wgpu::BufferBindingType::Storage { read_only: true },
                    Use::Write => wgpu::BufferBindingType::Storage { read_only: false },
                },
                has_dynamic_offset: *what == Use::Step,
                min_binding_size: None,
            },
            count: None,
        };
        let entries: Vec<_> = uses.iter().enumerate().map(entry).collect();
        let label = Some(name);
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: label,
            compilation_options: wgpu::PipelineCompilationOptions {
                zero_initialize_workgroup_memory: false,
                ..wgpu::PipelineCompilationOptions::default()
            },
            cache: None,
        });
        Self { name, pipeline, layout, uses: uses.to_vec() }
    }

    /// The kernel with its arrays, in the order of its bindings.
    pub(crate) fn on(&self, gpu: &Gpu, arrays: &[&wgpu::Buffer]) -> Call {
        assert_eq!(arrays.len(), self.uses.len(), "arrays of {}", self.name);
        let entries: Vec<_> =
            arrays.iter().zip(&self.uses).enumerate().map(|(i, (array, what))| entry(i, array, *what)).collect();
        let descriptor = wgpu::BindGroupDescriptor { label: Some(self.name), layout: &self.layout, entries: &entries };
        Call {
            name: self.name,
            pipeline: self.pipeline.clone(),
            arrays: gpu.device.create_bind_group(&descriptor),
            stepwise: self.uses.first() == Some(&Use::Step),
        }
    }
}

/// The buffer of a binding; of the uniforms of steps, the size of one.
fn entry(binding: usize, array: &wgpu::Buffer, what: Use) -> wgpu::BindGroupEntry<'_> {
    let one = wgpu::BufferSize::new(size_of::<crate::step::Step>() as u64);
    let resource = match what {
        Use::Step => wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer: array, offset: 0, size: one }),
        _ => array.as_entire_binding(),
    };
    wgpu::BindGroupEntry { binding: binding as u32, resource }
}

/// Run-time bounds checks of kernels, in tests only.
fn checks() -> wgpu::ShaderRuntimeChecks {
    if cfg!(test) { wgpu::ShaderRuntimeChecks::checked() } else { wgpu::ShaderRuntimeChecks::unchecked() }
}

impl Call {
    /// Appends the call to a pass. `step` is the index of the step among those uploaded; `arguments` holds the sizes of
    /// indirect dispatches.
    pub(crate) fn encode(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        step: usize,
        groups: Groups,
        arguments: &wgpu::Buffer,
    ) {
        pass.set_pipeline(&self.pipeline);
        let offset = (step * crate::step::STRIDE) as u32;
        pass.set_bind_group(0, &self.arrays, if self.stepwise { std::slice::from_ref(&offset) } else { &[] });
        match groups {
            Groups::Count(0) => {}
            Groups::Count(n) => pass.dispatch_workgroups(n.min(ROW), n.div_ceil(ROW), 1),
            Groups::Grid([x, y, z]) => pass.dispatch_workgroups(x, y, z),
            Groups::Indirect(entry) => pass.dispatch_workgroups_indirect(arguments, 16 * u64::from(entry)),
        }
    }
}

/// Compiles kernels; errors of the compiler are returned.
pub(crate) fn compiled<T>(gpu: &Gpu, make: impl FnOnce() -> T) -> Result<T, GpuError> {
    let made = make();
    gpu.check()?;
    Ok(made)
}
