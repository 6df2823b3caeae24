//! Assets as files of simulators, browsers and renderers; one file per format.

pub mod glb;
pub mod splats;
pub mod spz;
// usd
mod values;

#[cfg(test)]
pub(crate) mod testing;
