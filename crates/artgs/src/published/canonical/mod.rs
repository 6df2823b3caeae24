//! The start of the joint optimisation: canonical Gaussians and part centres from two separately fitted states.

pub(crate) mod cluster;
pub(crate) mod fps;
pub(crate) mod init;
pub(crate) mod matching;
pub(crate) mod motion;
mod spectral;
mod tree;
mod uninformed;

pub(crate) use init::{Canonical, CanonicalConfig, CanonicalStart, CentreSource, canonical_init};

use artgs_core::State;

/// A reason why there is no canonical start.
#[derive(Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
pub enum CanonicalError {
    /// Nothing to work on.
    #[error("there are no {0}")]
    Empty(&'static str),
    /// A diverged fit.
    #[error("the {} state has a Gaussian whose centre is not finite", .state.name())]
    NotFinite {
        /// The state.
        state: State,
    },
    /// The states cannot be averaged.
    #[error("the states store harmonics of degrees {0} and {1}")]
    Degrees(usize, usize),
    /// At least a static and a movable part are needed.
    #[error("{0} parts: an articulated object has at least 2, the static one included")]
    Parts(usize),
    /// The two states look alike, or almost.
    #[error("{points} points moved between the states, too few for {clusters} movable parts")]
    TooFewPoints {
        /// Points to cluster.
        points: usize,
        /// Clusters asked for.
        clusters: usize,
    },
    /// Random Gaussians could not be made.
    #[error("random Gaussians: {0}")]
    Random(String),
    /// The k-d tree refused the points.
    #[error("k-d tree: {0}")]
    Tree(String),
    /// The graph Laplacian could not be factorised.
    #[error("factorisation of the neighbourhood graph: {0}")]
    Factorisation(String),
}
