//! Times of the kernels of a step.

use super::{GpuBackend, device};
use crate::GpuError;
use crate::step;
use artgs::fit::FitError;
use std::collections::BTreeMap;

impl GpuBackend<'_> {
    /// Milliseconds that each kernel takes within one step, summed by name, and how often it is called. Parameters do not
    /// change. An error on devices that cannot time kernels, and before the first upload.
    pub fn profile(&mut self) -> Result<BTreeMap<&'static str, (f64, usize)>, FitError> {
        self.timed().map_err(device)
    }

    /// Bytes of device memory in use, if the driver reports them.
    pub fn allocated(&self) -> Option<u64> {
        self.gpu.device.generate_allocator_report().map(|report| report.total_allocated_bytes)
    }

    fn timed(&mut self) -> Result<BTreeMap<&'static str, (f64, usize)>, GpuError> {
        if !self.gpu.timestamps {
            return Err(GpuError::Failed(format!("{} does not time kernels", self.gpu.name)));
        }
        let view = self.views.sampler.view();
        let numbers = self.step_uniform(0, (view, [0.0; 3]), &self.config.loss);
        let Some(resident) = &self.resident else {
            return Err(GpuError::Failed("no state was uploaded".into()));
        };
        let (step_buffers, programs) = (&resident.step_buffers, &resident.programs);
        let calls: Vec<_> = programs.of_step(view, true).collect();
        let marks = calls.len() + 1;
        let queries = self.gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("kernel times"),
            ty: wgpu::QueryType::Timestamp,
            count: marks as u32,
        });
        use wgpu::BufferUsages as U;
        let times = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("kernel times"),
            size: 8 * marks as u64,
            usage: U::QUERY_RESOLVE | U::COPY_SRC,
            mapped_at_creation: false,
        });
        // Rates of 0: only moments change.
        self.gpu.write(&step_buffers.steps, 0, &step::bytes(&[numbers.without_rates()]));
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.write_timestamp(&queries, 0);
            for (i, (call, size)) in calls.iter().enumerate() {
                call.encode(&mut pass, 0, size.groups(&numbers), &step_buffers.arguments);
                pass.write_timestamp(&queries, i as u32 + 1);
            }
        }
        encoder.resolve_query_set(&queries, 0..marks as u32, &times, 0);
        self.gpu.queue.submit([encoder.finish()]);
        let read = self.gpu.read(&[(&times, 2 * marks)])?;
        let at = |i: usize| u64::from(read[0][2 * i]) | u64::from(read[0][2 * i + 1]) << 32;
        let tick = f64::from(self.gpu.queue.get_timestamp_period()) * 1e-6;
        let mut out = BTreeMap::new();
        for (i, (call, _)) in calls.iter().enumerate() {
            let entry: &mut (f64, usize) = out.entry(call.name).or_default();
            *entry = (entry.0 + tick * at(i + 1).saturating_sub(at(i)) as f64, entry.1 + 1);
        }
        Ok(out)
    }
}
