//! Mesh files of an asset for URDF, MJCF, SDF and the PartNet folder.

use super::obj::{write_hull_obj, write_textured_obj};
use crate::FileError;
use artgs_core::{Asset, TexturedMesh};
use std::path::{Path, PathBuf};

/// File names of a link, without folder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct LinkFiles {
    /// Visual mesh; none if it is empty.
    pub(super) visual: Option<String>,
    /// Texture of the visual mesh.
    pub(super) texture: Option<String>,
    /// Convex pieces.
    pub(super) collision: Vec<String>,
}

/// Writes `LINK_visual.obj` with its MTL and PNG and `LINK_collision_K.obj` of every link into a folder, and lists the
/// files. Names cannot clash: they end in a word or in a number.
pub(super) fn write_link_meshes(folder: &Path, asset: &Asset) -> Result<(Vec<LinkFiles>, Vec<PathBuf>), FileError> {
    let (mut links, mut written) = (Vec::new(), Vec::new());
    for link in &asset.links {
        let mut files = LinkFiles::default();
        if !link.visual.mesh.is_empty() {
            let stem = format!("{}_visual", link.name);
            written.extend(write_textured_obj(folder, &stem, &link.visual)?);
            files.texture = link.visual.texture.as_ref().map(|_| format!("{stem}.png"));
            files.visual = Some(format!("{stem}.obj"));
        }
        for (i, hull) in link.collision.iter().enumerate() {
            let file = format!("{}_collision_{i}.obj", link.name);
            write_hull_obj(&folder.join(&file), hull)?;
            written.push(folder.join(&file));
            files.collision.push(file);
        }
        links.push(files);
    }
    Ok((links, written))
}

/// Mean colour of the vertices, sRGB in [0, 1]; grey without colours. For formats without vertex colours.
pub(super) fn mean_color(mesh: &TexturedMesh) -> [f64; 3] {
    let colors = &mesh.mesh.colors;
    if colors.is_empty() {
        return [0.7; 3];
    }
    let sum = colors.iter().fold([0_u64; 3], |s, c| [0, 1, 2].map(|a| s[a] + u64::from(c[a])));
    // Rounded, so that texts stay readable.
    sum.map(|s| (s as f64 / (colors.len() as f64 * 255.0) * 1e4).round() / 1e4)
}
