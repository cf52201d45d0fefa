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
    /// Duration over the shortest that rates and flow allow, at least 1.
    pub time_scale: f64,
}

/// Believed joint angles to pass, start and goal included.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// Believed angles of the waypoints, at least one.
    pub waypoints: Vec<JointAngles>,
    /// Time scaling of the edge after each waypoint but the last.
    slowness: Vec<f64>,
}

impl Edge {
    /// Returns the edge at the highest speed that rates and flow allow.
    #[must_use]
    pub fn at_full_speed(from: JointAngles, to: JointAngles) -> Self {
        Self { from, to, time_scale: 1.0 }
    }
}

impl Path {
    /// Returns a path through at least one waypoint, at the highest speed that rates and flow allow.
    #[must_use]
    pub fn at_full_speed(waypoints: Vec<JointAngles>) -> Self {
        let slowness = vec![1.0; waypoints.len().saturating_sub(1)];
        Self { waypoints, slowness }
    }

    /// Returns a path through at least one waypoint, at the lowest speed that planning uses.
    #[must_use]
    pub fn slowly(waypoints: Vec<JointAngles>) -> Self {
        let slowness = vec![SLOWEST; waypoints.len().saturating_sub(1)];
        Self { waypoints, slowness }
    }

    /// Returns a path with only a start, to which edges are added.
    pub(crate) fn at(start: JointAngles) -> Self {
        Self { waypoints: vec![start], slowness: Vec::new() }
    }

    /// Appends an edge to `to`.
    pub(crate) fn push(&mut self, to: JointAngles, slowness: f64) {
        self.waypoints.push(to);
        self.slowness.push(slowness);
    }

    /// Returns the number of edges, one less than the number of waypoints.
    #[must_use]
    pub fn n_edges(&self) -> usize {
        self.slowness.len()
    }

    /// Returns the edge from waypoint `k` to the next.
    #[must_use]
    pub fn edge(&self, k: usize) -> Edge {
        Edge { from: self.waypoints[k], to: self.waypoints[k + 1], time_scale: self.slowness[k] }
    }

    /// Returns all edges, from the start on.
    pub fn edges(&self) -> impl DoubleEndedIterator<Item = Edge> + '_ {
        (0..self.n_edges()).map(|k| self.edge(k))
    }
}
