//! Settings of the first canonical Gaussians.

use serde::{Deserialize, Serialize};

/// Where first canonical Gaussians are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StartSource {
    /// On the labelled surface points of both states.
    #[default]
    Surface,
    /// As many, uniform in the box of those, near-grey, with the part of the nearest: an ablation.
    Random,
}

/// Where the parts of canonical Gaussians come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PartSource {
    /// From discovery.
    #[default]
    Labels,
    /// From training, which starts with what `canonical` makes of the surface points of both states; there is no
    /// discovery. An ablation.
    Learnt,
}

/// Settings of the first canonical Gaussians.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StartConfig {
    /// Where they are.
    pub from: StartSource,
    /// Where their parts come from.
    pub parts: PartSource,
    /// Distance between Gaussians relative to the distance between labelled points.
    pub spacing: f64,
    /// Standard deviation along the surface relative to the distance between Gaussians.
    pub spread: f64,
    /// Standard deviation along the normal relative to that along the surface.
    pub flatness: f64,
    /// Opacity in (0, 1).
    pub opacity: f64,
    /// Degree of harmonics, 0 to 3.
    pub sh_degree: usize,
}

impl Default for StartConfig {
    fn default() -> Self {
        Self {
            from: StartSource::Surface,
            parts: PartSource::Labels,
            spacing: 1.0,
            spread: 0.5,
            flatness: 0.2,
            opacity: 0.9,
            sh_degree: 2,
        }
    }
}
