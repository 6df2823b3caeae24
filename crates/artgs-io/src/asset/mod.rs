//! Assets as files of simulators, browsers and renderers; one file per format.

#[cfg(test)]
pub(crate) mod testing;
