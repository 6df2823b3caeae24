//! Assets as files of simulators, browsers and renderers; one file per format.

pub mod glb;
pub mod splats;
pub mod spz;
pub mod usd;
mod values;

#[cfg(test)]
pub(crate) mod testing;
