//! All kernels, compiled once per device.

use crate::kernel::{Kernel, Use, compiled};
use crate::{Gpu, GpuError};
use Use::{Constant, Read, Step, Write};

const COMMON: &str = include_str!("shaders/common.wgsl");
const QUATERNION: &str = include_str!("shaders/quaternion.wgsl");
const WARP: &str = include_str!("shaders/warp.wgsl");
const SH: &str = include_str!("shaders/sh.wgsl");
const SH_ADJOINT: &str = include_str!("shaders/sh_adjoint.wgsl");
const CHAIN: &str = include_str!("shaders/chain.wgsl");
const FOOTPRINT: &str = include_str!("shaders/footprint.wgsl");
const PROJECT: &str = include_str!("shaders/project.wgsl");
const SCAN: &str = include_str!("shaders/scan.wgsl");
const SORT: &str = include_str!("shaders/sort.wgsl");
const BIN: &str = include_str!("shaders/bin.wgsl");
const LIST: &str = include_str!("shaders/list.wgsl");
const BLEND: &str = include_str!("shaders/blend.wgsl");
const BLEND_BACK: &str = include_str!("shaders/blend_back.wgsl");
const GATHER: &str = include_str!("shaders/gather.wgsl");
const WINDOW: &str = include_str!("shaders/window.wgsl");
const PHOTO: &str = include_str!("shaders/photo.wgsl");
const SSIM: &str = include_str!("shaders/ssim.wgsl");
const LOSS: &str = include_str!("shaders/loss.wgsl");
const RESULTS: &str = include_str!("shaders/results.wgsl");
const SUM_MOTIONS: &str = include_str!("shaders/sum_motions.wgsl");
const JOINTS: &str = include_str!("shaders/joints.wgsl");
const ADAM: &str = include_str!("shaders/adam.wgsl");

/// Every kernel of a step.
#[derive(Debug)]
pub(crate) struct Kernels {
    pub(crate) project: Kernel,
    pub(crate) reduce_blocks: Kernel,
    pub(crate) scan_sums: Kernel,
    pub(crate) apply: Kernel,
    pub(crate) count: Kernel,
    pub(crate) scan_digits: Kernel,
    pub(crate) scatter: Kernel,
    pub(crate) emit: Kernel,
    pub(crate) delimit: Kernel,
    pub(crate) count_buckets: Kernel,
    pub(crate) name_buckets: Kernel,
    pub(crate) blend: Kernel,
    pub(crate) slope: Kernel,
    pub(crate) compare: Kernel,
    pub(crate) collect: Kernel,
    pub(crate) blend_back: Kernel,
    pub(crate) gather: Kernel,
    pub(crate) adam: Kernel,
    pub(crate) sum_motions: Kernel,
    pub(crate) update_joints: Kernel,
}

impl Kernels {
    /// Compiles all of them.
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let scan = [Step, Read, Read, Write, Write, Write, Write];
        let sort = [Constant, Read, Read, Read, Write, Write, Write];
        let list = [Step, Read, Read, Read, Write, Write, Write, Write, Write, Write];
        let blend_back = [Step, Read, Read, Read, Read, Read, Read, Read, Read, Read, Read, Read, Read, Write];
        let gather = [Step, Read, Read, Read, Read, Read, Read, Read, Read, Write, Write, Write];
        compiled(gpu, || {
            let new = |name: &'static str, sources: &[&str], uses: &[Use]| Kernel::new(gpu, name, sources, uses);
            Self {
                project: new(
                    "project",
                    &[COMMON, QUATERNION, PROJECT, WARP, SH, CHAIN, FOOTPRINT],
                    &[Step, Read, Read, Read, Write, Write, Write, Write],
                ),
                reduce_blocks: new("reduce_blocks", &[COMMON, SCAN], &scan),
                scan_sums: new("scan_sums", &[COMMON, SCAN], &scan),
                apply: new("apply", &[COMMON, SCAN], &scan),
                count: new("count", &[COMMON, SORT], &sort),
                scan_digits: new("scan_digits", &[COMMON, SORT], &sort),
                scatter: new("scatter", &[COMMON, SORT], &sort),
                emit: new(
                    "emit",
                    &[COMMON, BIN, FOOTPRINT],
                    &[Step, Read, Read, Read, Read, Write, Write, Write, Write],
                ),
                delimit: new("delimit", &[COMMON, LIST], &list[..7]),
                count_buckets: new("count_buckets", &[COMMON, LIST], &list),
                name_buckets: new("name_buckets", &[COMMON, LIST], &list),
                blend: new(
                    "blend",
                    &[COMMON, BLEND],
                    &[Step, Read, Read, Read, Read, Write, Write, Write, Write, Write],
                ),
                slope: new("slope", &[COMMON, WINDOW, PHOTO, SSIM], &[Step, Read, Read, Write, Write]),
                compare: new(
                    "compare",
                    &[COMMON, WINDOW, PHOTO, LOSS],
                    &[Step, Read, Read, Read, Read, Read, Write, Write, Write],
                ),
                collect: new("collect", &[COMMON, RESULTS], &[Step, Read, Read, Read, Read, Write]),
                blend_back: new("blend_back", &[COMMON, BLEND_BACK], &blend_back),
                gather: new("gather", &[COMMON, QUATERNION, GATHER, WARP, SH, SH_ADJOINT, CHAIN], &gather),
                sum_motions: new("sum_motions", &[COMMON, SUM_MOTIONS], &[Step, Read, Read, Write]),
                update_joints: new("update_joints", &[COMMON, QUATERNION, JOINTS], &[Step, Read, Read, Write, Write]),
                adam: new("adam", &[COMMON, ADAM], &[Step, Read, Read, Write, Write, Write]),
            }
        })
    }
}
