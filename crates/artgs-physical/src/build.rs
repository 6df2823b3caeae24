//! Builds an asset from a replica.

use crate::assemble::{Decisions, assemble};
use crate::collision::decompose::Decomposer;
use crate::looks::{PartSurface, surfaces};
use crate::settings::PhysicalConfig;
use crate::step::ExportStep;
use artgs_core::{Asset, Capture, Mesh, Replica, Rigid, Splats};

/// Parts of a replica folder.
#[derive(Clone, Debug)]
pub(crate) struct Parts<'a> {
    /// A valid replica.
    pub replica: &'a Replica,
    /// Mesh of every part, world frame, start state.
    pub meshes: &'a [Mesh],
    /// Gaussians of every part in the canonical frame, midway between the states; none if there are none.
    pub splats: Option<&'a [Splats]>,
}

/// An asset with the decisions and surfaces behind it.
#[derive(Clone, Debug)]
pub(crate) struct BuiltAsset {
    /// The asset to export.
    pub asset: Asset,
    /// Limits, zero poses, clearances.
    pub decisions: Decisions,
    /// Surfaces of the parts before the motion into link frames.
    pub surfaces: Vec<PartSurface>,
}

/// Builds an asset. With a capture, textures are baked from its training views. Convex pieces come from [`crate::collision::decompose`], or from
/// `decomposer` if given; an error is that of the decomposer. `begins` gets the steps.
pub(crate) fn build(
    name: &str,
    parts: &Parts,
    capture: Option<&Capture>,
    config: &PhysicalConfig,
    decomposer: Option<&Decomposer>,
    begins: &mut dyn FnMut(ExportStep),
) -> Result<BuiltAsset, String> {
    begins(ExportStep::Surfaces);
    let surfaces = surfaces(parts.replica, parts.meshes, capture, config);
    let (mut asset, decisions) = assemble(name, parts.replica, &surfaces, config, decomposer, begins)?;
    if let Some(splats) = parts.splats {
        for (part, (link, splats)) in asset.links.iter_mut().zip(splats).enumerate() {
            let to_start = from_canonical(parts.replica, part);
            let to_start = Rigid { translation: to_start.translation * config.scale, ..to_start };
            let moved = artgs_raster::moved(splats, &(decisions.to_link[part] * to_start), config.scale);
            link.splats = (!moved.is_empty()).then_some(moved);
        }
    }
    Ok(BuiltAsset { asset, decisions, surfaces })
}

/// From the canonical frame, midway between the states, to the start state.
fn from_canonical(replica: &Replica, part: usize) -> Rigid {
    replica.world_motion(part).power(0.5).inverse()
}
