//! How far joints go.

use std::f64::consts::{FRAC_PI_4, PI};

/// Settings of joint limits. Fields ending in `_share` are shares of the object's diagonal unless stated otherwise; others are in metres and
/// radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitSettings {
    /// Largest extension of a hinge at each end, rad. Raising it opens doors farther than they were seen.
    pub most_turn: f64,
    /// Largest range of a hinge after extension, rad.
    pub widest_turn: f64,
    /// Farthest beyond what was observed that a contact closes a hinge which is flush nowhere, rad. Raising it closes parts farther
    /// where surfaces are incomplete. Measured in `docs/decisions/0012-closing-limits.md`.
    pub most_unseen_turn: f64,
    /// The same for slides, m.
    pub most_unseen_slide: f64,
    /// Extension of a slide whose closed state is not known and that meets nothing, as a share of its observed range. Raising it lets such
    /// slides go farther at both ends.
    pub most_slide: f64,
    /// Share of a sliding part's length that must stay inside its parent; the reason in `export.json` says it in words. Raising it ends slides
    /// earlier.
    pub least_support: f64,
    /// Distance between the points of a surface that are swept for contacts. Raising it makes limits faster and misses narrow contacts.
    pub sample_share: f64,
    /// Least width of a contact between parts of which neither carries the other, and of one that closes a part on its carrier, in each
    /// direction across the motion: rims overlap by a voxel. Raising it lets parts pass rims and narrow frames. Set on one procedural object with
    /// voxels of 0.45 % of the diagonal, tested on four others.
    pub contact_rim_share: f64,
    /// Side of a square as large as the smallest contact: less is noise. Raising it lets parts pass small obstacles. This and the next two are
    /// calibrated on the replicas of ten procedural objects with voxels of 0.45 % of the diagonal.
    pub contact_width_share: f64,
    /// Overlap of surfaces in an observed state that is an error of measurement. Raising it lets parts begin inside each other.
    pub overlap_share: f64,
    /// A part that meets another one within this way in the direction in which it closes was observed closed. Raising it takes parts that were
    /// seen ajar for closed ones.
    pub closed_share: f64,
    /// Least range of a joint, m or rad: engines refuse `lower = upper`.
    pub narrowest: f64,
    /// Share of `overlap_share` deeper than which surfaces cross on a way that only an assumption frees. Raising it finds fewer crossings.
    pub crossing: f64,
    /// Where is a part flush?
    pub flush: FlushSettings,
    /// What is a contact?
    pub sweep: SweepSettings,
}

impl LimitSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        most_turn: FRAC_PI_4,
        widest_turn: PI,
        most_unseen_turn: 15.0 * PI / 180.0,
        most_unseen_slide: 0.05,
        most_slide: 0.5,
        least_support: 0.25,
        sample_share: 4e-3,
        contact_rim_share: 0.006,
        contact_width_share: 0.015,
        overlap_share: 6e-3,
        closed_share: 7.5e-3,
        narrowest: 1e-4,
        crossing: 0.5,
        flush: FlushSettings::DEFAULT,
        sweep: SweepSettings::DEFAULT,
    };
}

impl Default for LimitSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of where fronts and panels are flush. Angles are given by their cosines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlushSettings {
    /// Least cosine between the normals of a front and the direction in which its part opens. Raising it takes fewer points for fronts.
    pub facing: f64,
    /// Half of the depth within which points of a front lie, in distances of the points. Raising it takes uneven fronts for planes.
    pub layer: f64,
    /// Least cosine between the axes of slides that are beside each other.
    pub parallel: f64,
    /// Largest distance of a frame from the rim of the front, in multiples of `LimitSettings::closed_share`. Raising it takes farther surfaces of
    /// the carrier for the frame.
    pub frame: f64,
    /// Largest distance of a panel from the border of its carrier's face, in multiples of `LimitSettings::closed_share`. Raising it finds more
    /// panels that lie on faces.
    pub border: f64,
    /// Error of the directions of faces, rad: surfaces are uneven. A contact within it behind the flush place counts instead.
    pub turn_error: f64,
    /// Length of the mean of the fourfold angles of faces, above which they are those of a box: 1 for a box, 0 for a cylinder. Raising it makes
    /// fewer parts panels.
    pub boxlike: f64,
    /// Largest cosine between normal and axis of faces along the axis.
    pub along: f64,
    /// Share of the points beyond each end of an extent: handles and scraps. Raising it makes panels smaller.
    pub beyond: f64,
    /// Share of a panel that is over its carrier. Raising it finds fewer panels that lie on faces.
    pub over: f64,
}

impl FlushSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        facing: super::FACING,
        layer: 0.5,
        parallel: 0.99,
        frame: 10.0,
        border: 2.0,
        turn_error: 0.035,
        boxlike: 0.5,
        along: 0.5,
        beyond: 0.02,
        over: 0.7,
    };
}

impl Default for FlushSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of contacts on the way of a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepSettings {
    /// Longest edge of a triangle that is observed or not, in distances between points. Raising it makes the border of what was seen coarser.
    pub edge: f64,
    /// Way of a hinge between two tested poses, rad: chords leave arcs by 0.4 mm per metre at this one. Raising it makes limits faster and
    /// less exact.
    pub turn: f64,
    /// Tested poses of a hinge at least and at most.
    pub turns: [f64; 2],
    /// Tested poses of a slide.
    pub slides: f64,
    /// Tested places on a way for surfaces that cross. Raising it ends such ways more exactly.
    pub crossings: usize,
    /// Largest depth of a point inside another part, in multiples of the least one: what is farther from the surface is behind a wall.
    pub deepest: f64,
    /// Cosine of the largest angle between the way to the surface and its normal: beside a rim, nothing is known.
    pub straight: f64,
    /// Radius of the neighbourhood in which a contact must be wide, in multiples of that width: that of the corner of a larger area is still
    /// wide enough. Raising it finds more contacts.
    pub reach: f64,
    /// Points below which a neighbourhood has no width.
    pub few: f64,
    /// Cosine of the largest angle between motion and normals of surfaces that press: noise tilts surfaces that slide along each other. Raising
    /// it finds fewer contacts.
    pub pressing: f64,
    /// Share of the points that face forward that a contact stops at least. Raising it lets large parts pass small obstacles.
    pub leading: f64,
    /// Surfaces that a point passes at a grazing angle on one step, before the rest of the step is left out.
    pub grazed: usize,
}

impl SweepSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        edge: 4.0,
        turn: 0.05,
        turns: [4.0, 400.0],
        slides: 12.0,
        crossings: 16,
        deepest: 3.0,
        straight: 0.9,
        reach: 1.5,
        few: 4.0,
        pressing: 0.85,
        leading: 0.01,
        grazed: 4,
    };
}

impl Default for SweepSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
