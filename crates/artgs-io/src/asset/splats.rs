//! The Gaussians of an asset, one file per link in the link frame, for simulators and viewers.
//!
//! Limitations: the files do not contain the kinematic tree (URDF and others do). Viewers of a single file assume y up or
//! down, but link frames have z up. SPZ is lossy, see [`super::spz`].
//!
//! The PLY has the numbers of the link frame. The SPZ has them half a turn about x away, as every converter of the two formats
//! expects.

use super::spz::{SpzVersion, write_spz};
use crate::{FileError, write_splat_ply};
use artgs_core::Asset;
use std::path::{Path, PathBuf};

/// Writes `LINK.ply` (3DGS) and `LINK.spz` into `dir` for every link that has Gaussians, in its link frame, metres.
/// Returns the files in the order of the links.
pub fn export_splats(dir: &Path, asset: &Asset, spz_version: SpzVersion) -> Result<Vec<PathBuf>, FileError> {
    let mut files = Vec::new();
    for link in &asset.links {
        let Some(splats) = link.splats.as_ref().filter(|s| !s.is_empty()) else { continue };
        let [ply, spz] = ["ply", "spz"].map(|extension| dir.join(format!("{}.{extension}", link.name)));
        write_splat_ply(&ply, splats, None, &format!("link {} of {}, z up, metres", link.name, asset.name))?;
        write_spz(&spz, splats, spz_version)?;
        files.extend([ply, spz]);
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::spz::read_spz;
    use crate::asset::testing::cabinet;
    use crate::read_splat_ply;

    #[test]
    fn a_pair_of_files_for_every_link_with_gaussians() {
        let dir = tempfile::tempdir().unwrap();
        let mut asset = cabinet();
        asset.links[2].splats = None;
        let files = export_splats(dir.path(), &asset, SpzVersion::V4).unwrap();
        let names: Vec<_> = files.iter().map(|f| f.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["base.ply", "base.spz", "part_1.ply", "part_1.spz"]);
        let splats = asset.links[1].splats.clone().unwrap();
        assert_eq!(read_splat_ply(&files[2]).unwrap(), (splats.clone(), None));
        let small = read_spz(&files[3]).unwrap();
        assert_eq!(small.len(), 2);
        assert!((small.means[1][0] - splats.means[1][0]).abs() < 1e-6);
    }
}
