//! Paths between configurations that keep clear for every arm within the joint errors.
//!
//! `planner` tries the straight edge and, where it is blocked, `rrt_connect` and shortcuts; each edge is certified, not sampled.

pub(crate) mod planner;
mod rrt_connect;
#[cfg(test)]
mod tests;

pub use planner::{PathError, PathPlanner};
