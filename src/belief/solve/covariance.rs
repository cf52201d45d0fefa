//! Covariance of the estimate, in the parameters' units and as the tool's error.
//!
//! An estimator that minimizes a sum of norms has the sandwich covariance `A^-1 B A^-1` (Huber 1967): `A` is the
//! objective's curvature, `B` the scatter of its gradient. `B` is summed by views, because all tags of one view share
//! one camera pose and its error. Errors common to all views (camera mount, survey of a tag) do not show in any
//! scatter; they are added from the priors through the same curvature. The sensor error that a straight line leaves
//! (nonlinearity, temperature) recurs at every new pose. At the tool it is added from the datasheet's linearity, or
//! more if the residuals show that the sensors are worse than their datasheet.

use crate::solve::constants::covariance::DISTANCE_FLOOR_M;
use nalgebra::{Const, DMatrix, DVector, Dyn, Matrix3, Matrix6, OMatrix, Vector6};

use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::model::shared_survey_error::SharedSurveyError;
use crate::positions::mount_estimate::MountEstimate;
use crate::positions::position_problem::PositionProblem;
use crate::solve::details::TargetPrediction;
use crate::solve::task_angles::numbered_task_angles;
use crate::views::view::{TagObservation, TaskRests};
use armcal_core::robot::{JointSensorSpec, Robot, SurveyedTag};
use armcal_core::sensor::ConditionChange;
use armcal_core::stats::Summary;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Covariance of the free parameters, in their own units (gain: 1, offset: rad).
#[derive(Clone, Debug)]
pub struct ParameterCovariance {
    /// Parameters in the order of the rows.
    pub parameters: Vec<Parameter>,
    /// Square, symmetric matrix; infinite where the data determine nothing.
    pub matrix: DMatrix<f64>,
    /// Standard deviation of the error that the parameters leave of each sensor at a new pose, rad; `None` means the
    /// datasheet's linearity.
    pub residual_std_rad: Option<[f64; MAX_JOINTS]>,
}

/// A joint at a travel of its sensor.
#[derive(Clone, Copy, Debug)]
pub struct JointAt<'a> {
    /// Sensor of the joint.
    pub spec: &'a JointSensorSpec,
    /// Index of the joint, base first.
    pub joint: usize,
    /// Travel from the middle of the joint's range by the datasheet, rad.
    pub travel_rad: f64,
}

/// Predicted position error of the tool at the task's targets.
#[derive(Clone, Debug)]
pub struct ToolErrorPrediction {
    /// Summary over the targets that inverse kinematics reaches, m.
    pub error_m: Summary,
    /// Prediction at each of these targets.
    pub targets: Vec<TargetPrediction>,
}

/// Errors that all views share.
#[derive(Clone, Debug)]
pub struct CommonErrors {
    /// Covariance of the camera's mount (translation m, rotation rad), on the right.
    pub mount: Matrix6<f64>,
    /// Covariance of the tags' positions in the base frame, m^2, three rows for each tag of the robot.
    pub tags_m2: DMatrix<f64>,
}

impl CommonErrors {
    /// Returns the standard deviations stated in robot.toml and the survey: every axis independently, and every tag but
    /// for the error that the tags of a map share.
    #[must_use]
    pub fn priors(robot: &Robot) -> Self {
        let (std_m, std_rad) = (robot.camera.mount_std_m, robot.camera.mount_std_rad);
        let mount = Vector6::from_fn(|row, _| if row < 3 { std_m } else { std_rad }.powi(2));
        Self { mount: Matrix6::from_diagonal(&mount), tags_m2: surveyed_m2(robot) }
    }

    /// Returns the joint covariance: mount first, then the tags.
    fn matrix(&self) -> DMatrix<f64> {
        let n = 6 + self.tags_m2.nrows();
        let mut matrix = DMatrix::zeros(n, n);
        matrix.view_mut((0, 0), (6, 6)).copy_from(&self.mount);
        matrix.view_mut((6, 6), (n - 6, n - 6)).copy_from(&self.tags_m2);
        matrix
    }
}

/// Covariance of the tags' positions by their survey, m^2, three rows a tag.
fn surveyed_m2(robot: &Robot) -> DMatrix<f64> {
    let shared = SharedSurveyError::of(robot);
    let own_m2 = |tag: &SurveyedTag| match &shared {
        Some(shared) if tag.is_known() => shared.own_variance_m2(tag),
        _ => tag.position_std_m.powi(2),
    };
    let own = robot.tags.iter().flat_map(|tag| [own_m2(tag); 3]);
    let own = DMatrix::from_diagonal(&DVector::from_iterator(3 * robot.tags.len(), own));
    let Some(shared) = shared else { return own };
    let mut by_anchor = DMatrix::zeros(own.nrows(), 6);
    for (idx, tag) in robot.tags.iter().enumerate().filter(|(_, tag)| tag.is_known()) {
        by_anchor.fixed_view_mut::<3, 6>(3 * idx, 0).copy_from(&shared.motion_m(tag));
    }
    own + &by_anchor * by_anchor.transpose()
}

impl ParameterCovariance {
    /// Returns the covariance of gains and offsets under other conditions than the reference's, including the effects
    /// of temperature and pressure.
    #[must_use]
    pub fn under(&self, change: &ConditionChange) -> Self {
        let mut to = DMatrix::identity(self.parameters.len(), self.parameters.len());
        for (column, by) in self.parameters.iter().enumerate() {
            let (kind, share) = match by.kind {
                ParameterKind::OffsetPerK => (ParameterKind::Offset, change.oil_k),
                ParameterKind::GainPerK => (ParameterKind::Gain, change.oil_k),
                ParameterKind::OffsetPerMpa => (ParameterKind::Offset, change.pressure_mpa),
                ParameterKind::DriftPerH => (ParameterKind::Offset, change.elapsed_h),
                _ => continue,
            };
            let into = Parameter { joint: by.joint, kind };
            if let Some(row) = self.parameters.iter().position(|p| *p == into) {
                to[(row, column)] = share;
            }
        }
        Self { matrix: &to * &self.matrix * to.transpose(), ..self.clone() }
    }

    /// Returns the variance of a joint's angle at that travel, rad^2: from its own parameters, plus the given variance.
    #[must_use]
    pub fn angle_var_rad2(&self, at: JointAt<'_>, change: &ConditionChange, besides: f64) -> f64 {
        let JointAt { spec, joint, travel_rad } = at;
        let own = self.parameters.iter().enumerate().filter(|(_, p)| p.joint == joint);
        let by: Vec<(usize, f64)> =
            own.map(|(row, p)| (row, p.kind.angle_derivative(spec, travel_rad, change, 0.0))).collect();
        let mut variance = besides;
        for &(i, by_i) in &by {
            for &(k, by_k) in &by {
                variance += by_i * self.matrix[(i, k)] * by_k;
            }
        }
        variance.max(0.0)
    }

    /// Estimates the covariance at the solution, and the parameters' derivative by the mount error (d parameter / d
    /// mount, six columns). A singular curvature gives infinite variances.
    #[must_use]
    pub fn estimate(
        problem: &PositionProblem<'_>,
        free: &[Parameter],
        at: &JointParameters,
        errors: &CommonErrors,
    ) -> (Self, DMatrix<f64>) {
        let n = free.len();
        let n_tags = problem.robot.tags.len();
        let mut curvature = DMatrix::zeros(n, n);
        let mut view_gradients = DMatrix::zeros(n, problem.views.len());
        // Columns: mount translation, mount rotation, then each tag's survey position.
        let mut by_common = DMatrix::zeros(n, 6 + 3 * n_tags);
        problem.each(at, |o| {
            let distance = o.residual_m.norm().max(DISTANCE_FLOOR_M);
            let unit = o.residual_m / distance;
            let hessian = (Matrix3::identity() - unit * unit.transpose()) / distance;
            let mut jacobian = DMatrix::zeros(3, n);
            for (column, &parameter) in free.iter().enumerate() {
                jacobian.fixed_view_mut::<3, 1>(0, column).copy_from(&problem.derivative(o, parameter));
            }
            let transposed = jacobian.transpose();
            curvature += &transposed * hessian * &jacobian;
            let gradient: DVector<f64> = &transposed * unit;
            let mut sum = view_gradients.column_mut(o.view_idx);
            sum += gradient;
            let (by_translation, by_rotation) = PositionProblem::mount_derivative(o);
            let weighted = &transposed * hessian;
            add_columns(&mut by_common, 0, &(&weighted * by_translation));
            add_columns(&mut by_common, 3, &(&weighted * by_rotation));
            add_columns(&mut by_common, 6 + 3 * o.tag.tag_idx, &(-&weighted));
        });
        let (matrix, by_mount) = match curvature.try_inverse() {
            None => (DMatrix::from_diagonal_element(n, n, f64::INFINITY), DMatrix::zeros(n, 6)),
            Some(inverse) => {
                let used = problem.views.iter().filter(|view| !view.tags.is_empty()).count();
                let small_sample = used as f64 / (used.saturating_sub(1)).max(1) as f64;
                let scatter = &view_gradients * view_gradients.transpose() * small_sample;
                let common = &inverse * by_common;
                let matrix = &inverse * scatter * &inverse + &common * errors.matrix() * common.transpose();
                (matrix, -common.columns(0, 6))
            }
        };
        (Self { parameters: free.to_vec(), matrix, residual_std_rad: None }, by_mount)
    }

    /// Adds the joints that the tag on the gripper determined; `by_mount` comes from [`Self::estimate`].
    #[must_use]
    pub fn with_gripper_tag(self, mount: &MountEstimate, determined: &[Parameter], by_mount: &DMatrix<f64>) -> Self {
        let rows: Vec<usize> = determined.iter().filter_map(|p| mount.row(*p)).collect();
        let (n, k) = (self.parameters.len(), rows.len());
        let mut matrix = DMatrix::zeros(n + k, n + k);
        matrix.view_mut((0, 0), (n, n)).copy_from(&self.matrix);
        for (i, &row) in rows.iter().enumerate() {
            for (j, &column) in rows.iter().enumerate() {
                matrix[(n + i, n + j)] = mount.covariance[(row, column)];
            }
            let with_mount: DVector<f64> = mount.covariance.view((0, row), (6, 1)).column(0).into_owned();
            let shared = by_mount * with_mount;
            matrix.view_mut((0, n + i), (n, 1)).copy_from(&shared);
            matrix.view_mut((n + i, 0), (1, n)).copy_from(&shared.transpose());
        }
        let parameters = self.parameters.into_iter().chain(determined.iter().copied()).collect();
        Self { parameters, matrix, ..self }
    }

    /// Returns the covariance without the parameters of `joint`.
    #[must_use]
    pub fn without_joint(&self, joint: usize) -> Self {
        self.without(|parameter| parameter.joint == joint)
    }

    /// Returns the marginal covariance of the other parameters.
    #[must_use]
    pub fn without(&self, is_dropped: impl Fn(Parameter) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.parameters.len()).filter(|&k| !is_dropped(self.parameters[k])).collect();
        Self {
            parameters: kept.iter().map(|&k| self.parameters[k]).collect(),
            matrix: DMatrix::from_fn(kept.len(), kept.len(), |i, k| self.matrix[(kept[i], kept[k])]),
            residual_std_rad: self.residual_std_rad,
        }
    }

    /// Returns the standard deviation of a parameter; `None` if it is not estimated.
    #[must_use]
    pub fn std(&self, parameter: Parameter) -> Option<f64> {
        let row = self.parameters.iter().position(|p| *p == parameter)?;
        Some(self.matrix[(row, row)].max(0.0).sqrt())
    }
}

/// Returns the factor on the datasheets' linearity that explains the residuals; at least 1.
///
/// `sum |residual|^2 = sum (tr(mount) + tr(survey) + tr(corners) + s^2 tr(linearity))` over all tags of fitted and
/// held-out views, solved for `s`. Fitted views count for the share that the parameters leave free: a view adds about
/// three numbers.
#[must_use]
pub fn linearity_scale(
    fit: &PositionProblem<'_>,
    held_out: &PositionProblem<'_>,
    at: &JointParameters,
    n: usize,
) -> f64 {
    let [mut found_m2, mut from_drawing_m2, mut from_sensors_m2] = [0.0; 3];
    let mut views = fit.views.iter().chain(held_out.views).flat_map(|view| &view.tags);
    if views.any(|tag| tag.corners().is_none()) {
        // The accuracy of positions is unknown; their scatter must not count as the sensors'.
        return 1.0;
    }
    for (problem, n_fitted) in [(fit, n), (held_out, 0)] {
        let views = problem.views.iter().filter(|view| !view.tags.is_empty()).count();
        let free_share = (1.0 - n_fitted as f64 / (3 * views).max(1) as f64).max(0.1);
        problem.each(at, |o| {
            let robot = problem.robot;
            found_m2 += o.residual_m.norm_squared();
            from_drawing_m2 += free_share * drawing_variance_m2(robot, o.tag);
            for (joint, spec) in robot.sensors.iter().enumerate().take(robot.n_seen_joints()) {
                let by_angle = o.poses.point_jacobian(joint, &o.predicted_m);
                from_sensors_m2 += free_share * (by_angle * spec.linearity_std_rad).norm_squared();
            }
        });
    }
    let scale = ((found_m2 - from_drawing_m2) / from_sensors_m2).max(1.0).sqrt();
    if scale.is_finite() { scale } else { 1.0 }
}

/// Returns the expected squared distance of a tag from its survey with perfect sensors, m^2: mount, survey and corner
/// noise.
fn drawing_variance_m2(robot: &Robot, tag: &TagObservation) -> f64 {
    let (camera, survey) = (&robot.camera, &robot.tags[tag.tag_idx]);
    let range_m = tag.center_in_camera_m.norm();
    let bearing_rad = camera.corner_std_px / camera.lens.focal_px()[0];
    // The range comes from the apparent size: `range^2 / size` times the bearing's error.
    let along_m = range_m * range_m * bearing_rad / survey.size_m;
    let across_m = range_m * bearing_rad;
    3.0 * (camera.mount_std_m.powi(2) + survey.position_std_m.powi(2))
        + 2.0 * (range_m * camera.mount_std_rad).powi(2)
        + (along_m.powi(2) + 2.0 * across_m.powi(2)) / tag.corners().map_or(1, |seen| seen.n_frames.max(1)) as f64
}

fn add_columns(matrix: &mut DMatrix<f64>, column: usize, block: &OMatrix<f64, Dyn, Const<3>>) {
    let mut view = matrix.fixed_columns_mut::<3>(column);
    view += block;
}

/// Predicts the tool's position error at each target of `task`, `sqrt(trace(covariance))`, and its summary.
#[must_use]
pub fn predict_tool_error(
    robot: &Robot,
    at: &JointParameters,
    covariance: &ParameterCovariance,
    task: Option<TaskRests<'_>>,
) -> Option<ToolErrorPrediction> {
    let sensors = at.sensors(robot);
    let predict = |(target_idx, angles): (u32, JointAngles)| {
        let covariance_m2 = covariance.tool_position_m2(robot, &sensors, &angles);
        TargetPrediction {
            target_idx: target_idx as usize,
            angles,
            covariance_m2,
            error_m: covariance_m2.trace().max(0.0).sqrt(),
            with_priors_m: None,
            with_priors_m2: None,
            distribution: None,
        }
    };
    let targets: Vec<TargetPrediction> = numbered_task_angles(robot, task?).into_iter().map(predict).collect();
    let errors: Vec<f64> = targets.iter().map(|target| target.error_m).collect();
    Some(ToolErrorPrediction { error_m: Summary::of(&errors)?, targets })
}
