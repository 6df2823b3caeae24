//! Settings of the stage `align`.

use super::entry::{Entry, above, number, switch, whole};

/// Entries of `AlignConfig`.
#[rustfmt::skip]
pub(super) const ALIGN: &[Entry] = &[
    number("least_score", -1.0, 1.0, "share",
        "Least score of an alignment, as a share of the score of the recordings against their own frames: below it they have nothing in common"),
    number("ambiguous", 0.0, 2.0, "share",
        "An alignment whose score is this share of the same below the best is still possible"),
];

/// Entries of `GridConfig`.
#[rustfmt::skip]
pub(super) const GRID: &[Entry] = &[
    whole("columns", 8, 4_096, "cells", "Largest number of grid columns, cells"),
    above("edge", 0.0, 1.0, "fraction of the depth",
        "Depth step between neighbouring cells that is an edge, as a fraction of the depth"),
    whole("samples", 10, 100_000, "points", "Points of a frame that are compared with other frames"),
];

/// Entries of `BundleConfig`.
#[rustfmt::skip]
pub(super) const BUNDLE: &[Entry] = &[
    number("overlap", 0.0, 1.0, "share",
        "Share of a frame's points that another frame must see for the two to be compared, 0 to 1"),
    above("gate", 0.0, 10.0, "units of the median depth",
        "Distance between corresponding points in the first step; falls to a multiple of the noise"),
    whole("steps", 1, 1_000, "steps", "Largest number of Gauss-Newton steps"),
    number("brightness", 0.0, 1_000_000.0, "weight", "Weight of brightness against depth, 0 for none"),
    above("stated_deg", 0.0, 180.0, "degrees", "Standard deviation of a stated pose: angle in degrees"),
    above("stated_shift", 0.0, 10.0, "units of the median depth", "Standard deviation of a stated pose: position"),
    above("step_deg", 0.0, 180.0, "degrees",
        "Standard deviation of the stated motion between consecutive frames: angle in degrees"),
    above("step_shift", 0.0, 10.0, "units of the median depth",
        "Standard deviation of the stated motion between consecutive frames: position"),
];

/// Entries of `GlobalConfig`.
#[rustfmt::skip]
pub(super) const GLOBAL: &[Entry] = &[
    number("voxel", 0.001, 1.0, "units of the median depth", "Edge of the cubes that frames are averaged over"),
    number("radius", 1.0, 100.0, "cubes", "Radius of a descriptor, cubes"),
    whole("features", 10, 50_000, "points", "Described points of a recording"),
    whole("triples", 1, 10_000_000, "triples", "Random triples of matches"),
    whole("refined", 1, 10_000, "hypotheses", "Hypotheses that are refined"),
    number("up_deg", 0.0, 180.0, "degrees",
        "Largest angle between the upward directions of the recordings, where both state them, degrees"),
    above("tolerance", 0.0, 1.0, "units of the median depth", "Depth difference within which a point is on a surface"),
    number("same_deg", 0.0, 180.0, "degrees", "Alignments that differ by less are the same: degrees"),
    number("same_shift", 0.0, 10.0, "units of the median depth", "Alignments that differ by less are the same: length"),
];

/// Entries of `ConsistentConfig`.
#[rustfmt::skip]
pub(super) const CONSISTENT: &[Entry] = &[
    whole("frames", 0, 10_000, "frames", "Frames that correct a frame, those that see most of it"),
    number("largest", 0.0, 1.0, "fraction of the depth",
        "Largest correction, as a fraction of the depth: a larger difference is another surface"),
    whole("least", 0, 10_000, "frames", "Frames that must see a surface to correct it"),
];

/// Entries of `CompleteConfig`.
#[rustfmt::skip]
pub(super) const COMPLETE: &[Entry] = &[
    switch("enabled", "Whether pixels without measured depth take that of surfaces that continue there"),
    whole("frames", 0, 10_000, "frames",
        "Frames that a surface is compared with, those that see most of what the frame sees; more cost time"),
    whole("reach", 0, 1000, "cells", "Farthest measured cell of the same frame whose surface may continue in a cell"),
    above("color", 0.0, 1.0, "0 to 1", "Mean difference of colours that speaks neither for nor against the same surface"),
    number("least_vote", -1.0, 1.0, "-1 to 1",
        "Least mean vote for a surface, of the other frames and of the cells beside it; raising it leaves more pixels without depth"),
];

/// Entries of `CorrectConfig`.
#[rustfmt::skip]
pub(super) const CORRECT: &[Entry] = &[
    switch("enabled", "Whether stated poses are corrected; otherwise they are used as they are"),
    above("stated_deg", 0.0, 180.0, "degrees", "Standard deviation of the jitter of a stated pose: angle in degrees"),
    above("stated_shift", 0.0, 10.0, "units of the median depth",
        "Standard deviation of the jitter of a stated pose: position, relative to the median depth"),
    number("exact", 0.0, 1.0, "units of the median depth",
        "Disagreement of depth, relative to the median depth, below which poses are exact"),
    number("refined", 0.0, 1.0, "share", "Poses are refined if that lowers the disagreement to this share, 0 to 1"),
    number("largest_deg", 0.0, 180.0, "degrees", "Largest correction of the end state: angle in degrees"),
    number("largest_shift", 0.0, 10.0, "fraction of the object's size",
        "Largest correction of the end state: motion of the object's centre as a share of its size"),
    number("gain", 1.0, 1_000.0, "factor",
        "The end state is moved if the share of surfaces that agree grows by this factor"),
    number("sharp", 0.0, 1.0, "share",
        "A stated alignment is right if this share of the surfaces that agree roughly agrees within the noise, 0 to 1"),
];

/// Entries of `ColorConfig`.
#[rustfmt::skip]
pub(super) const COLOR: &[Entry] = &[
    switch("enabled", "Whether colours that are not registered to depth are moved; otherwise they are used as they were recorded"),
    number("largest_shift", 0.0, 0.5, "fraction of the image width", "Largest shift, as a share of the image width"),
    number("largest_scale", 0.0, 0.5, "share", "Largest difference of the scale from 1"),
    number("least_gain", 0.0, 1.0, "share",
        "Least gain of the alignment of edges: colours with a smaller one stay as they are"),
];

/// Entries of `ExposureConfig`.
#[rustfmt::skip]
pub(super) const EXPOSURE: &[Entry] = &[
    switch("enabled", "Whether exposure and white balance are equalised; otherwise colours are used as they were recorded"),
    whole("least_points", 1, 100_000, "points", "Common points that two frames need to be compared"),
    number("least_spread", 0.0, 10.0, "logarithm",
        "Colours are left as they are if the gains spread by less than this (standard deviation of their logarithms)"),
    number("explained", 0.0, 1.0, "share",
        "Colours of recordings are left as they are unless their disagreement falls to this share, 0 to 1"),
    number("explained_in_captures", 0.0, 1.0, "share", "The same of captures whose states share a frame"),
];

/// Entries of `ObjectConfig`.
#[rustfmt::skip]
pub(super) const OBJECT: &[Entry] = &[
    number("cube", 0.001, 1.0, "units of the median depth", "Edge of the cubes that the scene is divided into"),
    above("attention", 0.0, 10.0, "fraction of the image diagonal",
        "Standard deviation of attention about the image centre, as a fraction of the image diagonal"),
    number("plane_spreads", 0.0, 100.0, "standard deviations",
        "Points within this many standard deviations of a bounding plane belong to the plane"),
    number("bump_spreads", 0.0, 100.0, "standard deviations",
        "Points within this many standard deviations of a bounding plane do not connect surfaces"),
    whole("gap", 0, 16, "cubes",
        "Surfaces with at most this many empty cubes between them are connected: depth is missing along edges"),
    number("carrying_share", 0.0, 2.0, "share",
        "Share of its footprint that a level face needs to carry things that are not of the object; above 1: never"),
];

/// Entries of `PlaneConfig`.
#[rustfmt::skip]
pub(super) const PLANES: &[Entry] = &[
    above("tolerance", 0.0, 1.0, "units of the median depth",
        "Distance from the plane within which a point belongs to it"),
    above("least_share", 0.0, 1.0, "share", "Share of all points that a plane needs, 0 to 1"),
    number("behind", 0.0, 1.0, "share",
        "Points behind the plane that are allowed, as a share of its points: reflections, a view through a door"),
    whole("count", 0, 100, "planes", "Largest number of planes"),
    whole("trials", 1, 1_000_000, "trials", "Random trials per plane"),
];

/// Entries of `ExtractConfig`.
#[rustfmt::skip]
pub(super) const EXTRACT: &[Entry] = &[
    number("fill", 0.0, 1_000.0, "measured depth pixels",
        "Pixels without depth take the label of a pixel at most this far away, in measured depth pixels"),
    number("outline", 0.0, 1_000.0, "pixels",
        "Cost of an outline in pixels that change sides, where no depth was measured: higher values make it shorter, 0 leaves it as it is"),
    whole("margin", 0, 10_000, "pixels", "Pixels around the object that are kept"),
    number("hidden", 0.0, 1.0, "share",
        "Share of the object's surface that other things may hide before a frame is left out, 0 to 1"),
    number("least_share", 0.0, 1.0, "share", "Least share of an image that the object fills, 0 to 1"),
];
