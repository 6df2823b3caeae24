//! Settings of parts, of the first Gaussians and of meshes.

use super::entry::{Entry, MOST_STEPS, above, below, between, number, parts, switch, whole, words};

/// Entries of `Config` outside its sections.
#[rustfmt::skip]
pub(super) const TOP: &[Entry] = &[
    parts("parts", "parts", "Number of rigid parts, the static part included"),
    whole("seed", 0, i64::MAX, "number", "Seed of all random numbers"),
    words("method", &["discover", "paper", "registration"], "How parts and joints are found"),
];

/// Entries of `Affinity`; a file has one of them.
#[rustfmt::skip]
pub(super) const AFFINITY: &[Entry] = &[
    whole("neighbours", 1, 1000, "neighbours", "Affinity of points in a symmetric graph of so many nearest neighbours"),
    above("rbf", 0.0, 1e9, "per squared scene unit",
        "Dense affinity `exp(-gamma d^2)`, with this gamma; `affinity` holds either this or `neighbours`"),
];

/// Entries of `DiscoverConfig`.
#[rustfmt::skip]
pub(super) const DISCOVER: &[Entry] = &[
    number("spacing", 0.0001, 0.2, "fraction of the object's diagonal",
        "Distance between the surface points that are labelled; never below one pixel"),
    number("voxel", 0.001, 0.2, "fraction of the object's diagonal",
        "Edge of a cell of the grid that candidate motions are scored with"),
    number("least_share", 0.0, 1.0, "share", "A motion must explain at least this fraction of all moved points"),
    whole("rounds", 0, 100, "rounds", "Rounds of labelling and registering"),
    number("revolute_deg", 0.0, 180.0, "degrees",
        "Motions that turn less than this are slides, unless a hinge fits clearly better"),
    switch("decide_joints", "Decide between hinge, slide and screw, and find which part carries which"),
    number("most_unexplained", 0.0, 1.0, "share",
        "Largest share of the surfaces of a state that no motion may explain; with more, the states are refused"),
    number("least_resting", 0.0, 1.0, "share",
        "Share of all points that must rest between the states; with less, the states are refused"),
    number("sure_quality", 0.0, 1.0, "share",
        "Share of what moved that joints explain, weighted by their confidence, from which more may be unexplained, with a warning"),
];

/// Entries of `StartConfig`.
#[rustfmt::skip]
pub(super) const START: &[Entry] = &[
    words("from", &["surface", "random"], "Where the first Gaussians are"),
    words("parts", &["labels", "learnt"], "Where the parts of Gaussians come from"),
    number("spacing", 0.05, 100.0, "distances between labelled points",
        "Distance between Gaussians relative to the distance between labelled points"),
    above("spread", 0.0, 100.0, "distances between Gaussians",
        "Standard deviation along the surface relative to the distance between Gaussians"),
    above("flatness", 0.0, 100.0, "ratio", "Standard deviation along the normal relative to that along the surface"),
    between("opacity", 0.0, 1.0, "opacity", "Opacity of the first Gaussians"),
    whole("sh_degree", 0, 3, "degree", "Degree of the harmonics"),
];

/// Entries of `RegistrationConfig`.
#[rustfmt::skip]
pub(super) const REGISTRATION: &[Entry] = &[
    number("revolute_deg", 0.0, 180.0, "degrees", "A part whose motion turns by more than this is revolute"),
    between("reach", 0.0, 1.0, "fraction of the object's diagonal",
        "Largest distance of matched points at first, relative to the object's diagonal"),
    whole("turns", 1, 1_000, "turns", "Turns tried about each principal axis of a cluster"),
    whole("rough_points", 1, 1_000_000, "points",
        "Points of each cluster that take part in the first, rough registrations"),
];

/// Entries of `CanonicalConfig`.
#[rustfmt::skip]
pub(super) const CANONICAL: &[Entry] = &[
    words("start", &["matched", "random"], "Where canonical Gaussians come from"),
    words("centres", &["moved", "all", "random"], "Where part centres come from"),
    words("centre_states", &["both", "one"],
        "Whether what moved in both states makes part centres, or that of the state with more motion, as published"),
    whole("max_matched", 1, 20_000, "pairs", "Most pairs of Gaussians that are matched and averaged"),
    number("centre_ratio", 0.0, 1.0, "ratio",
        "`static_rule.ratio` where parts are separated; if absent, 0.05 for more than three parts, otherwise the same"),
    switch("align_quaternions",
        "Whether quaternions are averaged with equal signs; published code does not look at signs"),
    above("radius_factor", 0.0, 100.0, "factor",
        "Radius of a part as a fraction of the distance of its farthest Gaussian; the paper says 1"),
];

/// Entries of `StaticRule`.
#[rustfmt::skip]
pub(super) const STATIC_RULE: &[Entry] = &[
    number("ratio", 0.0, 1.0, "ratio",
        "Fraction of the reference distance below which a point is static; applied to squares if `squared`"),
    switch("squared",
        "Whether `ratio` applies to squared distances, as in published code, or to distances, as in the paper"),
    number("quantile", 0.0, 1.0, "quantile",
        "The reference is this quantile of a state's distances: 1 for the maximum, less to be safe from floaters"),
];

/// Entries of `ClusterConfig`.
#[rustfmt::skip]
pub(super) const CLUSTER: &[Entry] = &[
    words("labels", &["kmeans", "discretize"], "Labels from the embedding"),
    whole("max_points", 10, 20_000, "points",
        "More points than this are thinned; the others get the label of their nearest sample"),
    below("min_component", 0.0, 1.0, "share",
        "Components of the graph with a smaller share of the points are labelled by their nearest neighbour"),
];

/// Entries of `TypeConfig`.
#[rustfmt::skip]
pub(super) const TYPES: &[Entry] = &[
    switch("skip",
        "Leave this stage out: parts keep general rigid motions, and their turn decides the type in the end"),
    whole("steps_for_many", 0, MOST_STEPS, "steps", "Number of steps for several movable parts"),
    number("half_angle_deg", 0.0, 180.0, "degrees",
        "A part whose half motion turns by more than this is taken for revolute"),
];

/// Entries of `SurfaceConfig`.
#[rustfmt::skip]
pub(super) const SURFACE: &[Entry] = &[
    number("voxel", 1e-06, 1_000_000.0, "scene units",
        "Voxel size; if absent, the object's diagonal divided by `resolution`"),
    number("resolution", 1.0, 20_000.0, "voxels", "Voxels along the diagonal of the object's bounding box"),
    above("truncation_voxels", 0.0, 100.0, "voxels",
        "Distance before a surface from which on space counts as empty, voxels"),
    above("behind_voxels", 1.0, 100.0, "voxels", "Distance behind a surface up to which a sample is believed, voxels"),
    number("jump_voxels", 0.0, 1_000_000.0, "voxels",
        "Depth step between neighbouring pixels that separates two surfaces, voxels; 0 never does"),
    above("min_weight", 0.0, 1_000_000.0, "weight", "Weight a voxel needs; a view straight onto the surface counts 1"),
    number("keep_fraction", 0.0, 1.0, "share",
        "Components with fewer triangles than this fraction of the largest one's are dropped as specks; of part meshes, views decide on larger ones"),
    switch("carve_background",
        "Background pixels say that their rays are empty; turn it off if masks miss parts of the object"),
    words("whole", &["union", "fused"], "Source of the whole object's mesh"),
    whole("memory_mib", 1, 1_048_576, "MiB", "Memory of one volume; voxels grow until it suffices"),
];
