//! All kernels, compiled once per device.

use crate::kernel::{Kernel, Use, compiled};
use crate::{Gpu, GpuError, shared};
use Use::{Constant, Read, Step, Write};

const ARGUMENTS: &str = include_str!("shaders/arguments.wgsl");
const COMMON: &str = include_str!("shaders/common.wgsl");
const QUATERNION: &str = include_str!("shaders/quaternion.wgsl");
const WARP: &str = include_str!("shaders/warp.wgsl");
const SH: &str = include_str!("shaders/sh.wgsl");
const SH_ADJOINT: &str = include_str!("shaders/sh_adjoint.wgsl");
const CHAIN: &str = include_str!("shaders/chain.wgsl");
const FOOTPRINT: &str = include_str!("shaders/footprint.wgsl");
const PROJECT: &str = include_str!("shaders/project.wgsl");
const PREFIX: &str = include_str!("shaders/prefix.wgsl");
const SCAN: &str = include_str!("shaders/scan.wgsl");
const SORT: &str = include_str!("shaders/sort.wgsl");
const BIN: &str = include_str!("shaders/bin.wgsl");
const LIST: &str = include_str!("shaders/list.wgsl");
const BLEND: &str = include_str!("shaders/blend.wgsl");
const BLEND_BACK: &str = include_str!("shaders/blend_back.wgsl");
const BY_MEMORY: &str = include_str!("shaders/transfer_by_memory.wgsl");
const BY_SUBGROUP: &str = include_str!("shaders/transfer_by_subgroup.wgsl");
const GATHER: &str = include_str!("shaders/gather.wgsl");
const WINDOW: &str = include_str!("shaders/window.wgsl");
const IMAGE: &str = include_str!("shaders/image.wgsl");
const SSIM: &str = include_str!("shaders/ssim.wgsl");
const LOSS: &str = include_str!("shaders/loss.wgsl");
const RESULTS: &str = include_str!("shaders/results.wgsl");
const SUM_MOTIONS: &str = include_str!("shaders/sum_motions.wgsl");
const JOINTS: &str = include_str!("shaders/joints.wgsl");
const HASH_GRID: &str = include_str!("shaders/hash_grid.wgsl");
const HASH_GRID_BACK: &str = include_str!("shaders/hash_grid_back.wgsl");
const HASH_GRID_STEP: &str = include_str!("shaders/hash_grid_step.wgsl");
const MLP: &str = include_str!("shaders/mlp.wgsl");
const MLP_LAYER: &str = include_str!("shaders/mlp_layer.wgsl");
const MLP_BACK: &str = include_str!("shaders/mlp_back.wgsl");
const ENCODE: &str = include_str!("shaders/encode.wgsl");
const SOFTMAX: &str = include_str!("shaders/softmax.wgsl");
const SOFTMAX_BACK: &str = include_str!("shaders/softmax_back.wgsl");
const SUM_FRAMES: &str = include_str!("shaders/sum_frames.wgsl");
const CENTRE: &str = include_str!("shaders/centre.wgsl");
const ASSIGN: &str = include_str!("shaders/assign.wgsl");
const ASSIGN_FRAMES: &str = include_str!("shaders/assign_frames.wgsl");
const ASSIGN_STEP: &str = include_str!("shaders/assign_step.wgsl");
const CHAMFER: &str = include_str!("shaders/chamfer.wgsl");
const ADAM: &str = include_str!("shaders/adam.wgsl");

/// How pixels move from thread to thread in the backward pass of blending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PixelTransfer {
    /// Through memory of the workgroup.
    Memory,
    /// In registers, within subgroups of this size.
    Subgroup(u32),
}

impl PixelTransfer {
    /// The one that is likely to be fastest: registers, if all subgroups have a size of 32 or all of 64.
    pub(crate) fn of(gpu: &Gpu) -> Self {
        match gpu.subgroup {
            Some([least, most]) if least == most && matches!(most, 32 | 64) => Self::Subgroup(most),
            _ => Self::Memory,
        }
    }

    /// Gaussians of a tile that one workgroup of the backward pass handles.
    pub(crate) fn bucket(self) -> usize {
        match self {
            Self::Memory => 32,
            Self::Subgroup(size) => size as usize,
        }
    }
}

/// Every kernel of a step: compiled, or what [`Kernels::each`] made of it.
#[derive(Debug)]
pub(crate) struct Kernels<K = Kernel> {
    pub(crate) transfer: PixelTransfer,
    pub(crate) project: K,
    pub(crate) reduce_blocks: K,
    pub(crate) scan_sums: K,
    pub(crate) apply: K,
    pub(crate) count: K,
    pub(crate) scan_digits: K,
    pub(crate) scatter: K,
    pub(crate) emit: K,
    pub(crate) delimit: K,
    pub(crate) count_buckets: K,
    pub(crate) name_buckets: K,
    pub(crate) blend: K,
    pub(crate) slope: K,
    pub(crate) compare: K,
    pub(crate) collect: K,
    pub(crate) blend_back: K,
    pub(crate) gather: K,
    pub(crate) adam: K,
    pub(crate) sum_motions: K,
    pub(crate) update_joints: K,
    pub(crate) make_frames: K,
    pub(crate) encode: K,
    pub(crate) linear: K,
    pub(crate) softmax: K,
    pub(crate) chamfer: K,
    pub(crate) sum_chamfer: K,
    pub(crate) sum_masses: K,
    pub(crate) pull_centres: K,
    pub(crate) softmax_back: K,
    pub(crate) products: K,
    pub(crate) sum_frames: K,
    pub(crate) find_largest: K,
    pub(crate) scatter_gradients: K,
    pub(crate) update_assignment: K,
    pub(crate) update_grid: K,
}

impl Kernels {
    /// Compiles all of them.
    pub(crate) fn new(gpu: &Gpu, transfer: PixelTransfer) -> Result<Self, GpuError> {
        compiled(gpu, || Self::each(transfer, |name, source, uses| Kernel::new(gpu, name, source, uses)))
    }
}

impl<K> Kernels<K> {
    /// Calls `make` for every kernel with its entry point, its source, and the uses of binding 0, 1, ...
    pub(crate) fn each(transfer: PixelTransfer, mut make: impl FnMut(&'static str, String, &[Use]) -> K) -> Self {
        let common = [&shared::wgsl(transfer.bucket() as u32), COMMON].concat();
        let (transfer_file, lane) = match transfer {
            PixelTransfer::Memory => (BY_MEMORY, "local_invocation_index"),
            PixelTransfer::Subgroup(_) => (BY_SUBGROUP, "subgroup_invocation_id"),
        };
        let blend_back_source = BLEND_BACK.replace("LANE", lane);
        let scan = [Step, Read, Read, Write, Write, Write, Write];
        let sort = [Constant, Read, Read, Read, Write, Write, Write];
        let list = [Step, Read, Read, Read, Write, Write, Write, Write, Write, Write];
        let blend_back = [Step, Read, Read, Read, Read, Read, Read, Read, Read, Read, Read, Read, Read, Write];
        let scatter = [Step, Read, Read, Read, Write, Write];
        let centre = [Step, Read, Read, Read, Write, Write, Write];
        let chamfer = [Step, Read, Read, Read, Constant, Read, Read, Write, Write, Write];
        let softmax_back = [Step, Read, Read, Read, Read, Read, Read, Read, Write, Write, Write];
        let gather = [Step, Read, Read, Read, Read, Read, Read, Read, Read, Write, Write, Write];
        let mut new = |name: &'static str, sources: &[&str], uses: &[Use]| make(name, sources.concat(), uses);
        Self {
            transfer,
            project: new(
                "project",
                &[&common, QUATERNION, PROJECT, WARP, SH, CHAIN, FOOTPRINT],
                &[Step, Read, Read, Read, Write, Write, Write, Write],
            ),
            reduce_blocks: new("reduce_blocks", &[&common, PREFIX, ARGUMENTS, SCAN], &scan),
            scan_sums: new("scan_sums", &[&common, PREFIX, ARGUMENTS, SCAN], &scan),
            apply: new("apply", &[&common, PREFIX, ARGUMENTS, SCAN], &scan),
            count: new("count", &[&common, PREFIX, SORT], &sort),
            scan_digits: new("scan_digits", &[&common, PREFIX, SORT], &sort),
            scatter: new("scatter", &[&common, PREFIX, SORT], &sort),
            emit: new("emit", &[&common, BIN, FOOTPRINT], &[Step, Read, Write, Read, Read, Write, Write, Write, Write]),
            delimit: new("delimit", &[&common, PREFIX, ARGUMENTS, LIST], &list[..7]),
            count_buckets: new("count_buckets", &[&common, PREFIX, ARGUMENTS, LIST], &list),
            name_buckets: new("name_buckets", &[&common, PREFIX, ARGUMENTS, LIST], &list),
            blend: new("blend", &[&common, BLEND], &[Step, Read, Read, Read, Read, Write, Write, Write, Write, Write]),
            slope: new("slope", &[&common, WINDOW, IMAGE, SSIM], &[Step, Read, Read, Write, Write]),
            compare: new(
                "compare",
                &[&common, WINDOW, IMAGE, LOSS],
                &[Step, Read, Read, Read, Read, Read, Write, Write, Write],
            ),
            collect: new("collect", &[&common, RESULTS], &[Step, Read, Read, Read, Read, Write]),
            blend_back: new("blend_back", &[&common, &blend_back_source, transfer_file], &blend_back),
            gather: new("gather", &[&common, QUATERNION, GATHER, WARP, SH, SH_ADJOINT, CHAIN], &gather),
            sum_motions: new("sum_motions", &[&common, SUM_MOTIONS], &[Step, Read, Read, Read, Write]),
            update_joints: new("update_joints", &[&common, QUATERNION, JOINTS], &[Step, Read, Read, Write, Write]),
            make_frames: new("make_frames", &[&common, QUATERNION, ASSIGN, ASSIGN_FRAMES], &[Step, Read, Write, Write]),
            encode: new("encode", &[&common, ENCODE, HASH_GRID], &[Step, Read, Read, Read, Read, Write]),
            linear: new("linear", &[&common, MLP, MLP_LAYER], &[Step, Constant, Read, Read, Read, Write]),
            softmax: new("softmax", &[&common, SOFTMAX], &[Step, Read, Read, Read, Write, Write, Write, Write]),
            chamfer: new("chamfer", &[&common, QUATERNION, CHAMFER, WARP], &chamfer),
            sum_chamfer: new("sum_chamfer", &[&common, QUATERNION, CHAMFER, WARP], &chamfer),
            sum_masses: new("sum_masses", &[&common, CENTRE], &centre),
            pull_centres: new("pull_centres", &[&common, CENTRE], &centre),
            softmax_back: new("softmax_back", &[&common, SOFTMAX_BACK], &softmax_back),
            products: new("products", &[&common, MLP, MLP_BACK], &[Step, Constant, Read, Read, Write]),
            sum_frames: new("sum_frames", &[&common, SUM_FRAMES], &[Step, Read, Read, Read, Read, Read, Write]),
            find_largest: new("find_largest", &[&common, HASH_GRID, HASH_GRID_BACK], &scatter),
            scatter_gradients: new("scatter_gradients", &[&common, HASH_GRID, HASH_GRID_BACK], &scatter),
            update_assignment: new(
                "update_assignment",
                &[&common, QUATERNION, ASSIGN, ASSIGN_STEP],
                &[Step, Read, Read, Read, Read, Write, Write, Write],
            ),
            update_grid: new(
                "update_grid",
                &[&common, HASH_GRID, HASH_GRID_STEP],
                &[Step, Read, Read, Read, Write, Write, Write],
            ),
            adam: new("adam", &[&common, ADAM], &[Step, Read, Read, Write, Write, Write]),
        }
    }
}
