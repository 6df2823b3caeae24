//! What is drawn: closed meshes, textures, evidence.

use super::{BakeSettings, PassageSettings, RepairSettings};

/// Settings of what is drawn. Lengths are multiples of the edge of a voxel of the fused mesh unless stated otherwise; angles are given by their
/// cosines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LookSettings {
    /// Edge length of a voxel relative to the mean edge of meshes of marching cubes.
    pub voxel_per_edge: f64,
    /// Longest mean edge of such a mesh, as a share of the object's diagonal. A mesh of longer edges is not one of voxels: its corners are
    /// exact and are not smoothed away, ...
    pub coarsest_share: f64,
    /// ... as if its edges were so long.
    pub exact_share: f64,
    /// Least cosine between the normals of a wall and of the seen surface at it: surfaces are noisy at edges. Raising it finds less of walls seen.
    pub alike: f64,
    /// Angle between triangles, radians, above which their edge stays sharp. Raising it makes edges rounder.
    pub crease: f64,
    /// Points of each part whose colours are compared between photos.
    pub compared: usize,
    /// What contradicts the motions?
    pub passage: PassageSettings,
    /// How are meshes closed?
    pub repair: RepairSettings,
    /// How few triangles has a mesh?
    pub simplify: SimplifySettings,
    /// How large are textures?
    pub atlas: AtlasSettings,
    /// Which colours do textures have?
    pub bake: BakeSettings,
    /// Which sides were not recorded?
    pub sides: SideSettings,
}

impl LookSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        voxel_per_edge: 1.4,
        coarsest_share: 0.03,
        exact_share: 5e-3,
        alike: 0.3,
        crease: 40.0 * std::f64::consts::PI / 180.0,
        compared: 2000,
        passage: PassageSettings::DEFAULT,
        repair: RepairSettings::DEFAULT,
        simplify: SimplifySettings::DEFAULT,
        atlas: AtlasSettings::DEFAULT,
        bake: BakeSettings::DEFAULT,
        sides: SideSettings::DEFAULT,
    };
}

impl Default for LookSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of simplification.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimplifySettings {
    /// Rounds of smoothing before. Raising it rounds corners.
    pub rounds: usize,
    /// Motion of a vertex by smoothing at most.
    pub reach: f64,
    /// One in so many of the triangles asked for is enough where it keeps the surface within `exact`. Raising it gives flat panels fewer triangles.
    pub flat: usize,
    /// Distance from the surface within which few triangles are enough. Raising it makes meshes smaller and coarser.
    pub exact: f64,
    /// Distance from the surface with as many triangles as asked for.
    pub most: f64,
    /// Samples of each surface for measuring the distance, half of them vertices.
    pub samples: usize,
    /// Attempts with smaller bounds: the library limits only an estimate of the distance.
    pub attempts: usize,
    /// Bound of the next attempt, as a share of what would be enough; also its largest share of the bound before.
    pub tighter: f64,
}

impl SimplifySettings {
    /// The settings that are used.
    pub const DEFAULT: Self =
        Self { rounds: 6, reach: 0.5, flat: 4, exact: 0.25, most: 1.0, samples: 60_000, attempts: 3, tighter: 0.5 };
}

impl Default for SimplifySettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of texture atlases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasSettings {
    /// Texels along the diagonal of a part at most, unless the edge of a texel is given. Raising it makes textures sharper and files larger.
    pub texels: f64,
    /// Largest side of a texture, texels.
    pub side: u32,
    /// Texels around every chart that get its colours, so that other colours do not show at its rim; charts are twice that apart.
    pub padding: u32,
    /// Attempts with fewer texels, if an atlas is too large.
    pub attempts: usize,
    /// Factor of the texels along a side, beyond what would fit if charts were packed as well as before.
    pub spare: f64,
}

impl AtlasSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self { texels: 900.0, side: 4096, padding: 4, attempts: 6, spare: 0.95 };
}

impl Default for AtlasSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of sides that were not recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SideSettings {
    /// Depth of what is a side, of the extent of the part.
    pub depth: f64,
    /// Least cosine between the normals of its faces and its direction.
    pub facing: f64,
    /// Share of it that is invented, above which it was not recorded. Raising it names fewer sides.
    pub invented: f64,
    /// Cameras that must look at it. Raising it names more sides.
    pub cameras: usize,
    /// Sine of the least angle between its plane and the way to such a camera: views along a surface measure nothing of it.
    pub grazing: f64,
}

impl SideSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self { depth: 0.15, facing: 0.7, invented: 0.7, cameras: 2, grazing: 0.17 };
}

impl Default for SideSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
