//! What only training by the published method needs: a learnt membership of Gaussians in parts, and the Chamfer term.

pub(crate) mod chamfer;
pub(crate) mod membership;
