//! Paths between poses that keep clear for every arm within the joint errors.
//!
//! An edge is certified, not sampled: it is free where the clearance at its middle exceeds what any point of the arm can
//! move over half of it, else it is halved (Schwarzer, Saha and Latombe 2005). Where the straight edge is blocked, an
//! RRT-Connect (Kuffner and LaValle 2000) looks for a way round.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::bounds::JointErrorBounds;
use super::clearance::ClearanceModel;
use crate::kinematics::JointLimits;
use crate::streams::JointAngles;

/// Believed joint angles to pass, start and goal included; straight lines in joint space between.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    pub waypoints: Vec<JointAngles>,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PathError {
    #[error("no way round was found after {tried} attempts; what blocks the straight way is {nearest}")]
    Blocked { tried: usize, nearest: String },
}

/// Plans paths under one belief.
#[derive(Clone, Copy)]
pub struct PathPlanner<'a> {
    pub clearance: &'a ClearanceModel<'a>,
    pub bounds: &'a JointErrorBounds,
    pub limits: &'a [JointLimits],
    /// Free water to keep, m.
    pub margin_m: f64,
    pub max_samples: usize,
}

/// Longest step by which a tree grows, rad.
const STEP_RAD: f64 = 0.35;

impl PathPlanner<'_> {
    /// Whether every arm within the bounds keeps the margin at `angles`.
    #[must_use]
    pub fn is_free(&self, angles: &JointAngles) -> bool {
        self.clearance.too_near(angles, self.bounds, self.margin_m).is_none()
    }

    /// Whether every arm within the bounds keeps the margin along the straight edge.
    #[must_use]
    pub fn is_edge_free(&self, from: &JointAngles, to: &JointAngles) -> bool {
        self.clearance.too_near_between(from, to, self.bounds, self.margin_m).is_none()
    }

    /// A path from `from` to `to`, both of which must be free.
    ///
    /// # Errors
    /// [`PathError::Blocked`] when none was found within the budget of samples.
    pub fn plan(&self, from: &JointAngles, to: &JointAngles, rng: &mut ChaCha8Rng) -> Result<Path, PathError> {
        if self.is_edge_free(from, to) {
            return Ok(Path { waypoints: vec![*from, *to] });
        }
        let mut trees = [Tree::rooted(*from), Tree::rooted(*to)];
        for attempt in 0..self.max_samples {
            let sample = JointAngles::from_fn(from.len(), |j| {
                let limits = self.limits[j];
                if from[j] == to[j] { from[j] } else { rng.random_range(limits.lower_rad..=limits.upper_rad) }
            });
            let grow = attempt % 2;
            let Some(new) = self.extend(&mut trees[grow], &sample) else { continue };
            let target = trees[grow].nodes[new].0;
            if let Some(other) = self.connect(&mut trees[1 - grow], &target) {
                let (first, second) = if grow == 0 { (new, other) } else { (other, new) };
                let mut waypoints = trees[0].branch(first);
                waypoints.reverse();
                waypoints.extend(trees[1].branch(second));
                return Ok(Path { waypoints: self.shortened(waypoints) });
            }
        }
        let nearest = self.first_block(from, to);
        Err(PathError::Blocked { tried: self.max_samples, nearest })
    }

    fn extend(&self, tree: &mut Tree, target: &JointAngles) -> Option<usize> {
        let near = tree.nearest(target);
        let from = tree.nodes[near].0;
        let scale = (STEP_RAD / from.max_abs_difference(target).max(1e-9)).min(1.0);
        let to = JointAngles::from_fn(from.len(), |j| from[j] + scale * (target[j] - from[j]));
        (self.is_free(&to) && self.is_edge_free(&from, &to)).then(|| tree.add(to, near))
    }

    /// Grows `tree` straight towards `target` until it gets there (its node) or is stopped (`None`).
    fn connect(&self, tree: &mut Tree, target: &JointAngles) -> Option<usize> {
        loop {
            let new = self.extend(tree, target)?;
            if tree.nodes[new].0.max_abs_difference(target) < 1e-9 {
                return Some(new);
            }
        }
    }

    /// Leaves out waypoints while the straight edge across stays certified.
    fn shortened(&self, waypoints: Vec<JointAngles>) -> Vec<JointAngles> {
        let mut short = vec![waypoints[0]];
        let mut at = 0;
        while at + 1 < waypoints.len() {
            let mut next = at + 1;
            for far in (at + 2..waypoints.len()).rev() {
                if self.is_edge_free(&waypoints[at], &waypoints[far]) {
                    next = far;
                    break;
                }
            }
            short.push(waypoints[next]);
            at = next;
        }
        short
    }

    fn first_block(&self, from: &JointAngles, to: &JointAngles) -> String {
        let steps = 40;
        (0..=steps)
            .map(|k| {
                JointAngles::from_fn(from.len(), |j| from[j] + (to[j] - from[j]) * f64::from(k) / f64::from(steps))
            })
            .filter_map(|angles| self.clearance.too_near(&angles, self.bounds, self.margin_m))
            .min_by(|a, b| a.distance_m.total_cmp(&b.distance_m))
            .map_or_else(String::new, |nearest| nearest.to_string())
    }
}

struct Tree {
    /// Angles and parent.
    nodes: Vec<(JointAngles, usize)>,
}

impl Tree {
    fn rooted(root: JointAngles) -> Self {
        Self { nodes: vec![(root, 0)] }
    }

    fn add(&mut self, angles: JointAngles, parent: usize) -> usize {
        self.nodes.push((angles, parent));
        self.nodes.len() - 1
    }

    fn nearest(&self, target: &JointAngles) -> usize {
        let distance =
            |angles: &JointAngles| angles.iter().zip(target.iter()).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let by_distance = |a: &usize, b: &usize| distance(&self.nodes[*a].0).total_cmp(&distance(&self.nodes[*b].0));
        (0..self.nodes.len()).min_by(by_distance).unwrap_or(0)
    }

    /// From a node to the root.
    fn branch(&self, mut node: usize) -> Vec<JointAngles> {
        let mut branch = vec![self.nodes[node].0];
        while node != 0 {
            node = self.nodes[node].1;
            branch.push(self.nodes[node].0);
        }
        branch
    }
}
