//! Paths between configurations that keep the margin for every arm within the joint errors.
//!
//! `planner` tries the straight edge; if it is blocked, `rrt_connect` and shortcuts. `edge_check` certifies each edge
//! instead of sampling it.

mod edge_check;
mod error;
mod planner;
mod rrt_connect;
#[cfg(test)]
mod tests;

pub use edge_check::PathPlanner;
pub use error::PathError;
