//! Fitting Gaussians to photographs: losses, optimiser, densification, initialisation and the training loop.

pub mod adam;
pub mod images;
pub mod loss;
pub mod schedule;
pub mod ssim;
