//! Effect of further unknowns: the motion of the corners, while the poses of cameras and tags follow.
//!
//! Residual r, poses x, further unknowns u: `r - P x - U u`. Without the poses the information on u is
//! `H = U^T U - U^T P (P^T P)^-1 P^T U`, and at the solution of the poses the right side is `b = U^T r`. The step is
//! `H^-1 b`, and what it gains of the sum of squares `b^T H^-1 b` (score test, Rao 1948).

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Dyn, Isometry3, Matrix6, OMatrix, Point3, U2, U6, Vector6};

use crate::measure::ImagePoint;
use crate::tagmap::constants::columns::DETERMINED;
use crate::tagmap::normal_equations::NormalEquations;
use crate::tagmap::problem::{MapProblem, Observation};
use crate::tagmap::sparse::Factor;
use armcal_core::numeric::Loss;
use armcal_core::optics::CameraModel;
use armcal_core::spatial::adjoint;

/// A corner of a used detection as the problem predicts it.
pub(super) struct Corner<'c> {
    pub(super) seen: &'c Observation,
    pub(super) camera: &'c CameraModel,
    pub(super) camera_from_tag: Isometry3<f64>,
    /// Position in the camera's frame, m.
    pub(super) point: Point3<f64>,
    pub(super) image: ImagePoint,
}

/// Jacobian d(pixel)/d(unknown) of a corner, one column for each unknown.
pub(super) type ByUnknown = OMatrix<f64, U2, Dyn>;

/// Further unknowns of the map.
pub(super) struct Columns<'c> {
    pub(super) n: usize,
    /// Returns true for detections that the unknowns move.
    pub(super) concerns: &'c dyn Fn(&Observation) -> bool,
    /// Jacobian of a corner with the given number; `None` where the lens does not see the corner.
    pub(super) by_unknown: &'c dyn Fn(&Corner<'_>, usize) -> Option<ByUnknown>,
}

/// Information on further unknowns.
pub(super) struct Information {
    pub(super) matrix: DMatrix<f64>,
    /// Diagonal of the matrix with all poses held.
    with_poses_held: DVector<f64>,
    pub(super) right: DVector<f64>,
    /// Jacobians d(pose of the node)/d(unknowns).
    pub(super) nodes: Vec<OMatrix<f64, U6, Dyn>>,
}

impl Information {
    /// The step and its decrease of the sum of squares; `None` where the views do not determine it.
    pub(super) fn step(&self) -> Option<(DVector<f64>, f64)> {
        if (0..self.right.len()).any(|k| self.matrix[(k, k)] <= DETERMINED * self.with_poses_held[k]) {
            return None;
        }
        let step = self.matrix.clone().cholesky()?.solve(&self.right);
        let gain = step.dot(&self.right);
        gain.is_finite().then_some((step, gain))
    }
}

/// The poses' normal equations at a solution, factorized for any right side.
pub(super) struct Linearized<'p, 'a> {
    problem: &'p MapProblem<'a>,
    loss: Loss,
    normal: NormalEquations,
    factor: Factor,
    inverses: Vec<Matrix6<f64>>,
}

/// Products of the columns with themselves, the residuals and the poses.
struct Sums {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    /// Products for each block that the columns move.
    blocks: BTreeMap<usize, OMatrix<f64, U6, Dyn>>,
    nodes: BTreeMap<usize, OMatrix<f64, U6, Dyn>>,
}

impl<'p, 'a> Linearized<'p, 'a> {
    /// Linearizes at the solution; `None` where the views do not determine every pose.
    pub(super) fn of(problem: &'p MapProblem<'a>, loss: Loss) -> Option<Self> {
        let mut normal = NormalEquations::new(problem);
        normal.update(problem, loss);
        let reduced = normal.reduce(problem, 0.0)?;
        let (factor, inverses) = (reduced.system.factorize()?, reduced.inverses);
        Some(Self { problem, loss, normal, factor, inverses })
    }

    pub(super) fn information(&self, columns: &Columns<'_>) -> Information {
        let sums = self.sums(columns);
        let mut matrix = sums.matrix.clone();
        let mut by_node = vec![OMatrix::<f64, U6, Dyn>::zeros(columns.n); self.problem.n_nodes];
        for column in 0..columns.n {
            let nodes = self.followed(&sums, column);
            for (idx, cross) in &sums.blocks {
                let pull = cross.transpose() * self.block_followed(&sums, *idx, column, &nodes);
                matrix.column_mut(column).axpy(-1.0, &pull, 1.0);
            }
            for (node, cross) in &sums.nodes {
                matrix.column_mut(column).axpy(-1.0, &(cross.transpose() * nodes[*node]), 1.0);
            }
            by_node.iter_mut().zip(&nodes).for_each(|(by, node)| by.set_column(column, &-node));
        }
        let matrix = 0.5 * (&matrix + matrix.transpose());
        Information { matrix, with_poses_held: sums.matrix.diagonal(), right: sums.right, nodes: by_node }
    }

    fn sums(&self, columns: &Columns<'_>) -> Sums {
        let (blocks, nodes) = (BTreeMap::new(), BTreeMap::new());
        let mut sums =
            Sums { matrix: DMatrix::zeros(columns.n, columns.n), right: DVector::zeros(columns.n), blocks, nodes };
        for (idx, block) in self.problem.blocks.iter().enumerate() {
            for seen in &self.problem.observations[block.range.clone()] {
                if seen.is_used && (columns.concerns)(seen) {
                    self.add(&mut sums, columns, seen, idx);
                }
            }
        }
        sums
    }

    fn add(&self, sums: &mut Sums, columns: &Columns<'_>, seen: &Observation, idx: usize) {
        let tag = &self.problem.tags[seen.tag];
        let camera = &self.problem.cameras[seen.camera];
        let camera_from_tag = self.problem.blocks[idx].pose.inv_mul(&tag.pose);
        let zeros = || OMatrix::<f64, U6, Dyn>::zeros(columns.n);
        for k in 0..4 {
            let point = camera_from_tag * Point3::from(seen.corners_m[k]);
            let Some(image) = ImagePoint::of(camera, &point.coords) else { continue };
            let corner = Corner { seen, camera, camera_from_tag, point, image };
            let Some(by_unknown) = (columns.by_unknown)(&corner, k) else { continue };
            let residual = seen.whiten[k] * (seen.corners_px[k] - image.pixel);
            let (_, weight) = self.loss.of(residual.norm_squared());
            let own = seen.whiten[k] * by_unknown;
            let cross = (seen.whiten[k] * image.jacobian()).transpose() * &own * weight;
            sums.matrix += own.transpose() * &own * weight;
            sums.right += own.transpose() * residual * weight;
            *sums.blocks.entry(idx).or_insert_with(zeros) += &cross;
            if let Some(node) = tag.node {
                // A motion of the tag is one of the camera the other way.
                *sums.nodes.entry(node).or_insert_with(zeros) -= adjoint(&camera_from_tag).transpose() * &cross;
            }
        }
    }

    /// Motion of the nodes' poses that follows a column.
    fn followed(&self, sums: &Sums, column: usize) -> Vec<Vector6<f64>> {
        let mut right = vec![Vector6::zeros(); self.problem.n_nodes];
        for (node, cross) in &sums.nodes {
            right[*node] += cross.column(column);
        }
        for (idx, cross) in &sums.blocks {
            let own = cross.column(column).into_owned();
            match self.problem.blocks[*idx].node {
                Some(node) => right[node] += own,
                None => self.nodes_of(*idx).for_each(|(at, node)| {
                    right[node] -= self.normal.cross[at].transpose() * (self.inverses[*idx] * own);
                }),
            }
        }
        self.factor.solve(&right)
    }

    /// Motion of a camera's pose that follows a column.
    fn block_followed(&self, sums: &Sums, idx: usize, column: usize, nodes: &[Vector6<f64>]) -> Vector6<f64> {
        if let Some(node) = self.problem.blocks[idx].node {
            return nodes[node];
        }
        let mut right = sums.blocks[&idx].column(column).into_owned();
        self.nodes_of(idx).for_each(|(at, node)| right -= self.normal.cross[at] * nodes[node]);
        self.inverses[idx] * right
    }

    /// Used detections of free tags in an image: index and node.
    fn nodes_of(&self, idx: usize) -> impl Iterator<Item = (usize, usize)> {
        let all = self.problem.blocks[idx].range.clone().map(|at| (at, &self.problem.observations[at]));
        all.filter(|(_, seen)| seen.is_used).filter_map(|(at, seen)| Some((at, self.problem.tags[seen.tag].node?)))
    }
}
