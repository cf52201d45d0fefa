//! Attitude sensor: rotation of a moving body against a fixed one.
//!
//! With the sensor's A = world_from_moving, the rotations of the two blocks M = moving_from_camera and F =
//! fixed_from_camera of one view, and W = world_from_fixed, unknown but the same in all views: `E = F^-1 W^-1 A M` is
//! the identity but for the sensor's error. residual = -log(E); on the right, dE = xi_M - xi_F - F^-1 xi_W.

use nalgebra::{Isometry3, Matrix3, Matrix6, UnitQuaternion, Vector3};

use crate::tagmap::normal_equations::NormalEquations;
use crate::tagmap::problem::{AttitudeLink, Block, Extra, MapProblem};

fn error(problem: &MapProblem<'_>, link: &AttitudeLink) -> Vector3<f64> {
    let (moving, fixed) = (&problem.blocks[link.moving].pose.rotation, &problem.blocks[link.fixed].pose.rotation);
    let world = &problem.extras[link.world].pose.rotation;
    (fixed.inverse() * world.inverse() * link.world_from_moving * moving).scaled_axis()
}

pub(super) fn cost(problem: &MapProblem<'_>) -> f64 {
    problem.links.iter().map(|link| error(problem, link).norm_squared() * link.information).sum()
}

pub(super) fn edges(problem: &MapProblem<'_>) -> impl Iterator<Item = (usize, usize)> {
    problem.links.iter().flat_map(|link| {
        let nodes = nodes(problem, link);
        [(nodes[0], nodes[1]), (nodes[0], nodes[2]), (nodes[1], nodes[2])]
    })
}

/// Nodes of moving, fixed, world. Linked blocks always have one.
fn nodes(problem: &MapProblem<'_>, link: &AttitudeLink) -> [usize; 3] {
    let of = |block: usize| problem.blocks[block].node.unwrap_or_default();
    [of(link.moving), of(link.fixed), problem.extras[link.world].node]
}

pub(super) fn add(normal: &mut NormalEquations, problem: &MapProblem<'_>) {
    for link in &problem.links {
        let residual = -error(problem, link);
        let fixed = problem.blocks[link.fixed].pose.rotation.inverse().to_rotation_matrix();
        let jacobians = [Matrix3::identity(), -Matrix3::identity(), -fixed.matrix()];
        let nodes = nodes(problem, link);
        normal.cost += residual.norm_squared() * link.information;
        for (i, (a, of_a)) in nodes.iter().zip(&jacobians).enumerate() {
            normal.nodes[*a] += rotational(&(of_a.transpose() * of_a * link.information));
            let mut right = normal.nodes_right[*a].fixed_rows_mut::<3>(3);
            right += of_a.transpose() * residual * link.information;
            for (b, of_b) in nodes.iter().zip(&jacobians).take(i) {
                let block = rotational(&(of_a.transpose() * of_b * link.information));
                normal.off_diagonal.push((*a, *b, block));
            }
        }
    }
    // The position of the world frame has no effect, so it is held.
    for link in problem.links.iter().take(1) {
        let node = problem.extras[link.world].node;
        for k in 0..3 {
            normal.nodes[node][(k, k)] += 1.0;
        }
    }
}

fn rotational(block: &Matrix3<f64>) -> Matrix6<f64> {
    let mut out = Matrix6::zeros();
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(block);
    out
}

/// Groups to link: views with an attitude show the moving group and a static one.
pub(super) struct Wanted {
    pub(super) moving_group: usize,
    pub(super) fixed_group: usize,
    pub(super) information: f64,
}

/// Links the blocks; gives them and the world's rotation their nodes.
pub(super) fn link(problem: &mut MapProblem<'_>, attitudes: &[Option<UnitQuaternion<f64>>], wanted: &Wanted) {
    // Blocks are sorted by view and group.
    let find = |blocks: &[Block], view: usize, group: usize| {
        blocks.binary_search_by_key(&(view, group), |block| (block.view, block.group)).ok()
    };
    let mut pairs = Vec::new();
    for (view, attitude) in attitudes.iter().enumerate() {
        let Some(attitude) = attitude else { continue };
        let moving = find(&problem.blocks, view, wanted.moving_group);
        let fixed = find(&problem.blocks, view, wanted.fixed_group);
        if let (Some(moving), Some(fixed)) = (moving, fixed) {
            pairs.push((moving, fixed, *attitude));
        }
    }
    if pairs.len() < 2 {
        return;
    }
    let world = problem.extras.len();
    let turns = pairs.iter().map(|(moving, fixed, attitude)| {
        attitude * problem.blocks[*moving].pose.rotation * problem.blocks[*fixed].pose.rotation.inverse()
    });
    let start = mean_rotation(&turns.collect::<Vec<_>>());
    problem.extras.push(Extra { node: problem.n_nodes, pose: Isometry3::from_parts(Default::default(), start) });
    problem.n_nodes += 1;
    for (moving, fixed, world_from_moving) in pairs {
        for block in [moving, fixed] {
            problem.blocks[block].node = Some(problem.n_nodes);
            problem.n_nodes += 1;
        }
        let information = wanted.information;
        problem.links.push(AttitudeLink { moving, fixed, world, world_from_moving, information });
    }
}

/// Mean rotation by least squares of the angles, starting from the first.
fn mean_rotation(turns: &[UnitQuaternion<f64>]) -> UnitQuaternion<f64> {
    let Some(mut mean) = turns.first().copied() else { return UnitQuaternion::identity() };
    for _ in 0..10 {
        let step: Vector3<f64> = turns.iter().map(|turn| (mean.inverse() * turn).scaled_axis()).sum();
        mean *= UnitQuaternion::from_scaled_axis(step / turns.len() as f64);
    }
    mean
}
