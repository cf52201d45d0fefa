//! Tables of poses before an input map says what their columns are: what `inspect` prints of them, and a proposed map.
//!
//! `roles` takes each column's meaning from its name, `winding` the order of corners from the cells, `pair` finds what
//! joins a table of the joints and one of the tags. `text` is what is printed, `proposal` the map.

mod pair;
mod proposal;
mod roles;
#[cfg(test)]
mod tests;
mod text;
mod winding;

pub use pair::{LookedAt, neighbours};
pub use proposal::{ProposedTableMap, propose_table_map};
pub use text::{TableInspection, inspect_table};
