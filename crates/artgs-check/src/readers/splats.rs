//! Gaussians of links, read by `artgs-io`, because no other reader is available.

use crate::model::Model;
use crate::report::FormatFinding;
use artgs_core::Splats;
use std::path::Path;

/// Reads a 3DGS PLY.
pub(super) fn read_ply(path: &Path, finding: &mut FormatFinding) -> Result<Option<Model>, String> {
    let (splats, _) = artgs_io::read_splat_ply(path).map_err(|e| e.to_string())?;
    check(&splats, finding);
    Ok(None)
}

/// Reads an SPZ, which must have as many Gaussians as the PLY of the same link.
pub(super) fn read_spz(path: &Path, finding: &mut FormatFinding) -> Result<Option<Model>, String> {
    let splats = artgs_io::asset::spz::read_spz(path).map_err(|e| e.to_string())?;
    check(&splats, finding);
    match artgs_io::read_splat_ply(&path.with_extension("ply")) {
        Ok((twin, _)) if twin.len() != splats.len() => {
            finding.problems.push(format!("{} Gaussians, but the PLY has {}", splats.len(), twin.len()));
        }
        _ => {}
    }
    Ok(None)
}

fn check(splats: &Splats, finding: &mut FormatFinding) {
    finding.splats = splats.len();
    let triples = splats.means.iter().chain(&splats.log_scales).flatten();
    let rest = splats.rotations.iter().flatten().chain(&splats.logit_opacities).chain(&splats.sh);
    if triples.chain(rest).any(|v| !v.is_finite()) {
        finding.problems.push("a Gaussian has a number that is not finite".into());
    }
    if splats.is_empty() {
        finding.problems.push("there are no Gaussians in it".into());
    }
}
