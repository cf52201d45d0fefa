//! Covariance of the arm's parameters before the views, which every view reduces.
//!
//! The columns of each joint that moves camera and tags against each other are gain, offset and the coefficients of its
//! nonlinearity ([`WIDTH`] in all). The camera mount follows (translation m, rotation rad, on the right), then the
//! survey's common error (a twist of all tags together in their frame). The covariance is the prior of the estimator
//! `bundle`, or that of the interim estimate.

use crate::plan::constants::view_planning_parameter_prior::UNKNOWN_STD;
pub(crate) use crate::plan::constants::view_planning_parameter_prior::{N_COMMON, WIDTH};
use nalgebra::{DMatrix, Matrix6, Vector6};

use crate::explain::calibration_prior::MOUNT_ROWS;
use crate::file::calibration::Calibration;
use crate::model::{Hyperparameters, Parameter, ParameterKind};
use crate::plan::view_planning::request::PoseRequest;
use crate::solve::covariance::ParameterCovariance;
use armcal_core::robot::Robot;
use armcal_core::sensor::{N_SHAPE, nonlinearity_basis};
use armcal_core::spatial::adjoint;
use armcal_core::streams::MAX_JOINTS;

/// Number of directions in which unknown parameters can move a view's camera: each joint's angle, and the common ones.
pub(crate) const N_DIRECTIONS: usize = MAX_JOINTS + N_COMMON;

/// Derivative d(angle)/d(parameter) of each joint before the camera.
pub(crate) type Basis = [[f64; WIDTH]; MAX_JOINTS];

/// Covariance and noise scales before the planned views.
#[derive(Clone, Debug)]
pub(crate) struct ParameterPrior {
    /// Number of joints that move camera and tags against each other.
    pub n_joints: usize,
    pub covariance: DMatrix<f64>,
    /// Std of each joint's error that is independent between views, rad.
    pub joint_std_rad: [f64; MAX_JOINTS],
    /// Corner noise over the datasheet's.
    pub noise: f64,
}

impl ParameterPrior {
    pub(crate) fn of(request: &PoseRequest<'_>) -> Self {
        let robot = request.robot;
        let scales = scales(robot, request.belief);
        // Given views are counted one by one, on top of the prior of the first of them.
        let known = if request.taken.is_empty() { request.belief } else { request.prior };
        let n_joints = robot.n_seen_joints();
        let at = n_joints * WIDTH;
        let mut covariance = DMatrix::zeros(at + N_COMMON, at + N_COMMON);
        let parameters: Vec<Parameter> = columns(n_joints).collect();
        for (column, p) in parameters.iter().enumerate() {
            covariance[(column, column)] = scales.prior_std(&robot.sensors[p.joint], p.joint, p.kind).powi(2);
        }
        for k in 0..6 {
            let std = if k < 3 { robot.camera.mount_std_m } else { robot.camera.mount_std_rad };
            covariance[(at + k, at + k)] = std * std;
        }
        if let Some(known) = known {
            take_over(known, robot, &parameters, &mut covariance);
        }
        if let Some(known) = request.known {
            take_over_sensors(known, &parameters, &mut covariance);
        }
        covariance.fixed_view_mut::<6, 6>(at + 6, at + 6).copy_from(&survey_covariance(robot));
        let mut joint_std_rad = scales.joint_std_rad;
        for failed in robot.failed.iter().filter(|failed| !robot.is_locked(failed.joint)) {
            joint_std_rad[failed.joint] = scales.free_joint_std_rad;
        }
        Self { n_joints, covariance, joint_std_rad, noise: scales.noise }
    }

    pub(crate) fn n(&self) -> usize {
        self.covariance.nrows()
    }
}

/// Returns the joints' parameters in the order of their columns.
pub(crate) fn columns(n_joints: usize) -> impl Iterator<Item = Parameter> {
    let of_joint = || {
        let shape = (0..N_SHAPE as u8).map(ParameterKind::Shape);
        [ParameterKind::Gain, ParameterKind::Offset].into_iter().chain(shape)
    };
    (0..n_joints).flat_map(move |joint| of_joint().map(move |kind| Parameter { joint, kind }))
}

/// Returns d(angle)/d(parameter) of one joint at a believed angle.
pub(crate) fn basis(robot: &Robot, joint: usize, angle_rad: f64) -> [f64; WIDTH] {
    let spec = &robot.sensors[joint];
    let travel_rad = angle_rad - spec.center_rad;
    let shape = nonlinearity_basis(travel_rad / spec.half_range_rad);
    std::array::from_fn(|k| match k {
        0 => travel_rad,
        1 => 1.0,
        _ => shape[k - 2],
    })
}

/// Returns the datasheet's noise and prior scales, or those fitted by the interim estimate.
fn scales(robot: &Robot, belief: Option<&Calibration>) -> Hyperparameters {
    let mut scales = Hyperparameters::datasheet(robot);
    let Some(belief) = belief else { return scales };
    for (joint, result) in belief.joint.iter().enumerate().take(robot.n_joints()) {
        if let Some(std_rad) = result.residual_std_rad {
            scales.joint_std_rad[joint] = std_rad.max(1e-5);
        }
    }
    if let Some(model) = &belief.model {
        scales.noise = model.noise_scale;
        for (std_rad, found_rad) in scales.shape_std_rad.iter_mut().zip(&model.nonlinearity_std_rad) {
            *std_rad = found_rad.max(1e-5);
        }
    }
    scales
}

/// Replaces the datasheet's rows by those of `known`.
fn take_over(known: &Calibration, robot: &Robot, parameters: &[Parameter], covariance: &mut DMatrix<f64>) {
    let row = |name: &str| known.covariance.parameters.iter().position(|known| known == name);
    let mut rows: Vec<Option<usize>> = parameters.iter().map(|p| row(&p.name(robot))).collect();
    rows.extend(MOUNT_ROWS.iter().map(|name| row(name)));
    for (i, at) in rows.iter().enumerate() {
        let Some(at) = at else { continue };
        for (k, from) in rows.iter().enumerate() {
            covariance[(i, k)] = from.map_or(0.0, |from| known.covariance.rows[*at][from]);
        }
    }
}

/// Replaces the sensors' rows by the present covariance of the sensors, which has no correlation with the mount.
fn take_over_sensors(known: &ParameterCovariance, parameters: &[Parameter], covariance: &mut DMatrix<f64>) {
    let rows: Vec<Option<usize>> = parameters.iter().map(|p| known.parameters.iter().position(|k| k == p)).collect();
    for (i, row) in rows.iter().enumerate() {
        let Some(row) = row else { continue };
        covariance.row_mut(i).fill(0.0);
        covariance.column_mut(i).fill(0.0);
        for (k, column) in rows.iter().enumerate().take(i + 1) {
            let value = column.map_or(0.0, |column| known.matrix[(*row, column)]);
            (covariance[(i, k)], covariance[(k, i)]) = (value, value);
        }
    }
}

/// Returns the covariance of the error that all tags share: `(sum A_i^T P_i^-1 A_i)^-1` with the survey's P_i and `A_i
/// = Ad(tag from base)`.
fn survey_covariance(robot: &Robot) -> Matrix6<f64> {
    let mut info = Matrix6::identity() * UNKNOWN_STD.powi(-2);
    for tag in robot.tags.iter().filter(|tag| tag.is_known()) {
        let by_base = adjoint(&tag.base_from_tag.isometry().inverse());
        let std = |k: usize| if k < 3 { tag.position_std_m } else { tag.rotation_std_rad };
        let weight = Vector6::from_fn(|k, _| std(k).max(1e-6).powi(-2));
        info += by_base.tr_mul(&Matrix6::from_diagonal(&weight)) * by_base;
    }
    info.try_inverse().unwrap_or_else(|| Matrix6::identity() * UNKNOWN_STD.powi(2))
}
