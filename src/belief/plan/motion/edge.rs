//! Paths and their edges: straight lines in joint space, each driven from rest to rest at a speed of its own.

pub(crate) use crate::plan::constants::motion_edge::{SLOWEST, SLOWNESS};
use armcal_core::streams::JointAngles;

/// A straight motion from rest to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Believed angles at the start.
    pub from: JointAngles,
    /// Believed angles at the end.
    pub to: JointAngles,
    /// Its duration over the shortest that rates and flow allow, at least 1.
    pub time_scale: f64,
}

/// Believed joint angles to pass, start and goal included.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// At least one.
    pub waypoints: Vec<JointAngles>,
    /// Of the edge behind each waypoint but the last.
    slowness: Vec<f64>,
}

impl Edge {
    /// The edge as quickly as rates and flow allow.
    #[must_use]
    pub fn at_full_speed(from: JointAngles, to: JointAngles) -> Self {
        Self { from, to, time_scale: 1.0 }
    }
}

impl Path {
    /// Through at least one waypoint, as quickly as rates and flow allow.
    #[must_use]
    pub fn at_full_speed(waypoints: Vec<JointAngles>) -> Self {
        let slowness = vec![1.0; waypoints.len().saturating_sub(1)];
        Self { waypoints, slowness }
    }

    /// The same as slowly as any.
    #[must_use]
    pub fn slowly(waypoints: Vec<JointAngles>) -> Self {
        let slowness = vec![SLOWEST; waypoints.len().saturating_sub(1)];
        Self { waypoints, slowness }
    }

    /// Nowhere: a path that edges are added to.
    pub(crate) fn at(start: JointAngles) -> Self {
        Self { waypoints: vec![start], slowness: Vec::new() }
    }

    /// Goes on to `to`.
    pub(crate) fn push(&mut self, to: JointAngles, slowness: f64) {
        self.waypoints.push(to);
        self.slowness.push(slowness);
    }

    /// One less than there are waypoints.
    #[must_use]
    pub fn n_edges(&self) -> usize {
        self.slowness.len()
    }

    /// The edge from waypoint `k` to the next.
    #[must_use]
    pub fn edge(&self, k: usize) -> Edge {
        Edge { from: self.waypoints[k], to: self.waypoints[k + 1], time_scale: self.slowness[k] }
    }

    /// All edges, from the start on.
    pub fn edges(&self) -> impl DoubleEndedIterator<Item = Edge> + '_ {
        (0..self.n_edges()).map(|k| self.edge(k))
    }
}
