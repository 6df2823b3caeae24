//! How meshes are made consistent with the motions, and closed.

/// Settings of surfaces that contradict a motion. Lengths are voxels unless stated otherwise; angles are given by their cosines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassageSettings {
    /// Tested positions on the way of a part, at least and at most; between, one per voxel. Raising them is slower and misses less.
    pub stops: [f64; 2],
    /// Share of the box of a part on each side in which its carrier may be: measured surfaces overlap a little where parts touch.
    pub shrink: f64,
    /// Uncertainty of surfaces: depth inside a part, and distance in front of it, at which a surface can be that of the part. Raising it removes
    /// fewer copies of parts.
    pub noise: f64,
    /// Depth inside a part from which on a surface of its carrier contradicts the motion. Raising it removes less.
    pub inside: f64,
    /// Least cosine between normals of the same surface, seen in both states: a wall beside the part faces the other way.
    pub same: f64,
    /// Distances in front of a side of a part and behind it within which a surface that faces the same way cannot be. Raising them removes more
    /// of carriers.
    pub covered: [f64; 2],
    /// Least cosine between their normals.
    pub alike: f64,
    /// Distance beside a side at most: the carrier may be flush with the part.
    pub rim: f64,
    /// Farthest surface of a part that shows a point to be inside it.
    pub farthest: f64,
    /// Least cosine between the way to that surface and its normal: at rims the other side is not known.
    pub straight: f64,
    /// Rings of triangles about those that contradict the motion that go as well where the box of a sliding part moves: about four
    /// voxels of the same surface.
    pub rings: usize,
    /// Distance to a part within which a surface that a state shows may be that of the part. Raising it removes more of carriers.
    pub beside: f64,
    /// Views of a state that show a surface which stays although it contradicts the motion, at least, and of both states that look through a place
    /// where nothing is invented. Raising it removes more of carriers and invents more.
    pub shown: usize,
    /// Straight pieces of a part's way at most.
    pub chords: usize,
    /// Least cosine between such a piece and the normal of a surface that it pierces.
    pub pierced: f64,
    /// Way on either side of a pierced surface. Raising it removes less of parts.
    pub clear: f64,
}

impl PassageSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        stops: [8.0, 64.0],
        shrink: 0.03,
        noise: 0.5,
        inside: 1.0,
        same: 0.5,
        covered: [0.5, 0.75],
        alike: 0.8,
        rim: 0.1,
        farthest: 10.0,
        straight: 0.7,
        rings: 6,
        beside: 3.0,
        shown: 2,
        chords: 24,
        pierced: 0.5,
        clear: 2.0,
    };
}

impl Default for PassageSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of closing meshes. Lengths are multiples of the mean edge of the fused mesh unless stated otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RepairSettings {
    /// Edge of the cells in which vertices become one.
    pub weld: f64,
    /// Components with less than this share of the largest one's area are dropped. Raising it drops more.
    pub island: f64,
    /// Holes not wider than this are always capped: they are gaps between parts, level with their surroundings. Raising it closes wider gaps.
    pub small_hole: f64,
    /// Width of strips that are always capped, of a small hole.
    pub strip: f64,
    /// Distance of a rim from its plane, root mean square and as a share of its width, up to which a cap is one piece. Raising it makes caps flat
    /// that should follow the rim.
    pub planarity: f64,
    /// Distance of a corner from the plane at most, in multiples of that.
    pub corner: f64,
    /// Share of a piece of a cap through which other parts move at most, or that passes through the surface on either side. Raising it keeps more
    /// caps.
    pub obstructed: f64,
    /// Points along a cap at which that is tested.
    pub tested: f64,
    /// Share of a triangle of such a cap that does not hide the surface, from which on it stays.
    pub hidden: f64,
    /// Motion of a vertex of a rim by smoothing at most.
    pub rim_smoothing: f64,
    /// Rounds of smoothing of rims, ...
    pub rim_rounds: usize,
    /// ... of more corners than this.
    pub rim_corners: usize,
    /// Distance from a cap at which its sides are looked at, of `rim_smoothing`: less than the thickness of walls.
    pub noise: f64,
    /// Least length of the rim on each side of a chord that divides a cap, a share of the rim.
    pub chord_way: f64,
    /// Corners of a rim that are tried for chords, about.
    pub chord_ends: usize,
    /// Chords that are tried, the best ones.
    pub chords: usize,
    /// Share of a chord at each end that may touch the surface.
    pub chord_end: f64,
    /// Volume that caps enclose at least, of the area of their component times `thickness`: half of a wall, which has two sides. Raising it makes
    /// more components shells.
    pub sheet: f64,
    /// Thickness of shells.
    pub thickness: f64,
    /// Longest edge of a component that becomes a shell, in thicknesses.
    pub shell_edge: f64,
    /// Largest thickness of a wall relative to the distance to the surface behind it: two opposite walls do not touch.
    pub share: f64,
    /// Places on the way through a wall at which obstacles are looked for.
    pub steps: f64,
    /// Least thickness of a wall, a share of `thickness`: without it, simplification turns the solid inside out.
    pub least: f64,
    /// Factor of the depth where an obstacle is at the end of a wall.
    pub shrink: f64,
    /// Rounds of smoothing of the normals of shells: inner sides of rough surfaces intersect themselves less.
    pub even: usize,
    /// Rounds in which the depth is halved where the inner side cuts through the outer one.
    pub cuts: usize,
    /// Largest ratio of the depths of neighbours: a single ray through a gap would otherwise make a spike.
    pub spike: f64,
    /// Rounds in which that is enforced.
    pub spikes: usize,
}

impl RepairSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        weld: 1e-3,
        island: 0.003,
        small_hole: 25.0,
        strip: 0.25,
        planarity: 0.025,
        corner: 2.5,
        obstructed: 0.05,
        tested: 40.0,
        hidden: 0.5,
        rim_smoothing: 1.5,
        rim_rounds: 10,
        rim_corners: 8,
        noise: 0.5,
        chord_way: 0.05,
        chord_ends: 500,
        chords: 200,
        chord_end: 0.03,
        sheet: 0.25,
        thickness: 4.0,
        shell_edge: 3.0,
        share: 0.33,
        steps: 16.0,
        least: 0.1,
        shrink: 0.7,
        even: 4,
        cuts: 4,
        spike: 1.5,
        spikes: 2,
    };
}

impl Default for RepairSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
