//! Normal equations of the map and the Schur complement that marginalises the views.

use crate::tagmap::constants::normal_equations::UNDETERMINED;
use std::sync::Arc;

use nalgebra::{Matrix6, Vector6};

use crate::tagmap::problem::MapProblem;
use crate::tagmap::sparse::{Pattern, System};

/// The normal equations of the nodes, without the marginalised blocks.
pub(super) struct Reduced {
    pub(super) system: System,
    pub(super) right: Vec<Vector6<f64>>,
    /// Inverse of each block that was marginalised.
    pub(super) inverses: Vec<Matrix6<f64>>,
}

/// The normal equations at one state, before damping.
#[derive(Clone, Debug)]
pub(super) struct NormalEquations {
    pub(super) pattern: Arc<Pattern>,
    /// Own part and right side of each block.
    pub(super) own: Vec<Matrix6<f64>>,
    pub(super) own_right: Vec<Vector6<f64>>,
    /// Cross term of each observation: block by tag.
    pub(super) cross: Vec<Matrix6<f64>>,
    /// Parts of the nodes: diagonal, right side, and blocks off the diagonal that come from priors and attitudes.
    pub(super) nodes: Vec<Matrix6<f64>>,
    pub(super) nodes_right: Vec<Vector6<f64>>,
    pub(super) off_diagonal: Vec<(usize, usize, Matrix6<f64>)>,
    pub(super) cost: f64,
}

impl NormalEquations {
    /// Returns the reduced system with `damping` added to each diagonal, relative to it, and the inverses of the
    /// marginalised blocks.
    pub(super) fn reduce(&self, problem: &MapProblem<'_>, damping: f64) -> Option<Reduced> {
        let mut system = System::zeros(&self.pattern);
        let mut right = self.nodes_right.clone();
        let mut inverses = vec![Matrix6::zeros(); problem.blocks.len()];
        for (node, block) in self.nodes.iter().enumerate() {
            system.add(node, node, &damped(block, damping));
        }
        for (a, b, block) in &self.off_diagonal {
            system.add(*a, *b, block);
        }
        for (idx, block) in problem.blocks.iter().enumerate() {
            let nodes = block.range.clone().filter_map(|at| {
                let seen = &problem.observations[at];
                problem.tags[seen.tag].node.filter(|_| seen.is_used).map(|node| (at, node))
            });
            if let Some(own) = block.node {
                system.add(own, own, &damped(&self.own[idx], damping));
                right[own] += self.own_right[idx];
                for (at, node) in nodes {
                    system.add(own, node, &self.cross[at]);
                }
                continue;
            }
            if block.range.clone().all(|at| !problem.observations[at].is_used) {
                continue;
            }
            let inverse = damped(&self.own[idx], damping).cholesky()?.inverse();
            inverses[idx] = inverse;
            for (at, node) in nodes.clone() {
                let weighted = self.cross[at].transpose() * inverse;
                right[node] -= weighted * self.own_right[idx];
                for (other, other_node) in nodes.clone().take_while(|(other, _)| *other <= at) {
                    system.add(node, other_node, &-(weighted * self.cross[other]));
                }
            }
        }
        Some(Reduced { system, right, inverses })
    }

    /// Step of a marginalised block, from the steps of the nodes.
    pub(super) fn back_substitute(
        &self,
        problem: &MapProblem<'_>,
        idx: usize,
        inverse: &Matrix6<f64>,
        nodes: &[Vector6<f64>],
    ) -> Vector6<f64> {
        let mut right = self.own_right[idx];
        for at in problem.blocks[idx].range.clone() {
            if let Some(node) = problem.tags[problem.observations[at].tag].node {
                right -= self.cross[at] * nodes[node];
            }
        }
        inverse * right
    }
}

fn damped(block: &Matrix6<f64>, damping: f64) -> Matrix6<f64> {
    let mut out = *block;
    for k in 0..6 {
        out[(k, k)] = out[(k, k)] * (1.0 + damping) + if damping > 0.0 { UNDETERMINED } else { 0.0 };
    }
    out
}
