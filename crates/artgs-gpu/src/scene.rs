//! The Gaussians on the device, and the arrays that rendering needs.

use crate::constants::{
    self, BY_BLOCK, BY_BUCKET, BY_INTERSECTION, CONTROL_WORDS, DIGIT_BITS, GROUP, TILE, WIDE_GROUP,
};
use crate::kernel::{Call, Groups};
use crate::kernels::Kernels;
use crate::shared::shared_struct;
use crate::step::{Outcome, PartTerms, Step};
use crate::{Gpu, GpuError};
use artgs::fit::{DensifyStats, Moments, SplatAdam};
use artgs_core::Splats;
use wgpu::Buffer;

/// Bits of a depth, which is the key of the sort.
const DEPTH_BITS: u32 = 32;
// Constants of the kernels as numbers of elements.
const BLOCK: usize = constants::BLOCK as usize;
const DIGITS: usize = constants::DIGITS as usize;
const TILE_PIXELS: usize = constants::TILE_PIXELS as usize;
pub(crate) const PLAIN: usize = constants::PLAIN as usize;

shared_struct! {
    /// A Gaussian on the image:
    /// `log2(alpha) = log2_opacity + xx dx^2 + xy dx dy + yy dy^2` with `dx`, `dy` from the centre to the pixel.
    pub(crate) struct Flat {
        center: [f32; 2],
        xx: f32,
        xy: f32,
        yy: f32,
        log2_opacity: f32,
        depth: f32,
        /// `4 xx yy - xy^2`, without the cancellation.
        discriminant: f32,
        rgb: [f32; 3],
        /// Half extents in pixels of the region where alpha reaches 1/255.
        half_x: f32,
        half_y: f32,
        pad_a: f32,
        pad_b: f32,
        pad_c: f32,
    }
}

shared_struct! {
    /// The bits of the keys that a pass of the sort uses.
    pub(crate) struct Digit {
        /// Lowest of the `DIGIT_BITS` bits.
        shift: u32,
        pad_a: u32,
        pad_b: u32,
        pad_c: u32,
    }
}

/// Arrays with an element per Gaussian.
#[derive(Debug)]
pub(crate) struct Gaussians {
    pub(crate) n: usize,
    pub(crate) sh_stride: usize,
    /// `[PLAIN + sh_stride][n]` floats: means, rotations, log scales, logit opacities, harmonics.
    pub(crate) params: Buffer,
    pub(crate) grads: Buffer,
    pub(crate) first: Buffer,
    pub(crate) second: Buffer,
    /// Densification statistics: sum of screen gradients, number of renderings, largest radius, unused.
    pub(crate) densify_stats: Buffer,
    pub(crate) labels: Buffer,
    pub(crate) d_motions: Buffer,
    flats: Buffer,
    keys: [Buffer; 2],
    order: [Buffer; 2],
    counts: Buffer,
    starts: Buffer,
    sums: Buffer,
    histogram: Buffer,
    length: Buffer,
}

/// Arrays with an element per intersection of a Gaussian with a tile.
#[derive(Debug)]
pub(crate) struct Intersections {
    pub(crate) capacity: usize,
    /// Number of tiles of the largest image.
    pub(crate) tiles: usize,
    tiles_of: [Buffer; 2],
    places: [Buffer; 2],
    owners: Buffer,
    list: Buffer,
    histogram: Buffer,
    bucket_tiles: Buffer,
    gathered: Buffer,
    gathered_depth: Buffer,
    cells: Buffer,
}

/// Arrays with an element per pixel or tile, for images of at most `area` pixels and `tiles` tiles.
#[derive(Debug)]
pub(crate) struct ImageBuffers {
    pub(crate) tiles: usize,
    pub(crate) frame: Buffer,
    pub(crate) frame_depth: Buffer,
    pub(crate) slopes: Buffer,
    pub(crate) d_frame: Buffer,
    pub(crate) remainders: Buffer,
    pub(crate) pixel_sums: Buffer,
    pub(crate) window_sums: Buffer,
    ranges: Buffer,
    bucket_starts: Buffer,
    tile_ends: Buffer,
}

/// Inputs and results of steps.
#[derive(Debug)]
pub(crate) struct StepBuffers {
    /// Number of parts, the static one included.
    pub(crate) parts: usize,
    /// [`Step`] of each step of a batch.
    pub(crate) steps: Buffer,
    /// Words named in `constants.rs`.
    pub(crate) control: Buffer,
    pub(crate) arguments: Buffer,
    /// [`Outcome`] of the steps of a batch.
    pub(crate) results: Buffer,
    /// Half motions at both states, `[2][K][2]` quaternions.
    pub(crate) motions: Buffer,
    /// [`PartTerms`] of the steps of a batch.
    pub(crate) part_terms: Buffer,
    digits: Vec<Buffer>,
}

impl Gaussians {
    pub(crate) fn new(gpu: &Gpu, n: usize, sh_stride: usize, motions: bool) -> Result<Self, GpuError> {
        let floats = n * (PLAIN + sh_stride);
        let flat = |label: &str| gpu.array(label, floats, 4);
        let words = |label: &str| gpu.array(label, n, 4);
        Ok(Self {
            n,
            sh_stride,
            params: flat("parameters")?,
            grads: flat("gradients")?,
            first: flat("first moments")?,
            second: flat("second moments")?,
            densify_stats: gpu.array("densification statistics", n, 16)?,
            labels: words("labels")?,
            d_motions: gpu.array("gradients by motions", if motions { 2 * n } else { 1 }, 16)?,
            flats: gpu.array("projected Gaussians", n, size_of::<Flat>())?,
            keys: [words("depths")?, words("depths, sorted")?],
            order: [words("order")?, words("order, sorted")?],
            counts: words("tiles per Gaussian")?,
            starts: words("starts")?,
            sums: gpu.array("block sums", n.div_ceil(BLOCK), 4)?,
            histogram: gpu.array("histogram of depths", DIGITS * n.div_ceil(BLOCK), 4)?,
            length: gpu.array_of("number of Gaussians", &[n as u32])?,
        })
    }
}

impl Gaussians {
    /// Copies parameters, moments and statistics to the device.
    pub(crate) fn fill(&self, gpu: &Gpu, splats: &Splats, adam: &SplatAdam, stats: &DensifyStats) {
        let kinds: [(&[f32], &Moments); 5] = [
            (splats.means.as_flattened(), &adam.means),
            (splats.rotations.as_flattened(), &adam.rotations),
            (splats.log_scales.as_flattened(), &adam.log_scales),
            (&splats.logit_opacities, &adam.logit_opacities),
            (&splats.sh, &adam.sh),
        ];
        let mut at = 0;
        for (values, moments) in kinds {
            gpu.write(&self.params, at, values);
            gpu.write(&self.first, at, &moments.first);
            gpu.write(&self.second, at, &moments.second);
            at += values.len();
        }
        let seen: Vec<[f32; 4]> =
            (0..self.n).map(|i| [stats.grad[i], stats.count[i] as f32, stats.radius[i], 0.0]).collect();
        gpu.write(&self.densify_stats, 0, &seen);
    }

    /// Copies parameters, moments and statistics back.
    pub(crate) fn fetch(
        &self,
        gpu: &Gpu,
        splats: &mut Splats,
        adam: &mut SplatAdam,
        stats: &mut DensifyStats,
    ) -> Result<(), GpuError> {
        let floats = self.n * (PLAIN + self.sh_stride);
        let arrays =
            [(&self.params, floats), (&self.first, floats), (&self.second, floats), (&self.densify_stats, 4 * self.n)];
        let read = gpu.read(&arrays)?;
        let [params, first, second, seen]: [&[f32]; 4] = std::array::from_fn(|i| bytemuck::cast_slice(&read[i]));
        let kinds: [(&mut [f32], &mut Moments); 5] = [
            (splats.means.as_flattened_mut(), &mut adam.means),
            (splats.rotations.as_flattened_mut(), &mut adam.rotations),
            (splats.log_scales.as_flattened_mut(), &mut adam.log_scales),
            (&mut splats.logit_opacities, &mut adam.logit_opacities),
            (&mut splats.sh, &mut adam.sh),
        ];
        let mut at = 0;
        for (values, moments) in kinds {
            let range = at..at + values.len();
            at = range.end;
            values.copy_from_slice(&params[range.clone()]);
            moments.first.copy_from_slice(&first[range.clone()]);
            moments.second.copy_from_slice(&second[range]);
        }
        for (i, s) in seen.chunks_exact(4).enumerate() {
            (stats.grad[i], stats.count[i], stats.radius[i]) = (s[0], s[1] as u32, s[2]);
        }
        Ok(())
    }
}

impl Intersections {
    pub(crate) fn new(gpu: &Gpu, capacity: usize, tiles: usize, bucket: usize) -> Result<Self, GpuError> {
        let words = |label: &str| gpu.array(label, capacity, 4);
        let buckets = capacity / bucket + tiles;
        Ok(Self {
            capacity,
            tiles,
            tiles_of: [words("tiles")?, words("tiles, sorted")?],
            places: [words("places")?, words("places, sorted")?],
            owners: words("owners")?,
            list: words("lists")?,
            histogram: gpu.array("histogram of tiles", DIGITS * capacity.div_ceil(BLOCK), 4)?,
            bucket_tiles: gpu.array("tiles of buckets", buckets, 4)?,
            gathered: gpu.array("colours at buckets", buckets * TILE_PIXELS, 16)?,
            gathered_depth: gpu.array("depths at buckets", buckets * TILE_PIXELS, 4)?,
            cells: gpu.array("gradients of intersections", 3 * capacity, 16)?,
        })
    }
}

impl ImageBuffers {
    pub(crate) fn new(gpu: &Gpu, sizes: impl Iterator<Item = [usize; 2]> + Clone) -> Result<Self, GpuError> {
        let area = sizes.clone().map(|[w, h]| w * h).max().unwrap_or(1);
        let tiles = sizes.map(|[w, h]| w.div_ceil(TILE as usize) * h.div_ceil(TILE as usize)).max().unwrap_or(1);
        Ok(Self {
            tiles,
            frame: gpu.array("frame", area, 16)?,
            frame_depth: gpu.array("depth of the frame", area, 4)?,
            slopes: gpu.array("slopes of similarity", 9 * area, 4)?,
            d_frame: gpu.array("gradient of the frame", area, 16)?,
            remainders: gpu.array("remainders of pixels", area, 4)?,
            pixel_sums: gpu.array("sums over pixels", tiles, 16)?,
            window_sums: gpu.array("sums over windows", 3 * tiles, 16)?,
            // One more for unused entries, which are sorted after the last tile.
            ranges: gpu.array("lists of tiles", tiles + 1, 8)?,
            bucket_starts: gpu.array("buckets of tiles", tiles, 4)?,
            tile_ends: gpu.array("ends of tiles", tiles, 4)?,
        })
    }
}

impl StepBuffers {
    pub(crate) fn new(gpu: &Gpu, steps: usize, parts: usize) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as U;
        let uniform = |label: &str, size: u64| {
            let usage = U::UNIFORM | U::COPY_DST;
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let digit = |k: u32| {
            let buffer = uniform("digit", size_of::<Digit>() as u64);
            gpu.write(&buffer, 0, &[Digit { shift: DIGIT_BITS * k, ..Digit::default() }]);
            buffer
        };
        Ok(Self {
            parts,
            steps: uniform("steps", (steps * crate::step::STRIDE) as u64),
            control: gpu.array("control", CONTROL_WORDS as usize, 4)?,
            arguments: gpu.array("arguments", 12, 4)?,
            results: gpu.array("results", steps, size_of::<Outcome>())?,
            motions: gpu.array("motions", 4 * parts.max(1), 16)?,
            part_terms: gpu.array("terms of parts", steps, size_of::<PartTerms>())?,
            digits: (0..DEPTH_BITS / DIGIT_BITS).map(digit).collect(),
        })
    }
}

/// Calls with the numbers of workgroups they are started with.
pub(crate) type Program = Vec<(Call, Size)>;

/// Numbers of workgroups, some of which depend on the step.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Size {
    /// Always this many.
    Count(usize),
    /// One for each tile.
    Tiles,
    /// One for every `WIDE_GROUP` tiles.
    TileChunks,
    /// One for each tile of windows, and channel.
    Windows,
    /// Always this grid.
    Grid([u32; 3]),
    /// As the device wrote into this entry of `arguments`.
    Indirect(u32),
}

impl Size {
    pub(crate) fn groups(self, step: &Step) -> Groups {
        let [x, y] = step.tiles;
        let [x0, y0, x1, y1] = step.rect;
        match self {
            Self::Count(n) => Groups::Count(n as u32),
            Self::Tiles => Groups::Grid([x, y, 1]),
            Self::TileChunks => Groups::Count((x * y).div_ceil(WIDE_GROUP)),
            Self::Windows => Groups::Grid([(x1 - x0).div_ceil(TILE), (y1 - y0).div_ceil(TILE), 3]),
            Self::Grid(grid) => Groups::Grid(grid),
            Self::Indirect(at) => Groups::Indirect(at),
        }
    }
}

/// Renders the frame; `motions` are those of the parts or, if these are weighted, of the Gaussians.
pub(crate) fn forward(
    gpu: &Gpu,
    k: &Kernels,
    g: &Gaussians,
    motions: &Buffer,
    intersections: &Intersections,
    image_buffers: &ImageBuffers,
    step_buffers: &StepBuffers,
) -> Program {
    let (n, per_thread, per_block) =
        (g.n, Size::Count(g.n.div_ceil(WIDE_GROUP as usize)), Size::Count(g.n.div_ceil(BLOCK)));
    let mut out: Program = Vec::new();
    let arrays = [&step_buffers.steps, &g.params, &g.labels, motions, &g.flats, &g.keys[0], &g.order[0], &g.counts];
    out.push((k.project.on(gpu, &arrays), per_thread));
    let depth = Sort { keys: &g.keys, values: &g.order, histogram: &g.histogram, length: &g.length };
    debug_assert_eq!(DEPTH_BITS / DIGIT_BITS % 2, 0, "the sorted order ends where it began");
    depth.passes(gpu, k, step_buffers, DEPTH_BITS / DIGIT_BITS, Size::Count(n.div_ceil(BLOCK)), &mut out);
    let arrays = [
        &step_buffers.steps,
        &g.order[0],
        &g.counts,
        &g.sums,
        &g.starts,
        &step_buffers.control,
        &step_buffers.arguments,
    ];
    out.push((k.reduce_blocks.on(gpu, &arrays), per_block));
    out.push((k.scan_sums.on(gpu, &arrays), Size::Count(1)));
    out.push((k.apply.on(gpu, &arrays), per_block));
    let arrays = [
        &step_buffers.steps,
        &g.flats,
        &g.counts,
        &g.starts,
        &step_buffers.control,
        &intersections.tiles_of[0],
        &intersections.places[0],
        &intersections.owners,
        &image_buffers.ranges,
    ];
    out.push((k.emit.on(gpu, &arrays), per_thread));
    let tiles = Sort {
        keys: &intersections.tiles_of,
        values: &intersections.places,
        histogram: &intersections.histogram,
        length: &step_buffers.control,
    };
    let passes = tile_passes(image_buffers.tiles);
    tiles.passes(gpu, k, step_buffers, passes, Size::Indirect(BY_BLOCK), &mut out);
    let sorted = passes as usize % 2;
    let arrays = [
        &step_buffers.steps,
        &intersections.tiles_of[sorted],
        &intersections.places[sorted],
        &intersections.owners,
        &step_buffers.control,
        &image_buffers.ranges,
        &intersections.list,
        &image_buffers.bucket_starts,
        &intersections.bucket_tiles,
        &step_buffers.arguments,
    ];
    out.push((k.delimit.on(gpu, &arrays[..7]), Size::Indirect(BY_INTERSECTION)));
    out.push((k.count_buckets.on(gpu, &arrays), Size::Count(1)));
    out.push((k.name_buckets.on(gpu, &arrays), Size::TileChunks));
    let arrays = [
        &step_buffers.steps,
        &g.flats,
        &image_buffers.ranges,
        &intersections.list,
        &image_buffers.bucket_starts,
        &image_buffers.frame,
        &image_buffers.frame_depth,
        &intersections.gathered,
        &intersections.gathered_depth,
        &image_buffers.tile_ends,
    ];
    out.push((k.blend.on(gpu, &arrays), Size::Tiles));
    out
}

/// Computes the gradients of the parameters from that of the frame; `motions` as in [`forward`].
pub(crate) fn backward(
    gpu: &Gpu,
    k: &Kernels,
    g: &Gaussians,
    motions: &Buffer,
    intersections: &Intersections,
    image_buffers: &ImageBuffers,
    step_buffers: &StepBuffers,
) -> Program {
    let sorted = tile_passes(image_buffers.tiles) as usize % 2;
    let arrays = [
        &step_buffers.steps,
        &g.flats,
        &image_buffers.ranges,
        &intersections.list,
        &intersections.places[sorted],
        &image_buffers.bucket_starts,
        &intersections.bucket_tiles,
        &intersections.gathered,
        &intersections.gathered_depth,
        &image_buffers.d_frame,
        &image_buffers.remainders,
        &image_buffers.tile_ends,
        &step_buffers.control,
        &intersections.cells,
    ];
    let transfer = (k.blend_back.on(gpu, &arrays), Size::Indirect(BY_BUCKET));
    let arrays = [
        &step_buffers.steps,
        &g.params,
        &g.labels,
        motions,
        &g.flats,
        &g.counts,
        &g.starts,
        &intersections.cells,
        &step_buffers.control,
        &g.grads,
        &g.densify_stats,
        &g.d_motions,
    ];
    vec![transfer, (k.gather.on(gpu, &arrays), Size::Count(g.n.div_ceil(GROUP as usize)))]
}

/// Passes of the sort by tile; one tile more than the image has is for unused entries.
fn tile_passes(tiles: usize) -> u32 {
    (usize::BITS - tiles.leading_zeros()).div_ceil(DIGIT_BITS).max(1)
}

/// Arrays of a sort; passes alternate between the two arrays of each pair.
struct Sort<'a> {
    keys: &'a [Buffer; 2],
    values: &'a [Buffer; 2],
    histogram: &'a Buffer,
    /// Its first word is the number of pairs.
    length: &'a Buffer,
}

impl Sort<'_> {
    fn passes(&self, gpu: &Gpu, k: &Kernels, step_buffers: &StepBuffers, passes: u32, blocks: Size, out: &mut Program) {
        for pass in 0..passes as usize {
            let (from, to) = (pass % 2, 1 - pass % 2);
            let arrays = [
                &step_buffers.digits[pass],
                self.length,
                &self.keys[from],
                &self.values[from],
                &self.keys[to],
                &self.values[to],
                self.histogram,
            ];
            out.push((k.count.on(gpu, &arrays), blocks));
            out.push((k.scan_digits.on(gpu, &arrays), Size::Count(1)));
            out.push((k.scatter.on(gpu, &arrays), blocks));
        }
    }
}
