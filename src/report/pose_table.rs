//! Tables of poses before an input map says what their columns are: what `inspect` prints of them, and a proposed map.

mod proposal;
mod roles;
mod text;

pub use proposal::propose_table_map;
pub use text::{TableInspection, inspect_table};
