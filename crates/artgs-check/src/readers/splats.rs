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

/// Reads an SPZ, which must have the Gaussians of the PLY of the same link where the PLY has them.
pub(super) fn read_spz(path: &Path, finding: &mut FormatFinding) -> Result<Option<Model>, String> {
    let splats = artgs_io::asset::spz::read_spz(path).map_err(|e| e.to_string())?;
    check(&splats, finding);
    match artgs_io::read_splat_ply(&path.with_extension("ply")) {
        Ok((twin, _)) if twin.len() != splats.len() => {
            finding.problems.push(format!("{} Gaussians, but the PLY has {}", splats.len(), twin.len()));
        }
        Ok((twin, _)) => {
            let apart = furthest(&splats, &twin);
            // The coarsest step of a position: objects of 8 km and more have steps of 1 mm and more.
            let size = twin.means.as_flattened().iter().fold(1f32, |m, v| m.max(v.abs()));
            if apart > 1e-6 * size {
                let text = format!("a Gaussian is {:.1} mm from where the PLY has it", 1e3 * apart);
                finding.problems.push(text);
            }
        }
        Err(_) => {}
    }
    Ok(None)
}

/// Largest difference of a coordinate, metres.
fn furthest(a: &Splats, b: &Splats) -> f32 {
    let pairs = a.means.as_flattened().iter().zip(b.means.as_flattened());
    pairs.fold(0f32, |most, (a, b)| most.max((a - b).abs()))
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
