//! Predicted tool error once views are fitted, with a separate survey error of each tag.
//!
//! The information covers joints, mount and tags together. A view has the camera's twists by parameters B, by tags
//! `-Ad_i`, and by its own joint errors D (variance s^2). It adds `sum G_i^T H_i G_i` with `G_i = [B, -Ad_i]`, less the
//! loss by its own errors: `V (diag(1/s^2) + D^T H D)^-1 V^T`, `V = sum G_i^T H_i D`. These are the normal equations of
//! `bundle` at the believed parameters.

use crate::explain::constants::calibration_prior::{MAX_ROUNDING, ROUNDING};
use crate::plan::constants::view_planning_forecast::{EDGE_SHARE, EDGES, MIN_STD};
use nalgebra::{Cholesky, DMatrix, Matrix6, Vector3};

use crate::plan::view_planning::parameter_prior::{ParameterPrior, WIDTH, basis};
use crate::plan::view_planning::request::PoseRequest;
use crate::plan::view_planning::view_information::ViewJacobian;
use armcal_core::robot::Robot;
use armcal_core::stats::quantile;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Information on joints, mount and tags.
#[derive(Clone, Debug)]
pub(crate) struct Forecast {
    information: DMatrix<f64>,
    /// Columns of the parameters that are not known exactly.
    kept: Vec<usize>,
    n_joints: usize,
    joint_info: [f64; MAX_JOINTS],
    task: Task,
}

/// Tool at the targets.
#[derive(Clone, Debug)]
pub(crate) struct Task {
    /// Derivative of the tool position by parameters, three rows per target, over the root of the number of targets.
    pub rows: DMatrix<f64>,
    /// Variance that no view of the camera lowers, m^2: the residual error of each sensor, and joints distal to the
    /// camera.
    pub floor_m2: f64,
}

impl Task {
    pub(crate) fn new(request: &PoseRequest<'_>, unknowns: &ParameterPrior) -> Self {
        let robot = request.robot;
        // Without a task any configuration may be one: the present one represents it.
        let here = [*request.start];
        let postures = if request.task.is_empty() { &here[..] } else { request.task };
        let share = (postures.len() as f64).sqrt().recip();
        let mut rows = DMatrix::zeros(3 * postures.len(), unknowns.n());
        let mut floor_m2 = 0.0;
        for (target, angles) in postures.iter().enumerate() {
            let poses = robot.chain.link_poses(angles);
            let tool_m = poses.frame(&robot.tool.mount).translation.vector;
            for joint in 0..robot.tool.mount.n_joints {
                let by_angle: Vector3<f64> = poses.point_jacobian(joint, &tool_m) * share;
                if joint >= unknowns.n_joints {
                    floor_m2 += by_angle.norm_squared() * unseen_rad2(request, joint, angles[joint]);
                    continue;
                }
                floor_m2 += by_angle.norm_squared() * unknowns.joint_std_rad[joint].powi(2);
                for (k, by) in basis(robot, joint, angles[joint]).iter().enumerate() {
                    rows.fixed_view_mut::<3, 1>(3 * target, joint * WIDTH + k).copy_from(&(by_angle * *by));
                }
            }
        }
        Self { rows, floor_m2 }
    }
}

impl Task {
    /// Returns the rows, and two more per joint for configurations beyond the task, with the share [`EDGE_SHARE`] of
    /// the whole. They are each joint at both edges of the range of `angles`, by its effect on the tool at the targets.
    /// Margins shrink where joints are known, and other tasks may follow.
    pub(crate) fn with_edges(&self, robot: &Robot, n_joints: usize, angles: &[JointAngles]) -> DMatrix<f64> {
        let n_rows = self.rows.nrows();
        let mut rows = self.rows.clone().resize_vertically(n_rows + 2 * n_joints, 0.0);
        let share = EDGE_SHARE / (2 * n_joints).max(1) as f64;
        for joint in 0..n_joints {
            // The column of the offset is the tool's motion by the angle itself.
            let lever_m = self.rows.column(joint * WIDTH + 1).norm();
            let of_joint: Vec<f64> = angles.iter().map(|angles| angles[joint]).collect();
            for (k, q) in EDGES.into_iter().enumerate() {
                let Some(angle_rad) = quantile(&of_joint, q) else { continue };
                for (column, by) in basis(robot, joint, angle_rad).iter().enumerate() {
                    rows[(n_rows + 2 * joint + k, joint * WIDTH + column)] = share.sqrt() * lever_m * by;
                }
            }
        }
        rows
    }
}

/// Returns the variance of the angle of a joint whose motion the camera does not see, rad^2.
fn unseen_rad2(request: &PoseRequest<'_>, joint: usize, angle_rad: f64) -> f64 {
    let spec = &request.robot.sensors[joint];
    let found = request.belief.and_then(|belief| belief.joint.get(joint));
    let gain_std = found.map_or(spec.gain_std, |joint| joint.gain_std_rad_per_count * spec.counts_per_rad.abs());
    let offset_std_rad = found.map_or(spec.offset_std_rad, |joint| joint.offset_std_rad);
    (gain_std * (angle_rad - spec.center_rad)).powi(2) + offset_std_rad.powi(2) + spec.linearity_std_rad.powi(2)
}

impl Forecast {
    pub(crate) fn new(robot: &Robot, unknowns: &ParameterPrior, task: Task) -> Option<Self> {
        // The survey's common error is left out: here each tag has its own.
        let n = unknowns.n() - 6;
        let kept: Vec<usize> = (0..n).filter(|&k| unknowns.covariance[(k, k)] > 0.0).collect();
        let prior = DMatrix::from_fn(kept.len(), kept.len(), |i, k| unknowns.covariance[(kept[i], kept[k])]);
        let size = kept.len() + 6 * robot.tags.len();
        let mut information = DMatrix::zeros(size, size);
        information.view_mut((0, 0), prior.shape()).copy_from(&regular(prior)?.inverse());
        for (tag, surveyed) in robot.tags.iter().enumerate() {
            for k in 0..6 {
                let std = if k < 3 { surveyed.position_std_m } else { surveyed.rotation_std_rad };
                let at = kept.len() + 6 * tag + k;
                // A small information on unknown tags keeps the equations regular.
                information[(at, at)] = if std.is_finite() { std.max(MIN_STD).powi(-2) } else { 1e-4 };
            }
        }
        let joint_info = unknowns.joint_std_rad.map(|std_rad| std_rad.powi(-2));
        Some(Self { information, kept, n_joints: unknowns.n_joints, joint_info, task })
    }

    pub(crate) fn add(&mut self, view: &ViewJacobian) {
        let n_common = self.kept.len();
        let n_rows = 6 * view.sights.len();
        let n = self.information.nrows();
        // Rows of each tag, whitened by the root of its information.
        let mut rows = DMatrix::zeros(n_rows, n);
        let mut own = DMatrix::zeros(n_rows, self.n_joints);
        let by_parameter = self.by_parameter(view);
        for (k, sight) in view.sights.iter().enumerate() {
            let Some(factor) = Cholesky::new(sight.info) else { continue };
            let root: Matrix6<f64> = factor.l().transpose();
            rows.view_mut((6 * k, 0), (6, n_common)).copy_from(&(root * &by_parameter));
            let of_tag = -(root * sight.adjoint);
            rows.fixed_view_mut::<6, 6>(6 * k, n_common + 6 * sight.tag).copy_from(&of_tag);
            let twists = view.twists.columns(0, self.n_joints);
            own.view_mut((6 * k, 0), (6, self.n_joints)).copy_from(&(root * twists));
        }
        self.information.gemm_tr(1.0, &rows, &rows, 1.0);
        let mut inner = own.tr_mul(&own);
        for joint in 0..self.n_joints {
            inner[(joint, joint)] += self.joint_info[joint];
        }
        let Some(factor) = Cholesky::new(inner) else { return };
        let across = own.tr_mul(&rows);
        let mut half = across;
        factor.l_dirty().solve_lower_triangular_mut(&mut half);
        self.information.gemm_tr(-1.0, &half, &half, 1.0);
    }

    /// Returns the twists of the camera by each of the kept parameters.
    fn by_parameter(&self, view: &ViewJacobian) -> SMatrixX {
        let at = self.n_joints * WIDTH;
        let mut out = SMatrixX::zeros(self.kept.len());
        for (to, &column) in self.kept.iter().enumerate() {
            let twist = if column < at {
                let (joint, k) = (column / WIDTH, column % WIDTH);
                view.twists.column(joint) * view.basis[joint][k]
            } else {
                view.twists.column(MAX_JOINTS + column - at).into_owned()
            };
            out.set_column(to, &twist);
        }
        out
    }

    /// Returns the mean over the targets of the tool's variance, m^2; infinite if the equations are singular.
    pub(crate) fn tool_variance_m2(&self) -> f64 {
        let Some(factor) = Cholesky::new(self.information.clone()) else { return f64::INFINITY };
        let rows = &self.task.rows;
        let mut right = DMatrix::zeros(self.information.nrows(), rows.nrows());
        for (to, &column) in self.kept.iter().enumerate() {
            for row in 0..rows.nrows() {
                right[(to, row)] = rows[(row, column)];
            }
        }
        factor.l_dirty().solve_lower_triangular_mut(&mut right);
        right.iter().map(|x| x * x).sum::<f64>() + self.task.floor_m2
    }
}

/// Matrix of six rows and one column per parameter.
type SMatrixX = nalgebra::OMatrix<f64, nalgebra::Const<6>, nalgebra::Dyn>;

/// Returns a factor of the matrix, which may be indefinite by the rounding of a calibration's file; `None` if it is
/// still singular.
fn regular(matrix: DMatrix<f64>) -> Option<Cholesky<f64, nalgebra::Dyn>> {
    let mut share = 0.0;
    while share < MAX_ROUNDING {
        let raised = DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, k| {
            let value = 0.5 * (matrix[(i, k)] + matrix[(k, i)]);
            if i == k { value * (1.0 + share) } else { value }
        });
        if let Some(factor) = Cholesky::new(raised) {
            return Some(factor);
        }
        share = if share == 0.0 { ROUNDING } else { 10.0 * share };
    }
    None
}
