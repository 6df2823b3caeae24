//! What parts collide with, and how far apart they stay.

use super::DecomposeSettings;

/// Settings of collision shapes. Fields ending in `_share` are shares of the object's diagonal; others are in metres unless stated otherwise.
/// `docs/decisions/0008-collision-shapes.md` has the measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollisionSettings {
    /// Largest distance between surface and convex pieces. Raising it needs fewer pieces, with which engines are faster, and makes them coarser.
    pub cover: f64,
    /// Upper bound of `cover`, so that small objects keep their shape.
    pub cover_share: f64,
    /// Share of `cover` within which pieces follow the surface before links are cut apart; cuts use the rest. Raising it needs fewer pieces.
    pub followed: f64,
    /// Distance of the points of the surface that cuts leave covered, in multiples of `cover`. Raising it makes cuts faster and holes wider.
    pub apart: f64,
    /// Least distance between convex pieces of different links: engines put margins around them. Raising it makes contacts between links rarer
    /// and cuts deeper.
    pub gap_share: f64,
    /// Upper bound of that distance: the margins of engines do not grow with the object.
    pub most_gap: f64,
    /// Further distance between links of which neither carries the other: 1 mm around each hull in PyBullet, and 1 mm for
    /// its contacts beyond the rims of faces that pass each other.
    pub engine_margins: f64,
    /// Upper bound of `engine_margins`, so that small objects keep their shape.
    pub most_margins_share: f64,
    /// Shortfall of these distances that is ignored. Raising it makes fewer cuts.
    pub contact_share: f64,
    /// Convex pieces thinner than this are removed: engines report false contacts at slivers. Raising it loses thin parts.
    pub thinnest_share: f64,
    /// Least thickness of new pieces, in multiples of the thinnest one, so that cuts can make them thinner.
    pub least: f64,
    /// Thickness of the pieces for what cuts left open, in multiples of the least one. Raising it lets them reach deeper into the part.
    pub patch: f64,
    /// Corners of a convex piece: MuJoCo and PhysX refuse more.
    pub corners: usize,
    /// Corners that stand out by less than this share of `cover` are left out. Raising it makes engines faster and pieces smaller.
    pub rounding: f64,
    /// Share of `cover` within which lies what a piece must cover alone to stay: pieces lose corners later. Raising it removes more pieces.
    pub lean: f64,
    /// Pieces shorter than this and smaller than a cube of `crumb_side`, in multiples of `cover`, are removed: engines report contacts of
    /// such pieces that are up to 2 cm deep where there is a gap of 6 mm (PhysX with a tetrahedron of 21 x 9 x 4 mm).
    pub crumb_length: f64,
    /// See `crumb_length`.
    pub crumb_side: f64,
    /// Rounds in which what still penetrates is cut: cuts make new pieces, of which other pairs can be missed.
    pub rounds: usize,
    /// Distance of a place from all pieces at which it has lost them, in multiples of `cover`, the gap and the margins together: a gap and both
    /// margins may be free of pieces. Raising it finds fewer places and islands without pieces.
    pub lost: f64,
    /// Least width of a lost place that is counted, in multiples of `ClearanceSettings::waste`.
    pub lost_width: f64,
    /// Pieces of a mesh with less than this share of its surface are islands. Raising it takes larger pieces for those of other parts.
    pub island: f64,
    /// In which poses must links not collide?
    pub poses: PoseSettings,
    /// How are links cut apart?
    pub clearance: ClearanceSettings,
    /// How are surfaces covered by convex pieces?
    pub decompose: DecomposeSettings,
}

impl CollisionSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        cover: 5e-3,
        cover_share: 5e-3,
        followed: 0.9,
        apart: 2.0,
        gap_share: 2e-3,
        most_gap: 2.5e-3,
        engine_margins: 3e-3,
        most_margins_share: 5e-3,
        contact_share: 1e-4,
        thinnest_share: 1e-3,
        least: 2.0,
        patch: 2.0,
        corners: 64,
        rounding: 0.1,
        lean: 0.5,
        crumb_length: 5.0,
        crumb_side: 2.0,
        rounds: 4,
        lost: 2.0,
        lost_width: 2.0,
        island: 0.1,
        poses: PoseSettings::DEFAULT,
        clearance: ClearanceSettings::DEFAULT,
        decompose: DecomposeSettings::DEFAULT,
    };
}

impl Default for CollisionSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl CollisionSettings {
    /// Largest distance between surface and convex pieces of an object with this diagonal, metres.
    pub fn cover_of(&self, diagonal: f64) -> f64 {
        self.cover.min(self.cover_share * diagonal)
    }

    /// Pieces of a link before links are cut apart, if it may have `most`: about three quarters, the others are left for the cuts.
    pub const fn before_cuts(most: u32) -> u32 {
        most.div_ceil(2) + most / 4
    }

    /// Pieces of a link while links are cut apart: seven eighths, the others are left for what cuts leave open.
    pub const fn while_cut(most: u32) -> u32 {
        most - most / 8
    }
}

/// Settings of the poses in which links must not collide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseSettings {
    /// Least and most tested poses of a hinge while the other joints are at zero. Raising them makes cuts slower and misses fewer collisions.
    pub hinge: [usize; 2],
    /// Way of the farthest point of a part between them, m: corners that pass each other at 2 mm are 2.3 mm apart at such a pose.
    pub step: f64,
    /// Tested poses of a hinge while the other joints are in an observed state.
    pub with_others: usize,
    /// Largest distance of an arc from the chords between the poses at which links are shown to be apart, relative to the distance from the axis.
    /// Raising it makes that faster and shows it of fewer links.
    pub sagitta: f64,
    /// Steps of an arc, of 3.6 degrees at this sagitta, whose convex hull is tested at once: 22 degrees. Raising it shows it of fewer links.
    pub arc: usize,
}

impl PoseSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self { hinge: [121, 401], step: 2e-3, with_others: 31, sagitta: 5e-4, arc: 6 };
}

impl Default for PoseSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of the cuts that keep links apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClearanceSettings {
    /// What a point of the surface of a link counts against one of a part that it carries: where the part passes, its carrier
    /// cannot be, also where it was observed. Raising it cuts more off parts and less off carriers.
    pub carrier: f64,
    /// A piece of which a cut would uncover more than the square of this, in multiples of `CollisionSettings::cover`, is split instead. Raising it
    /// makes fewer pieces and larger holes.
    pub waste: f64,
    /// Length of a chip, in multiples of `waste`: no piece is split for less, and shorter ones that cover little are removed.
    pub chip: f64,
    /// What a chip covers at most, in squares of `waste`. Raising it removes more chips.
    pub chip_area: f64,
    /// Cuts of a pair of pieces, of which one separates them unless rounding prevents it, before one of them is removed.
    pub tries: usize,
    /// Faces along which cuts are tried, those with the least depth. Raising it finds better cuts and is slower.
    pub faces: usize,
    /// Places of a cut between the piece's own face and the other piece's far side. Raising it finds better cuts and is slower.
    pub places: usize,
    /// Weight of the area of the side of a cube with the removed volume, against uncovered surface. Raising it keeps more volume.
    pub volume: f64,
    /// Distance of the corners of a piece swept along a slide, a share of that of an exported piece. Raising it makes sweeps coarser.
    pub swept: f64,
}

impl ClearanceSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        carrier: 0.3,
        waste: 3.0,
        chip: 2.0,
        chip_area: 0.5,
        tries: 8,
        faces: 6,
        places: 8,
        volume: 0.1,
        swept: 0.1,
    };
}

impl Default for ClearanceSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
