//! Proves that every arm within the joint errors keeps clear, at one configuration or along an edge.
//!
//! `sweep` looks at stretches of an edge from the coarse to the fine, `error_box` halves the joint errors of a pair where halving the edge
//! does not help, `motion_bound` is the most that one shape moves against another within such a region. `violation` is what planning asks.

mod error_box;
mod motion_bound;
mod sweep;
#[cfg(test)]
mod tests;
mod violation;
