//! Tables of poses that have no input map yet: their description by `inspect`, and a proposed map.
//!
//! `roles` takes each column's meaning from its name, `winding` the order of corners from the cells. `pair` finds the
//! columns that join a table of the joints and one of the tags. `text` is the printed description, `proposal` the map.

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
