//! Certificates that every arm within the joint errors keeps the margin, at one configuration or along an edge.
//!
//! `sweep` tests intervals of an edge from coarse to fine. `error_box` halves the joint errors of a pair if halving the
//! edge does not help. `motion_bound` is the largest displacement of one shape against another within such a region.
//! `violation` is the interface for planning.

mod error_box;
mod motion_bound;
#[cfg(test)]
mod random_arms;
mod sweep;
#[cfg(test)]
mod tests;
mod violation;
