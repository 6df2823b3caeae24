//! Reports of batches: the rows that `artgs batch` and `artgs.ray` write, tabulated and plotted on a page.

mod causes;
mod changes;
mod page;
mod read;
mod row;
mod summary;
mod tables;

pub(crate) use causes::causes;
pub use causes::{Cause, Retry};
pub use changes::Changes;
pub use page::{Origin, page};
pub use read::{TableError, is_reading, read_rows};
pub(crate) use read::{guarded, parquet_fields};
pub use row::Row;
pub use summary::{Spread, Summary};
