//! What the population is drawn from: probabilities and sizes. The page "Population" of the book explains them.
//!
//! Sizes are metres. Those of furniture cover what is sold: kitchen bases and appliances after EN 1116 (worktop at 0.85 to 0.9, depth 0.6,
//! widths in steps of 0.05), desks after EN 527-1 (height 0.72 to 0.76), chests, cupboards and wardrobes the catalogue sizes of large furniture
//! shops; laptops have screens of 13 to 17 inches.

use super::furniture::{Base, Leaf};
use super::looks::Family;

/// Families of materials and their weights.
pub(super) const FAMILIES: [(Family, f64); 4] =
    [(Family::Plain, 0.35), (Family::Wood, 0.35), (Family::Noise, 0.15), (Family::Gloss, 0.15)];
/// Probability that the whole object has one material.
pub(super) const EQUAL_MATERIALS: f64 = 0.2;
/// Probability that every front has a material of its own, if they are not all equal.
pub(super) const OWN_MATERIALS: f64 = 0.25;

/// Probability that a body that could move is at rest, if another one moves.
pub(super) const REST: f64 = 0.15;
/// Probability that all bodies of an object move the same way, opening or closing.
pub(super) const ONE_WAY: f64 = 0.5;
/// Probability that some bodies of a group have the same motion.
pub(super) const EQUAL_MOTION: f64 = 0.15;
/// Weights of what a body does that rests closed by nature: opens from closed, from ajar, wide open in both states.
pub(super) const FROM_CLOSED: f64 = 0.5;
pub(super) const FROM_AJAR: f64 = 0.3;
pub(super) const WIDE: f64 = 0.2;

/// Most bodies that can move.
pub(super) const MOST_PARTS: usize = 20;

/// Gap between neighbouring fronts.
pub(super) const GAP: [f64; 2] = [0.001, 0.006];
/// Gaps up to this one count as narrow.
pub(super) const NARROW: f64 = 0.002;
/// Probability that strips of the carcass are seen between fronts, and their half width.
pub(super) const REVEALED: f64 = 0.3;
pub(super) const REVEAL: [f64; 2] = [0.008, 0.025];
/// Probability that fronts lie in the openings of the carcass and not before it.
pub(super) const INSET: f64 = 0.35;
/// Thickness of fronts.
pub(super) const FRONT: [f64; 2] = [0.016, 0.024];
/// Probability that doors are thin sheets, and their thickness.
pub(super) const THIN: f64 = 0.12;
pub(super) const SHEET: [f64; 2] = [0.003, 0.006];
/// Probability that fronts are frames with a panel.
pub(super) const FRAMED: f64 = 0.2;

/// A kind of furniture.
pub(super) struct FurnitureKind {
    pub(super) name: &'static str,
    pub(super) weight: f64,
    pub(super) width: [f64; 2],
    pub(super) depth: [f64; 2],
    pub(super) height: [f64; 2],
    /// Regions of the front are divided while they are wider or higher than these.
    pub(super) largest: [f64; 2],
    /// Probability that a region that need not be divided is.
    pub(super) divide: f64,
    /// What fills regions, with weights; what does not fit a region is left out.
    pub(super) leaves: &'static [(Leaf, f64)],
    pub(super) bases: &'static [(Base, f64)],
    /// Probability of a worktop.
    pub(super) worktop: f64,
}

use Base::{Feet, Floor, Plinth};
use Leaf::{Door, DoubleDoor, Drawer, FixedPanel, FlapDown, FlapUp, Open, SlidingPair};

pub(super) const FURNITURE: [FurnitureKind; 9] = [
    FurnitureKind {
        name: "chest",
        weight: 0.11,
        width: [0.4, 1.2],
        depth: [0.40, 0.52],
        height: [0.5, 1.3],
        largest: [0.9, 0.26],
        divide: 0.35,
        leaves: &[(Drawer, 0.93), (FixedPanel, 0.04), (Open, 0.03)],
        bases: &[(Floor, 0.3), (Plinth, 0.35), (Feet, 0.35)],
        worktop: 0.4,
    },
    FurnitureKind {
        name: "nightstand",
        weight: 0.04,
        width: [0.35, 0.6],
        depth: [0.34, 0.45],
        height: [0.38, 0.65],
        largest: [0.7, 0.4],
        divide: 0.7,
        leaves: &[(Drawer, 0.6), (Door, 0.2), (Open, 0.2)],
        bases: &[(Floor, 0.2), (Plinth, 0.2), (Feet, 0.6)],
        worktop: 0.4,
    },
    FurnitureKind {
        name: "cabinet",
        weight: 0.14,
        width: [0.5, 1.3],
        depth: [0.33, 0.5],
        height: [0.65, 1.5],
        largest: [0.8, 0.9],
        divide: 0.6,
        leaves: &[
            (Drawer, 0.34),
            (Door, 0.26),
            (DoubleDoor, 0.1),
            (FlapDown, 0.06),
            (FlapUp, 0.04),
            (SlidingPair, 0.1),
            (FixedPanel, 0.07),
            (Open, 0.08),
        ],
        bases: &[(Floor, 0.3), (Plinth, 0.4), (Feet, 0.3)],
        worktop: 0.4,
    },
    FurnitureKind {
        name: "sideboard",
        weight: 0.08,
        width: [1.1, 1.9],
        depth: [0.36, 0.48],
        height: [0.42, 0.95],
        largest: [0.65, 1.0],
        divide: 0.5,
        leaves: &[(Drawer, 0.35), (Door, 0.3), (FlapDown, 0.1), (SlidingPair, 0.12), (FixedPanel, 0.06), (Open, 0.13)],
        bases: &[(Floor, 0.1), (Plinth, 0.3), (Feet, 0.6)],
        worktop: 0.4,
    },
    FurnitureKind {
        name: "wardrobe",
        weight: 0.05,
        width: [0.8, 2.0],
        depth: [0.5, 0.62],
        height: [1.75, 2.15],
        largest: [0.65, 2.2],
        divide: 0.3,
        leaves: &[(Door, 0.6), (Drawer, 0.2), (DoubleDoor, 0.05), (FixedPanel, 0.05), (Open, 0.1)],
        bases: &[(Floor, 0.3), (Plinth, 0.6), (Feet, 0.1)],
        worktop: 0.0,
    },
    FurnitureKind {
        name: "kitchen-base",
        weight: 0.08,
        width: [0.6, 2.2],
        depth: [0.56, 0.6],
        height: [0.7, 0.78],
        largest: [0.65, 0.8],
        divide: 0.5,
        leaves: &[(Drawer, 0.45), (Door, 0.35), (DoubleDoor, 0.08), (FixedPanel, 0.07), (Open, 0.05)],
        bases: &[(Plinth, 0.9), (Feet, 0.1)],
        worktop: 1.0,
    },
    FurnitureKind {
        name: "wall-cabinet",
        weight: 0.05,
        width: [0.5, 1.3],
        depth: [0.3, 0.38],
        height: [0.36, 0.9],
        largest: [0.65, 0.8],
        divide: 0.3,
        leaves: &[(Door, 0.4), (FlapUp, 0.3), (FlapDown, 0.05), (DoubleDoor, 0.1), (SlidingPair, 0.05), (Open, 0.1)],
        bases: &[(Floor, 1.0)],
        worktop: 0.0,
    },
    FurnitureKind {
        name: "small-drawers",
        weight: 0.07,
        width: [0.6, 1.5],
        depth: [0.3, 0.42],
        height: [0.5, 1.4],
        largest: [0.34, 0.24],
        divide: 0.0,
        leaves: &[(Drawer, 0.9), (FixedPanel, 0.05), (Open, 0.05)],
        bases: &[(Floor, 0.5), (Plinth, 0.3), (Feet, 0.2)],
        worktop: 0.2,
    },
    FurnitureKind {
        name: "desk",
        weight: 0.05,
        width: [1.1, 1.7],
        depth: [0.55, 0.8],
        height: [0.70, 0.74],
        largest: [0.6, 0.3],
        divide: 0.3,
        leaves: &[(Drawer, 0.8), (Door, 0.12), (Open, 0.08)],
        bases: &[(Floor, 0.6), (Plinth, 0.2), (Feet, 0.2)],
        worktop: 1.0,
    },
];
