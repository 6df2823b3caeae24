//! Learned membership on the device: the centre-based assignment and its optimiser.

use crate::constants::{
    self, CENTRE, GROUP, GUMBEL, HARD, LAYER_BIAS, LAYER_GATE, LAYER_RELU, LAYER_ROWS, PART_GROUP, PRODUCT_SIDE,
    WEIGHTED, WIDE_GROUP,
};
use crate::joints::CHUNKS;
use crate::kernels::Kernels;
use crate::scene::{Gaussians, Program, Size, StepBuffers};
use crate::shared::shared_struct;
use crate::step::Step;
use crate::{Gpu, GpuError};
use artgs::fit::{Articulated, Membership};
use artgs::low_level::FEATURES;
use artgs::low_level::{AssignState, Assignment, GridTable, PartAssignment};
use bytemuck::Pod;
use wgpu::Buffer;

const FRAME: usize = constants::FRAME as usize;
const FRAME_SUMS: usize = constants::FRAME_SUMS as usize;

/// Everything but the number of Gaussians that determines the sizes of the arrays.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Shape {
    parts: usize,
    hidden: usize,
    /// Entries of each level of the hash grid.
    entries: Vec<usize>,
}

/// Arrays of a learned assignment.
#[derive(Debug)]
pub(crate) struct LearnedMembership {
    pub(crate) shape: Shape,
    /// Weights of the parts, `[K][n]`.
    pub(crate) weights: Buffer,
    /// Motions of all Gaussians at the state of a step, as `warp.wgsl` reads them.
    pub(crate) blended: Buffer,
    lengths: Buffer,
    /// Frames and perceptron, in the order of [`AssignState::values`], and their moments.
    values: Buffer,
    first: Buffer,
    second: Buffer,
    levels: Buffer,
    table: Buffer,
    moments: Buffer,
    largest: Buffer,
    sums: Buffer,
    frames: Buffer,
    inputs: Buffer,
    hidden: Buffer,
    outputs: Buffer,
    soft: Buffer,
    d_inputs: Buffer,
    d_hidden: Buffer,
    d_outputs: Buffer,
    d_distances: Buffer,
    d_frames: Buffer,
    d_layers: Buffer,
    masses: Buffer,
    part_means: Buffer,
    layers: Layers,
}

/// The layer of each call of a kernel of `mlp.wgsl`.
#[derive(Debug)]
struct Layers {
    first: Buffer,
    second: Buffer,
    second_back: Buffer,
    first_back: Buffer,
}

shared_struct! {
    /// A layer of the perceptron, or its transpose.
    pub(crate) struct Layer {
        inputs: u32,
        rows: u32,
        /// Where weights and biases begin among the parameters.
        weights: u32,
        biases: u32,
        /// Distances between weights of neighbouring rows and inputs.
        row_stride: u32,
        input_stride: u32,
        flags: u32,
        /// Number of parameters of all layers.
        total: u32,
    }
}

shared_struct! {
    /// A level of the hash grid.
    pub(crate) struct Level {
        /// Grid points per unit length.
        scale: f32,
        stride_y: u32,
        stride_z: u32,
        /// Not 0 if entries are found by a hash.
        hashed: u32,
        /// Number of entries, and where they begin among those of all levels.
        size: u32,
        begin: u32,
        pad_a: u32,
        pad_b: u32,
    }
}

/// The learned assignment, if it is of the kind that this backend trains.
pub(crate) fn module(articulated: &Articulated) -> Option<&PartAssignment> {
    match &articulated.membership {
        Membership::Learned(assignment) => match &**assignment {
            Assignment::Centres(module) => Some(module),
            Assignment::Mlp(_) | Assignment::Slots(_) => None,
        },
        Membership::Labels(_) => None,
    }
}

fn module_mut(articulated: &mut Articulated) -> Option<&mut PartAssignment> {
    match &mut articulated.membership {
        Membership::Learned(assignment) => match &mut **assignment {
            Assignment::Centres(module) => Some(module),
            Assignment::Mlp(_) | Assignment::Slots(_) => None,
        },
        Membership::Labels(_) => None,
    }
}

/// Sets the fields of step `number` that a learned assignment needs. `done` updates have not been counted yet.
pub(crate) fn set_fields(step: &mut Step, articulated: &Articulated, number: usize, done: usize) {
    let Some(module) = module(articulated) else { return };
    let (config, parts) = (module.config(), module.parts());
    step.flags |= WEIGHTED;
    let pulled = number > articulated.config().centre_after && config.centre_weight > 0.0;
    for (set, flag) in [(config.is_hard(number), HARD), (config.gumbel, GUMBEL), (pulled, CENTRE)] {
        step.flags |= if set { flag } else { 0 };
    }
    (step.origin, step.coordinate_scale) = module.normalisation();
    let noise = mixed(articulated.noise_seed(), number as u64);
    step.noise = [noise as u32, (noise >> 32) as u32];
    step.assign_corrections = module.corrections(done as u32 + 1).map(|c| c as f32);
    step.assign_rate = articulated.config().assign_rate.at(number) as f32;
    step.inverse_temperature = config.inverse_temperature(number, parts);
    step.shift_weight = config.shift_weight;
    step.scale_factor = config.scale_factor;
    step.centre_scale = (config.centre_weight / (3 * parts) as f64) as f32;
    step.learning_levels = config.active_levels(number) as u32;
    step.levels = config.grid.levels as u32;
    step.hidden = config.hidden as u32;
}

/// A different seed for every step (the finaliser of SplitMix64).
fn mixed(seed: u64, number: u64) -> u64 {
    let mut z = seed.wrapping_add(number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Shape {
    pub(crate) fn new(module: &PartAssignment) -> Self {
        Self { parts: module.parts(), hidden: module.config().hidden, entries: module.entries() }
    }

    fn levels(&self) -> usize {
        self.entries.len()
    }

    /// Number of inputs of the perceptron, and number of those, the first ones, that have a gradient.
    fn inputs(&self) -> [usize; 2] {
        let kept = 4 * self.parts + FEATURES * self.levels();
        [kept + 3, kept]
    }

    /// Offsets of b1, W2, b2 and of the end among the parameters of the perceptron.
    fn offsets(&self) -> [usize; 4] {
        let [inputs, _] = self.inputs();
        let b1 = self.hidden * inputs;
        let w2 = b1 + self.hidden;
        let b2 = w2 + 2 * self.parts * self.hidden;
        [b1, w2, b2, b2 + 2 * self.parts]
    }
}

impl Layers {
    fn new(gpu: &Gpu, shape: &Shape) -> Self {
        let [inputs, kept] = shape.inputs().map(|v| v as u32);
        let [b1, w2, b2, total] = shape.offsets().map(|v| v as u32);
        let (hidden, outputs, at) = (shape.hidden as u32, 2 * shape.parts as u32, (FRAME * shape.parts) as u32);
        let of = |label: &str, layer: Layer| constant(gpu, label, &[Layer { total, ..layer }]);
        let first = Layer {
            inputs,
            rows: hidden,
            weights: at,
            biases: at + b1,
            row_stride: inputs,
            input_stride: 1,
            flags: LAYER_BIAS | LAYER_RELU,
            total,
        };
        let second = Layer {
            inputs: hidden,
            rows: outputs,
            weights: at + w2,
            biases: at + b2,
            row_stride: hidden,
            input_stride: 1,
            flags: LAYER_BIAS,
            total,
        };
        // The backward pass uses the transposed matrices: inputs and rows are exchanged.
        let second_back =
            Layer { inputs: outputs, rows: hidden, row_stride: 1, input_stride: hidden, flags: LAYER_GATE, ..second };
        let first_back = Layer { inputs: hidden, rows: kept, row_stride: 1, input_stride: inputs, flags: 0, ..first };
        Self {
            first: of("first layer", first),
            second: of("second layer", second),
            second_back: of("second layer, back", second_back),
            first_back: of("first layer, back", first_back),
        }
    }
}

/// A uniform buffer.
pub(crate) fn constant<T: Pod>(gpu: &Gpu, label: &str, data: &[T]) -> Buffer {
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: std::mem::size_of_val(data) as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.write(&buffer, 0, data);
    buffer
}

impl LearnedMembership {
    pub(crate) fn new(gpu: &Gpu, n: usize, shape: Shape) -> Result<Self, GpuError> {
        let (parts, levels, chunks) = (shape.parts, shape.levels(), CHUNKS as usize);
        let [inputs, kept] = shape.inputs();
        let total = shape.offsets()[3];
        let entries: usize = shape.entries.iter().sum();
        let rows = |label: &str, count: usize| gpu.array(label, count * n, 4);
        let values = |label: &str| gpu.array(label, FRAME * parts + total, 4);
        Ok(Self {
            weights: rows("weights of parts", parts)?,
            blended: gpu.array("blended motions", 3 * n, 16)?,
            lengths: rows("lengths of blended motions", 1)?,
            values: values("assignment")?,
            first: values("first moments of the assignment")?,
            second: values("second moments of the assignment")?,
            levels: gpu.array("levels of the hash grid", levels, size_of::<Level>())?,
            table: gpu.array("hash grid", entries, 8)?,
            moments: gpu.array("moments of the hash grid", entries, 16)?,
            largest: gpu.array("largest gradients", levels, 4)?,
            sums: gpu.array("gradients of the hash grid", entries, 16)?,
            frames: gpu.array("frames of parts", 4 * parts, 16)?,
            inputs: rows("inputs of the perceptron", inputs)?,
            hidden: rows("hidden layer", shape.hidden)?,
            outputs: rows("outputs of the perceptron", 2 * parts)?,
            soft: rows("soft weights of parts", parts)?,
            d_inputs: rows("gradients by inputs", kept)?,
            d_hidden: rows("gradients by the hidden layer", shape.hidden)?,
            d_outputs: rows("gradients by outputs", 2 * parts)?,
            d_distances: rows("gradients by distances", parts)?,
            d_frames: gpu.array("gradients by frames, partial", FRAME_SUMS * parts * chunks, 16)?,
            d_layers: gpu.array("gradients by layers, partial", total * chunks, 4)?,
            masses: gpu.array("masses of parts, partial", parts * chunks, 16)?,
            part_means: gpu.array("means of parts and their gradients", 2 * parts, 16)?,
            layers: Layers::new(gpu, &shape),
            shape,
        })
    }

    /// Copies the module to the device.
    pub(crate) fn fill(&self, gpu: &Gpu, module: &PartAssignment) {
        let state = module.state();
        gpu.write(&self.values, 0, &state.values);
        let column = |c: usize| state.moments.iter().map(|m| m[c] as f32).collect::<Vec<f32>>();
        gpu.write(&self.first, 0, &column(0));
        gpu.write(&self.second, 0, &column(1));
        let (mut levels, mut begin) = (Vec::new(), 0);
        for grid in &state.grid {
            let moments = |(m, s): (&[f32; FEATURES], &[f32; FEATURES])| [m[0], m[1], s[0], s[1]];
            let size = grid.values.len();
            gpu.write(&self.table, begin, &grid.values);
            gpu.write(&self.moments, begin, &grid.means.iter().zip(&grid.squares).map(moments).collect::<Vec<_>>());
            let (hashed, at) = (u32::from(grid.hashed), begin as u32);
            let GridTable { scale, stride, .. } = *grid;
            let [stride_y, stride_z] = stride;
            let size_of_level = size as u32;
            levels.push(Level {
                scale,
                stride_y,
                stride_z,
                hashed,
                size: size_of_level,
                begin: at,
                ..Level::default()
            });
            begin += size;
        }
        gpu.write(&self.levels, 0, &levels);
    }

    /// Copies the module back after step `step`, except the levels of the hash grid that are not trained yet.
    pub(crate) fn fetch(&self, gpu: &Gpu, articulated: &mut Articulated, step: usize) -> Result<(), GpuError> {
        let Some(module) = module_mut(articulated) else { return Ok(()) };
        let trained = &self.shape.entries[..module.config().active_levels(step)];
        let count = FRAME * self.shape.parts + self.shape.offsets()[3];
        let entries: usize = trained.iter().sum();
        let read = gpu.read(&[
            (&self.values, count),
            (&self.first, count),
            (&self.second, count),
            (&self.table, FEATURES * entries),
            (&self.moments, 2 * FEATURES * entries),
        ])?;
        let [values, first, second, table, moments]: [&[f32]; 5] =
            std::array::from_fn(|i| bytemuck::cast_slice(&read[i]));
        let (table, moments) = (table.as_chunks::<FEATURES>().0, moments.as_chunks::<4>().0);
        let mut begin = 0;
        let grid = trained.iter().map(|&size| {
            let range = begin..begin + size;
            begin = range.end;
            let moments = &moments[range.clone()];
            GridTable {
                values: table[range].to_vec(),
                means: moments.iter().map(|m| [m[0], m[1]]).collect(),
                squares: moments.iter().map(|m| [m[2], m[3]]).collect(),
                ..GridTable::default()
            }
        });
        let moments = first.iter().zip(second).map(|(&m, &v)| [f64::from(m), f64::from(v)]).collect();
        module.set_state(&AssignState { values: values.to_vec(), moments, grid: grid.collect() });
        Ok(())
    }

    /// Computes the motions of the canonical Gaussians.
    pub(crate) fn forward(&self, gpu: &Gpu, k: &Kernels, g: &Gaussians, step_buffers: &StepBuffers) -> Program {
        let Shape { parts, hidden, .. } = self.shape;
        let layer = |shape: &Buffer, x: &Buffer, out: &Buffer, rows: usize| {
            self.layer(gpu, k, step_buffers, g.n, [shape, x, x, out], rows)
        };
        let frames = [&step_buffers.steps, &self.values, &self.frames, &self.largest];
        let encode = [&step_buffers.steps, &g.params, &self.frames, &self.levels, &self.table, &self.inputs];
        let softmax = [
            &step_buffers.steps,
            &self.inputs,
            &self.outputs,
            &step_buffers.motions,
            &self.soft,
            &self.weights,
            &self.blended,
            &self.lengths,
        ];
        vec![
            (k.make_frames.on(gpu, &frames), Size::Count(1)),
            (k.encode.on(gpu, &encode), per_gaussian(g.n, parts + self.shape.levels() + 1)),
            layer(&self.layers.first, &self.inputs, &self.hidden, hidden),
            layer(&self.layers.second, &self.hidden, &self.outputs, 2 * parts),
            (k.softmax.on(gpu, &softmax), per_gaussian(g.n, 1)),
        ]
    }

    /// A call of `linear` for a layer, its inputs, gate and outputs.
    fn layer(
        &self,
        gpu: &Gpu,
        k: &Kernels,
        step_buffers: &StepBuffers,
        n: usize,
        [shape, x, gate, out]: [&Buffer; 4],
        rows: usize,
    ) -> (crate::kernel::Call, Size) {
        let arrays = [&step_buffers.steps, shape, &self.values, x, gate, out];
        (k.linear.on(gpu, &arrays), per_gaussian(n, rows.div_ceil(LAYER_ROWS as usize)))
    }

    /// Computes the gradients of the parameters from those with respect to the motions of all Gaussians.
    pub(crate) fn backward(&self, gpu: &Gpu, k: &Kernels, g: &Gaussians, step_buffers: &StepBuffers) -> Program {
        let Shape { parts, hidden, .. } = self.shape;
        let ([inputs, kept], levels) = (self.shape.inputs(), self.shape.levels() as u32);
        let centre = [
            &step_buffers.steps,
            &g.params,
            &self.weights,
            &self.values,
            &self.masses,
            &self.part_means,
            &step_buffers.part_terms,
        ];
        let softmax = [
            &step_buffers.steps,
            &g.params,
            &step_buffers.motions,
            &self.lengths,
            &self.part_means,
            &self.soft,
            &self.inputs,
            &self.outputs,
            &g.d_motions,
            &self.d_outputs,
            &self.d_distances,
        ];
        let products = |shape: &Buffer, d: &Buffer, x: &Buffer, inputs: usize, rows: usize| {
            let groups = [CHUNKS, (inputs as u32 + 1).div_ceil(PRODUCT_SIDE), (rows as u32).div_ceil(PRODUCT_SIDE)];
            (k.products.on(gpu, &[&step_buffers.steps, shape, d, x, &self.d_layers]), Size::Grid(groups))
        };
        let frames = [
            &step_buffers.steps,
            &g.params,
            &self.frames,
            &self.inputs,
            &self.d_inputs,
            &self.d_distances,
            &self.d_frames,
        ];
        let scatter = [&step_buffers.steps, &self.levels, &self.inputs, &self.d_inputs, &self.largest, &self.sums];
        let Layers { first, second, second_back, first_back } = &self.layers;
        let through_second = [second_back, &self.d_outputs, &self.hidden, &self.d_hidden];
        let through_first = [first_back, &self.d_hidden, &self.d_hidden, &self.d_inputs];
        vec![
            (k.sum_masses.on(gpu, &centre), Size::Grid([CHUNKS, parts as u32, 1])),
            (k.pull_centres.on(gpu, &centre), Size::Count(1)),
            (k.softmax_back.on(gpu, &softmax), per_gaussian(g.n, 1)),
            self.layer(gpu, k, step_buffers, g.n, through_second, hidden),
            self.layer(gpu, k, step_buffers, g.n, through_first, kept),
            products(second, &self.d_outputs, &self.hidden, hidden, 2 * parts),
            products(first, &self.d_hidden, &self.inputs, inputs, hidden),
            (k.sum_frames.on(gpu, &frames), Size::Grid([CHUNKS, parts as u32, 1])),
            (k.find_largest.on(gpu, &scatter), Size::Grid([CHUNKS, levels, 1])),
            (k.scatter_gradients.on(gpu, &scatter), per_gaussian(g.n, self.shape.levels())),
        ]
    }

    /// Updates the parameters.
    pub(crate) fn update(&self, gpu: &Gpu, k: &Kernels, step_buffers: &StepBuffers) -> Program {
        let threads = self.shape.parts + self.shape.offsets()[3];
        let most = self.shape.entries.iter().copied().max().unwrap_or(0);
        let assignment = [
            &step_buffers.steps,
            &step_buffers.control,
            &self.d_frames,
            &self.d_layers,
            &self.part_means,
            &self.values,
            &self.first,
            &self.second,
        ];
        let grid = [
            &step_buffers.steps,
            &step_buffers.control,
            &self.levels,
            &self.largest,
            &self.sums,
            &self.table,
            &self.moments,
        ];
        let groups = [most.div_ceil(WIDE_GROUP as usize).min(4096) as u32, self.shape.levels() as u32, 1];
        vec![
            (
                k.update_assignment.on(gpu, &assignment),
                Size::Grid([threads.div_ceil(PART_GROUP as usize) as u32, 1, 1]),
            ),
            (k.update_grid.on(gpu, &grid), Size::Grid(groups)),
        ]
    }
}

/// `times` rows of one thread per Gaussian.
fn per_gaussian(n: usize, times: usize) -> Size {
    Size::Grid([n.div_ceil(GROUP as usize) as u32, times as u32, 1])
}
