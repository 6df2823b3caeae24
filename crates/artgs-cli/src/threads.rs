//! The thread pool.

use crate::failure::Failure;
use anyhow::Context;
use std::num::NonZeroUsize;

/// Sizes the thread pool that everything shares: at most four threads per processor.
pub(crate) fn use_threads(count: Option<NonZeroUsize>) -> Result<(), Failure> {
    /// More threads than this many per processor only cost memory.
    const MOST_PER_PROCESSOR: usize = 4;
    let Some(count) = count else { return Ok(()) };
    let processors = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let count = count.get().min(MOST_PER_PROCESSOR * processors);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build_global();
    pool.with_context(|| format!("cannot start {count} threads"))?;
    Ok(())
}
