//! Residuals, Jacobians and normal equations.
//!
//! A corner c (tag frame) of a tag at T (frame_from_tag) is seen by a camera at V (frame_from_camera) at
//! `pixel = project(X c)`, X = V^-1 T. Both poses are perturbed on the right, and a motion of the tag is one of the
//! camera the other way: `xi_V = -Ad(X) xi_T`. Residual = whitened (measured - predicted).

use crate::tagmap::constants::linearize::UNSEEN_SIGMAS;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix6, Point3, Vector2, Vector6};

use crate::measure::ImagePoint;
use crate::tagmap::attitude;
use crate::tagmap::normal_equations::NormalEquations;
use crate::tagmap::problem::{MapProblem, Observation, TagState};
use crate::tagmap::sparse::Pattern;
use armcal_core::numeric::Loss;
use armcal_core::optics::CameraModel;
use armcal_core::spatial::{adjoint, log};

/// Whitened residuals of the four corners; `None` for one that the lens does not see.
pub(super) fn residuals(
    camera: &CameraModel,
    camera_from_tag: &Isometry3<f64>,
    seen: &Observation,
) -> [Option<Vector2<f64>>; 4] {
    let rotation = camera_from_tag.rotation.to_rotation_matrix();
    std::array::from_fn(|k| {
        let point = rotation * seen.corners_m[k] + camera_from_tag.translation.vector;
        camera.project(&point).map(|pixel| seen.whiten[k] * (seen.corners_px[k] - pixel))
    })
}

/// Squared lengths of the whitened residuals.
pub(super) fn squares(camera: &CameraModel, camera_from_tag: &Isometry3<f64>, seen: &Observation) -> [f64; 4] {
    residuals(camera, camera_from_tag, seen).map(|r| r.map_or(UNSEEN_SIGMAS * UNSEEN_SIGMAS, |r| r.norm_squared()))
}

impl NormalEquations {
    pub(super) fn new(problem: &MapProblem<'_>) -> Self {
        Self {
            pattern: Arc::new(Pattern::new(problem.n_nodes, edges(problem))),
            own: vec![Matrix6::zeros(); problem.blocks.len()],
            own_right: vec![Vector6::zeros(); problem.blocks.len()],
            cross: vec![Matrix6::zeros(); problem.observations.len()],
            nodes: vec![Matrix6::zeros(); problem.n_nodes],
            nodes_right: vec![Vector6::zeros(); problem.n_nodes],
            off_diagonal: Vec::new(),
            cost: 0.0,
        }
    }

    /// Linearizes at the problem's state.
    pub(super) fn update(&mut self, problem: &MapProblem<'_>, loss: Loss) {
        self.cost = 0.0;
        self.nodes.fill(Matrix6::zeros());
        self.nodes_right.fill(Vector6::zeros());
        self.off_diagonal.clear();
        for (idx, block) in problem.blocks.iter().enumerate() {
            self.own[idx] = Matrix6::zeros();
            self.own_right[idx] = Vector6::zeros();
            for at in block.range.clone() {
                self.cross[at] = Matrix6::zeros();
                if problem.observations[at].is_used {
                    self.add_observation(problem, idx, at, loss);
                }
            }
        }
        for tag in &problem.tags {
            self.add_prior(problem, tag);
        }
        attitude::add(self, problem);
    }

    fn add_observation(&mut self, problem: &MapProblem<'_>, idx: usize, at: usize, loss: Loss) {
        let block = &problem.blocks[idx];
        let seen = &problem.observations[at];
        let tag = &problem.tags[seen.tag];
        let camera = &problem.cameras[seen.camera];
        let camera_from_tag = block.pose.inv_mul(&tag.pose);
        let (mut h, mut g) = (Matrix6::zeros(), Vector6::zeros());
        for k in 0..4 {
            let point = camera_from_tag * Point3::from(seen.corners_m[k]);
            let Some(image) = ImagePoint::of(camera, &point.coords) else {
                self.cost += loss.of(UNSEEN_SIGMAS * UNSEEN_SIGMAS).0;
                continue;
            };
            let residual = seen.whiten[k] * (seen.corners_px[k] - image.pixel);
            let (cost, weight) = loss.of(residual.norm_squared());
            self.cost += cost;
            let rows = seen.whiten[k] * image.jacobian();
            let weighted = rows.transpose() * weight;
            h += weighted * rows;
            g += weighted * residual;
        }
        self.own[idx] += h;
        self.own_right[idx] += g;
        if let Some(node) = tag.node {
            // A motion of the tag is one of the camera the other way.
            let by_tag = -adjoint(&camera_from_tag);
            self.cross[at] += h * by_tag;
            self.nodes[node] += by_tag.transpose() * (h * by_tag);
            self.nodes_right[node] += by_tag.transpose() * g;
        }
    }

    /// Adds the prior of a tag: residual = log(T^-1 B P) for a tag at T with place P on a body at B. For the group's
    /// own body B is the identity.
    fn add_prior(&mut self, problem: &MapProblem<'_>, tag: &TagState) {
        let (Some(prior), Some(node)) = (&tag.prior, tag.node) else { return };
        let owner = prior.owner.map(|owner| &problem.extras[owner]);
        let expected = owner.map_or(prior.pose, |owner| owner.pose * prior.pose);
        let residual = log(&tag.pose.inv_mul(&expected));
        let information = Matrix6::from_diagonal(&prior.information);
        let pulled = information * residual;
        self.cost += residual.dot(&pulled);
        self.nodes[node] += information;
        self.nodes_right[node] += pulled;
        if let Some(owner) = owner {
            let jacobian = -adjoint(&prior.pose.inverse());
            self.nodes[owner.node] += jacobian.transpose() * information * jacobian;
            self.nodes_right[owner.node] += jacobian.transpose() * pulled;
            self.off_diagonal.push((node, owner.node, information * jacobian));
        }
    }
}

/// Computes the cost without derivatives.
pub(super) fn cost(problem: &MapProblem<'_>, loss: Loss) -> f64 {
    let mut cost = attitude::cost(problem);
    for block in &problem.blocks {
        for seen in problem.observations[block.range.clone()].iter().filter(|seen| seen.is_used) {
            let camera_from_tag = block.pose.inv_mul(&problem.tags[seen.tag].pose);
            let squares = squares(&problem.cameras[seen.camera], &camera_from_tag, seen);
            cost += squares.into_iter().map(|n2| loss.of(n2).0).sum::<f64>();
        }
    }
    for tag in &problem.tags {
        let (Some(prior), Some(_)) = (&tag.prior, tag.node) else { continue };
        let owner = prior.owner.map_or_else(Isometry3::identity, |owner| problem.extras[owner].pose);
        let residual = log(&tag.pose.inv_mul(&(owner * prior.pose)));
        cost += residual.component_mul(&prior.information).dot(&residual);
    }
    cost
}

/// Pairs of nodes that share a block of the reduced system.
fn edges(problem: &MapProblem<'_>) -> std::collections::BTreeSet<(usize, usize)> {
    let mut edges = std::collections::BTreeSet::new();
    for block in &problem.blocks {
        let mut nodes: Vec<usize> =
            block.range.clone().filter_map(|at| problem.tags[problem.observations[at].tag].node).collect();
        nodes.extend(block.node);
        for (i, a) in nodes.iter().enumerate() {
            edges.extend(nodes[..i].iter().map(|b| (*a.max(b), *a.min(b))));
        }
    }
    for tag in &problem.tags {
        if let (Some(node), Some(owner)) = (tag.node, tag.prior.as_ref().and_then(|prior| prior.owner)) {
            edges.insert((node, problem.extras[owner].node));
        }
    }
    edges.extend(attitude::edges(problem));
    edges
}
