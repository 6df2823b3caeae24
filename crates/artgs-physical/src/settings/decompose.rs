//! How a surface is covered by convex pieces.

/// Settings of convex decomposition. Lengths are multiples of the tolerance, within which pieces follow the surface, unless stated otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecomposeSettings {
    /// What is a floor, on which things can lie?
    pub floor: FloorSettings,
    /// Which regions are flat, and which of them need pieces?
    pub regions: RegionSettings,
    /// Which prisms cover flat regions?
    pub sheets: SheetSettings,
    /// Which pieces cover the rest?
    pub rest: RestSettings,
    /// Which pieces are joined or left out?
    pub union: UnionSettings,
}

impl DecomposeSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        floor: FloorSettings::DEFAULT,
        regions: RegionSettings::DEFAULT,
        sheets: SheetSettings::DEFAULT,
        rest: RestSettings::DEFAULT,
        union: UnionSettings::DEFAULT,
    };
}

impl Default for DecomposeSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of floors, which have pieces also where they were not observed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorSettings {
    /// Cosine of the largest angle between the normal and +Z. Raising it takes fewer slopes for floors.
    pub level: f64,
    /// Free height above a floor, a share of the size of its part. Raising it leaves low compartments without floors.
    pub room: f64,
}

impl FloorSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self { level: 0.95, room: 0.05 };
}

impl Default for FloorSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of flat regions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionSettings {
    /// Largest distance of the corners of a region from its plane. Raising it makes regions larger and prisms less exact.
    pub flat: f64,
    /// Side of a square as large as the smallest region. Raising it leaves more to the rest.
    pub least: f64,
    /// Rounds in which a region grows and its plane is fitted: the plane of one triangle is not that of the region.
    pub rounds: usize,
    /// Cosine of the largest angle of a triangle against the plane: small triangles are noisy. Raising it ends regions at noise.
    pub agrees: f64,
    /// Share of a region that must be seen so that it counts as observed. Raising it leaves more regions without pieces.
    pub seen: f64,
    /// Side of a square as large as the smallest region that has pieces though it was not observed: caps of bodies that stand on a floor or at
    /// a wall. Raising it leaves more of them without pieces.
    pub large: f64,
    /// Directions across which the rest is cut, at most.
    pub axes: usize,
    /// Regions whose normals can be such directions, the largest ones.
    pub sources: usize,
    /// Largest cosine between two such directions. Raising it cuts along directions that differ less.
    pub distinct: f64,
}

impl RegionSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        flat: 0.8,
        least: 3.0,
        rounds: 3,
        agrees: 0.8,
        seen: 0.2,
        large: 30.0,
        axes: 6,
        sources: 20,
        distinct: 0.94,
    };
}

impl Default for RegionSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of prisms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetSettings {
    /// Edge of the cells of a region. Raising it makes rims coarser.
    pub cell: f64,
    /// Cells per side at most.
    pub cells: f64,
    /// Distance of earlier pieces within which a cell needs no prism. Raising it makes fewer prisms.
    pub covered: f64,
    /// Distance from a rim within which prisms follow it. Raising it makes fewer prisms.
    pub slack: f64,
    /// Largest distance of a polygon from the cells that it covers, in slacks.
    pub most_slack: usize,
    /// Share of the cells of a polygon that may be beyond the slack. Raising it makes fewer prisms that reach into notches.
    pub beyond: f64,
    /// Corners of a polygon at most.
    pub corners: usize,
    /// Least share of a component that a rectangle has to cover; below it the component is split. Raising it splits more.
    pub worth: f64,
    /// Depth inside the solid from which on a prism may reach beyond its region.
    pub inside: f64,
    /// Places per side of the box around a polygon at which its thickness is measured.
    pub places: usize,
    /// Share of thin places in which a prism may stick out. Raising it makes prisms thicker.
    pub thin: f64,
    /// Thickness of a sheet, in skins, up to which a prism fills it. Raising it fills thicker panels.
    pub sheet: f64,
    /// Distance from the region at which the surface is looked for.
    pub near: f64,
}

impl SheetSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        cell: 0.4,
        cells: 512.0,
        covered: 0.8,
        slack: 0.8,
        most_slack: 2,
        beyond: 0.015,
        corners: 24,
        worth: 0.2,
        inside: 0.2,
        places: 12,
        thin: 0.1,
        sheet: 2.5,
        near: 0.5,
    };
}

impl Default for SheetSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of pieces for what is not flat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestSettings {
    /// Distance of the samples of the surface. Raising it makes all faster and misses narrow shapes.
    pub spacing: f64,
    /// Samples that are grouped and split at most: hulls of many points are slow.
    pub open: usize,
    /// Distance of pieces beside which the surface is covered: samples are apart. Raising it makes fewer pieces and wider gaps.
    pub covered: f64,
    /// The same for what cuts left open: a gap is as wide as what pieces leave, and twice this. Where another link passes, pieces are behind the
    /// surface.
    pub patched: f64,
    /// Area of a group that has no piece, in squares of the distance within which it is covered: specks have a piece beside them.
    pub speck: f64,
    /// Edge of the cells whose neighbours are one group, also in distances of samples where these are farther apart.
    pub group: f64,
    /// Cuts behind each other at most.
    pub deepest: usize,
    /// A cut that leaves a larger share of the volume, such as one across a straight strip, brings the pieces no nearer to the surface.
    pub useful: f64,
    /// Places along each axis at which a cut is tried.
    pub places: usize,
    /// Points that are used to choose a cut.
    pub points: usize,
    /// Weight of the difference in size of the halves. Raising it makes them more alike.
    pub balance: f64,
    /// Largest share of the points in one half: thin strips are not cut along their length again and again.
    pub largest: f64,
    /// Overlap of the halves, in distances of samples, so that no gap is between them.
    pub overlap: f64,
    /// Extent below which nothing is cut along an axis.
    pub shortest: f64,
}

impl RestSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        spacing: 0.5,
        open: 40_000,
        covered: 0.9,
        patched: 0.5,
        speck: 5.0,
        group: 2.5,
        deepest: 12,
        useful: 0.97,
        places: 7,
        points: 1200,
        balance: 0.05,
        largest: 0.95,
        overlap: 1.2,
        shortest: 2.0,
    };
}

impl Default for RestSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of which pieces are joined or left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnionSettings {
    /// Samples of the whole surface at most, here and for the rest.
    pub surface: f64,
    /// Weight of a sample that was observed; others have 1. What was not observed may be so many times as large to be left out.
    pub observed: usize,
    /// Observed samples that need no piece.
    pub few: usize,
    /// Side of a square that may be left out while there are too many pieces, before pieces are joined for that reason. Raising it loses more of
    /// the surface and joins fewer pieces.
    pub speck: f64,
    /// Distance from the surface of a piece that cannot be split or made thinner: one that protrudes farther fills a cavity.
    pub far: f64,
    /// Samples of a hull that are tested first.
    pub samples: usize,
    /// Distance of the samples of a hull.
    pub spacing: f64,
    /// Samples of a hull at most.
    pub most_samples: f64,
    /// Distance of the boxes of pieces that may be joined, on each side.
    pub neighbours: f64,
    /// What sticks out of the solid by more than this counts `deeply` times more.
    pub deep: f64,
    /// See `deep`.
    pub deeply: f64,
    /// What the side of a cube as large as a join counts, against how far it sticks out. Raising it joins small pieces first.
    pub size: f64,
    /// What the side of a square counts that is as large as the surface of a join outside the solid, against how far it sticks out.
    pub outside: f64,
}

impl UnionSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        surface: 250_000.0,
        observed: 4,
        few: 1,
        speck: 1.5,
        far: 2.0,
        samples: 100,
        spacing: 1.5,
        most_samples: 3000.0,
        neighbours: 2.0,
        deep: 2.0,
        deeply: 3.0,
        size: 0.05,
        outside: 0.2,
    };
}

impl Default for UnionSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
