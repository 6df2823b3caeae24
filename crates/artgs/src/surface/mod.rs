//! Depth maps to meshes: sparse TSDF fusion, marching cubes, cleaning, vertex colours, and the meshes of every part.

pub(crate) mod clean;
mod evidence;
pub(crate) mod marching_cubes;
pub(crate) mod paint;
pub(crate) mod part_meshes;
pub(crate) mod tsdf;
pub(crate) mod view;

pub use clean::clean;
pub use marching_cubes::marching_cubes;
pub use paint::paint;
pub use part_meshes::{
    PartMeshes, SurfaceConfig, SurfaceError, Surfaces, WholeMesh, fuse, part_meshes, part_meshes_with_progress,
};
pub use tsdf::{Tsdf, TsdfParams};
pub use view::{BACKGROUND, FusionView, Selection};

#[cfg(test)]
pub(crate) mod testing;
