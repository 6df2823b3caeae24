//! Procedural materials: colour as a function of a point of the part, so that it moves with it.

use glam::DVec3;
use std::f64::consts::TAU;

/// Colour as a function of a point of the part. Colours are sRGB in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Material {
    /// One colour, as most faces of scanned furniture catalogues have.
    Plain {
        /// The colour.
        color: [f64; 3],
    },
    /// Wavy stripes along an axis.
    Wood {
        /// Axis the grain follows: 0 x, 1 y, 2 z.
        grain: usize,
        /// Colour between the stripes.
        light: [f64; 3],
        /// Colour of the stripes.
        dark: [f64; 3],
        /// Distance between stripes, scene units.
        period: f64,
    },
    /// A three-dimensional checkerboard.
    Checks {
        /// Colour of even cells.
        even: [f64; 3],
        /// Colour of odd cells.
        odd: [f64; 3],
        /// Edge of a cell, scene units.
        cell: f64,
    },
    /// Clouds of a second colour, as stone, plastic with grains or rust have.
    Speckle {
        /// Colour of the ground.
        base: [f64; 3],
        /// Colour of the clouds.
        spots: [f64; 3],
        /// Size of a cloud, scene units.
        size: f64,
    },
    /// Fine scratches along an axis.
    Brushed {
        /// Axis the scratches follow: 0 x, 1 y, 2 z.
        along: usize,
        /// Mean colour.
        color: [f64; 3],
        /// Distance between scratches, scene units.
        period: f64,
    },
    /// Straight stripes of two colours across an axis.
    Stripes {
        /// Axis the stripes lie across: 0 x, 1 y, 2 z.
        across: usize,
        /// Colour of even stripes.
        even: [f64; 3],
        /// Colour of odd stripes.
        odd: [f64; 3],
        /// Width of a stripe, scene units.
        width: f64,
    },
}

impl Material {
    /// Colour at a point of the part.
    pub(crate) fn color(&self, p: DVec3, seed: u64) -> DVec3 {
        match *self {
            Self::Plain { color } => DVec3::from(color),
            Self::Wood { grain, light, dark, period } => {
                let mut stretched = p / period;
                stretched[grain] *= 0.15;
                let across: f64 = (0..3).filter(|&i| i != grain).map(|i| stretched[i]).sum();
                let wave = across + 1.2 * value_noise(stretched * 0.9, seed);
                let stripe = 0.5 + 0.5 * (TAU * wave).sin();
                let grey = 0.9 + 0.2 * value_noise(p / (3.0 * period), seed ^ 0x9e37);
                DVec3::from(light).lerp(DVec3::from(dark), stripe) * grey
            }
            Self::Checks { even, odd, cell } => {
                let parity = (p / cell).floor().to_array().iter().sum::<f64>().rem_euclid(2.0);
                let grey = 0.9 + 0.2 * value_noise(p / (2.0 * cell), seed);
                DVec3::from(if parity < 0.5 { even } else { odd }) * grey
            }
            Self::Speckle { base, spots, size } => {
                let cloud = 0.65 * value_noise(p / size, seed) + 0.35 * value_noise(p / (0.4 * size), seed ^ 0x51);
                DVec3::from(base).lerp(DVec3::from(spots), ((cloud - 0.35) / 0.3).clamp(0.0, 1.0))
            }
            Self::Brushed { along, color, period } => {
                let mut stretched = p / period;
                stretched[along] *= 0.06;
                let grey = 0.82 + 0.2 * value_noise(stretched, seed) + 0.16 * value_noise(p / (9.0 * period), seed ^ 7);
                DVec3::from(color) * grey
            }
            Self::Stripes { across, even, odd, width } => {
                let parity = (p[across] / width).floor().rem_euclid(2.0);
                let grey = 0.92 + 0.16 * value_noise(p / (2.0 * width), seed);
                DVec3::from(if parity < 0.5 { even } else { odd }) * grey
            }
        }
    }
}

/// A number in [0, 1) that depends on the cell of a grid.
pub(crate) fn cell_noise(cell: [i64; 3], seed: u64) -> f64 {
    let mut h = seed ^ 0x2545_f491_4f6c_dd1d;
    for v in cell {
        h = (h ^ v as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        h ^= h >> 29;
    }
    (h >> 11) as f64 / (1u64 << 53) as f64
}

/// Smooth noise in [0, 1] with features of size 1.
pub(crate) fn value_noise(p: DVec3, seed: u64) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let f = f * f * (3.0 - 2.0 * f);
    let corner = |x: i64, y: i64, z: i64| cell_noise([cell.x as i64 + x, cell.y as i64 + y, cell.z as i64 + z], seed);
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let row = |y, z| mix(corner(0, y, z), corner(1, y, z), f.x);
    mix(mix(row(0, 0), row(1, 0), f.y), mix(row(0, 1), row(1, 1), f.y), f.z)
}
