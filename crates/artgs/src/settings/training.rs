//! Settings of training.

use super::entry::{Entry, MOST_STEPS, above, below, between, number, switch, whole, words};

/// Entries of `SingleConfig`.
#[rustfmt::skip]
pub(super) const SINGLE: &[Entry] = &[
    whole("steps", 0, MOST_STEPS, "steps", "Largest number of steps, one view each"),
    whole("image_divisor", 1, 1_024, "factor", "Images are made smaller by this integer factor"),
    words("depth_pick", &["nearest", "median"], "How depth is resampled"),
    whole("sh_degree", 0, 3, "degree", "Degree of the harmonics"),
    whole("sh_every", 0, MOST_STEPS, "steps",
        "The active degree rises from 0 by one every so many steps; 0: all at once"),
    switch("random_background", "A new background colour each step; otherwise black"),
    switch("with_replacement", "Draw each view independently; otherwise all views in shuffled rounds"),
    switch("update_always",
        "Update parameters also at steps that change the set of Gaussians and at the last step (published: not)"),
    words("init", &["auto", "depth", "random"], "Where Gaussians start"),
];

/// Entries of `RandomInit`.
#[rustfmt::skip]
pub(super) const RANDOM: &[Entry] = &[
    whole("count", 10, 10_000_000, "Gaussians", "Number of Gaussians"),
    above("margin", 0.0, 100.0, "halves of the object's longest side",
        "Half side of the cube relative to half the longest side of the object's box"),
    between("opacity", 0.0, 1.0, "opacity", "Opacity of the first Gaussians"),
];

/// Entries of `DepthInit`.
#[rustfmt::skip]
pub(super) const DEPTH: &[Entry] = &[
    whole("count", 10, 10_000_000, "Gaussians",
        "Number of Gaussians aimed at (met within a tenth or so); sets the voxel size"),
    between("opacity", 0.0, 1.0, "opacity", "Opacity of the first Gaussians; published: 0.1"),
    whole("min_pixels", 1, 1_000_000, "pixels", "Voxels seen by fewer pixels are taken for noise"),
    above("flatten", 0.0, 100.0, "ratio",
        "Standard deviation along the normal relative to that along the surface; 1, as published: round"),
    above("spread", 0.0, 100.0, "distances of neighbours",
        "Standard deviation relative to the root mean square distance of the three nearest neighbours; published: 1"),
];

/// Entries of `LossConfig`.
#[rustfmt::skip]
pub(super) const LOSS: &[Entry] = &[
    number("ssim", 0.0, 1.0, "share", "Share of `1 - SSIM` in the colour loss; the rest is L1"),
    switch("crop_ssim", "Evaluate SSIM only around the object; elsewhere both images are background"),
    switch("double_alpha", "Blend the photograph over the background with alpha squared, as the published code does"),
    number("depth", 0.0, 1_000_000.0, "weight", "Weight of the depth loss; 0 or images without depth: none"),
    words("depth_mode", &["accumulated", "normalized"], "Form of the depth loss"),
    number("mask", 0.0, 1_000_000.0, "weight",
        "Weight of the mean absolute difference between rendered and measured alpha"),
    number("opacity_entropy", 0.0, 1_000_000.0, "weight", "Weight of the entropy of opacities"),
];

/// Entries of `RateConfig`.
#[rustfmt::skip]
pub(super) const RATES: &[Entry] = &[
    above("position_from", 0.0, 100.0, "per step", "Rate of centres at the first step, per spatial scale"),
    above("position_to", 0.0, 100.0, "per step", "Rate of centres at the horizon, per spatial scale"),
    whole("position_horizon", 0, MOST_STEPS, "steps",
        "Steps over which the rate of centres falls; 0: the length of the run"),
    above("extent_factor", 0.0, 1_000.0, "extents of the cameras",
        "Spatial scale relative to the extent of the cameras (largest distance from their mean)"),
    number("rotation", 0.0, 100.0, "per step", "Rate of raw quaternions"),
    number("log_scale", 0.0, 100.0, "per step", "Rate of log scales"),
    number("opacity", 0.0, 100.0, "per step", "Rate of logit opacities"),
    number("sh_dc", 0.0, 100.0, "per step", "Rate of the constant harmonic"),
    number("sh_rest", 0.0, 100.0, "per step", "Rate of the other harmonics"),
    above("final_fraction", 0.0, 1.0, "fraction",
        "All rates but that of centres fall log-linearly to this fraction at the end of the run; 1: constant"),
];

/// Entries of `AdamConfig`.
#[rustfmt::skip]
pub(super) const ADAM: &[Entry] = &[
    below("beta1", 0.0, 1.0, "per step", "Decay of the first moment"),
    below("beta2", 0.0, 1.0, "per step", "Decay of the second moment"),
    above("eps", 0.0, 1.0, "gradient", "Added to the root of the second moment"),
];

/// Entries of `DensifyConfig`.
#[rustfmt::skip]
pub(super) const DENSIFY: &[Entry] = &[
    whole("after", 0, MOST_STEPS, "steps", "Acts at steps after this one"),
    whole("before", 0, MOST_STEPS, "steps", "Acts at steps before this one"),
    whole("every", 0, MOST_STEPS, "steps", "Acts at multiples of this many steps; 0 never"),
    number("grad_threshold", 0.0, 1_000_000.0, "normalised device units",
        "Mean length of the screen-space gradient (normalised device units) from which a Gaussian is multiplied"),
    number("clone_scale", 0.0, 1_000_000.0, "fraction of the extent",
        "Largest standard deviation, relative to the extent, up to which a Gaussian is cloned and not split"),
    above("split_shrink", 0.0, 100.0, "factor",
        "Standard deviations of the two halves of a split Gaussian are divided by this"),
    below("prune_opacity", 0.0, 1.0, "opacity", "Gaussians of a lower opacity are pruned"),
    whole("late_after", 0, MOST_STEPS, "steps",
        "After this step Gaussians that are too large are pruned too, and `late_prune_opacity` holds"),
    below("late_prune_opacity", 0.0, 1.0, "opacity", "`prune_opacity` after `late_after`"),
    number("prune_radius_px", 0.0, 1_000_000.0, "pixels", "Largest footprint radius in pixels; 0: unlimited"),
    above("prune_scale", 0.0, 1_000_000.0, "fraction of the extent",
        "Largest standard deviation, relative to the extent"),
    whole("reset_every", 0, MOST_STEPS, "steps", "Opacities are reset at multiples of this many steps; 0 never"),
    between("reset_opacity", 0.0, 1.0, "opacity", "Opacities are at most this after a reset"),
    whole("max_gaussians", 1, 4_294_967_295, "Gaussians",
        "The set does not grow beyond this; the largest gradients go first"),
];

/// Entries of `PlateauConfig`.
#[rustfmt::skip]
pub(super) const PLATEAU: &[Entry] = &[
    whole("settle", 0, MOST_STEPS, "steps",
        "Steps after the run settles; 0: the run has its full length, and rates fall from its beginning"),
    whole("hold_back", 0, 10_000, "views", "Views of each state that are held back, but at most one in eight"),
    whole("every", 0, MOST_STEPS, "steps", "Steps between two scores of the held-back views"),
    whole("coarse_pixels", 1, 1_000_000_000, "pixels",
        "Until the run settles, larger images are reduced by an integer factor to about this number of pixels"),
    number("least_gain", 0.0, 100.0, "decibels",
        "The run settles when the mean PSNR of the held-back views is less than this above the best so far, decibels"),
];

/// Entries of `ArticulateConfig`.
#[rustfmt::skip]
pub(super) const ARTICULATE: &[Entry] = &[
    whole("steps", 0, MOST_STEPS, "steps", "Largest number of steps, one view each"),
    whole("image_side", 0, 65_536, "pixels",
        "Images are made smaller by the integer factor that brings their longer side nearest to this; 0: as they are"),
    words("depth_pick", &["nearest", "median"], "How depth is resampled"),
    whole("sh_every", 0, MOST_STEPS, "steps",
        "The active degree of harmonics rises from 0 by one every so many steps; 0: all at once"),
    switch("random_background", "A new background colour each step; otherwise black"),
    switch("with_replacement",
        "Draw a state by a fair coin, then any of its views; otherwise all views of both states in shuffled rounds"),
    switch("update_always",
        "Update Gaussians also at steps that change their set and at the last step (published: not)"),
    switch("exact", "Use true derivatives of the warp; otherwise those of the published code"),
    switch("rotate_sh", "Turn colours with the parts rather than leave them fixed to the world"),
    switch("learn_joints", "Improve the motions; otherwise they stay as given"),
    switch("learn_noisy_joints",
        "Improve the motions of found parts whose points are noisy, also without `learn_joints`"),
    whole("centre_after", 0, MOST_STEPS, "steps",
        "The pull of part centres towards their parts (weight in `assign`) acts after this step"),
    number("chamfer", 0.0, 1_000_000.0, "weight",
        "Weight of the mean squared distance from moved Gaussians to the targets of their state; 0: none"),
    whole("chamfer_after", 0, MOST_STEPS, "steps", "The Chamfer term acts after this step"),
    whole("chamfer_before", 0, MOST_STEPS, "steps", "The Chamfer term acts before this step"),
    switch("chamfer_not_if_prismatic", "No Chamfer term if any part is prismatic"),
];

/// Entries of `LogLinear`.
#[rustfmt::skip]
pub(super) const FALL: &[Entry] = &[
    above("from", 0.0, 100.0, "per step", "Rate at step 0"),
    above("to", 0.0, 100.0, "per step", "Rate from step `steps` on"),
    whole("steps", 0, MOST_STEPS, "steps", "Length of the fall in steps; 0 means `to` throughout"),
];

/// Entries of `AssignConfig`.
#[rustfmt::skip]
pub(super) const ASSIGN: &[Entry] = &[
    words("kind", &["centres", "mlp", "slots"], "What decides to which part a Gaussian belongs"),
    switch("normalise_coordinates",
        "Whether positions are relative to the object's bounding box, its longest side being 1, or world coordinates"),
    whole("hidden", 1, 1_024, "numbers per Gaussian", "Width of the hidden layer"),
    number("shift_weight", 0.0, 1_000.0, "weight", "Weight `w` of the perceptron's two outputs in the logits"),
    above("scale_factor", 0.0, 1_000.0, "factor", "Factor on the parts' scales"),
    above("start_temperature", 0.0, 1_000.0, "temperature",
        "Temperature at step 0, from which it falls along a cosine"),
    above("end_temperature", 0.0, 1_000.0, "temperature", "Temperature at the end of the fall"),
    whole("temperature_steps", 0, MOST_STEPS, "steps", "Step at which the temperature has fallen to its end"),
    switch("divide_temperature_by_movable",
        "Whether the softmax divides by `temperature / (K - 1)` rather than by the temperature"),
    number("hard_margin", 0.0, 1_000.0, "temperature",
        "Weights are one-hot, with the gradient of the soft ones, once the temperature is this close to its end"),
    switch("gumbel", "Whether training adds Gumbel noise to the logits"),
    whole("initial_levels", 0, 24, "levels",
        "Levels of the hash grid that learn from the start; the others only pass their features on"),
    whole("steps_per_level", 0, MOST_STEPS, "steps", "Steps after which one more level learns"),
    number("centre_weight", 0.0, 1_000_000.0, "weight",
        "Weight of the pull of centres to the opacity-weighted means of their parts"),
];

/// Entries of `SlotConfig`.
#[rustfmt::skip]
pub(super) const SLOTS: &[Entry] = &[
    whole("width", 1, 512, "numbers per Gaussian", "Numbers per slot and per Gaussian"),
    whole("iterations", 0, 100, "times",
        "Times that the slots attend to the Gaussians before their last attention assigns these"),
];

/// Entries of `HashGridConfig`.
#[rustfmt::skip]
pub(super) const HASH_GRID: &[Entry] = &[
    whole("levels", 1, 24, "levels", "Number of resolutions"),
    whole("log2_entries", 4, 22, "binary logarithm",
        "Binary logarithm of the most entries a level may have; coarser levels that need fewer are dense"),
    number("base_resolution", 2.0, 4_096.0, "points per unit length",
        "Grid points per unit length at the coarsest level"),
    number("growth", 1.0, 16.0, "ratio", "Ratio of neighbouring resolutions"),
    number("initial_range", 0.0, 1.0, "feature", "Initial features are uniform in plus or minus this"),
];
