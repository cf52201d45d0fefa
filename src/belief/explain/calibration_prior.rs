//! Warm start: an earlier calibration as prior, and the test that the new views agree with it.
//!
//! The prior's mean and covariance P0 are those of calibration.toml, about its own reference conditions. The covariance
//! is wider by possible changes since: each offset by the datasheet's random walk, `drift^2 hours`. Parameters that the
//! calibration lacks come from the datasheet.
//!
//! The test fits the views once more under P1 = P0 + W, where W lets each offset slip by the datasheet's sigma. With
//! the posterior covariance C and `A = I - C P1^-1`, the estimate moves from the prior by d. If the prior holds, d has
//! the covariance `S = A P0 A^T + A C` (linear Gaussian model). `d^T S^+ d` is then chi-square with as many degrees of
//! freedom as S has eigenvalues above `TOLD_SHARE` in units of P0.

use crate::explain::constants::calibration_prior::{
    LEAST_SLIP_STD_RAD, MAX_ROUNDING, REMOUNTED_STD, ROUNDING, USUAL_DRIFT_STD_RAD_PER_SQRT_H, Z_999, Z_OF_JOINTS,
};
use crate::explain::constants::tags_departure::TOLD_SHARE;
use nalgebra::{Cholesky, DMatrix, DVector, Isometry3, SymmetricEigen, Vector6};

use crate::explain::failures::{Failure, FailureAdjusted};
use crate::file::calibration::Calibration;
use crate::model::blocks::Block;
use crate::model::estimated::Model;
use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::model::prior::{JointPrior, steps_of};
use crate::model::scales::Hyperparameters;
use crate::say::refusal::{CameraMoved, MIN_USED_SHARE, Refusal};
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::{BundleInput, HyperparameterMode};
use crate::solve::model_for_views::reference;
use crate::views::view::View;
use armcal_core::robot::{JointSensorSpec, Robot};
use armcal_core::sensor::Conditions;
use armcal_core::time::Stamp;

/// Names of the camera mount's rows in calibration.toml's covariance (translation m, rotation rad, camera axes).
pub const MOUNT_ROWS: [&str; 6] =
    ["camera mount x", "camera mount y", "camera mount z", "camera mount rx", "camera mount ry", "camera mount rz"];

/// Earlier calibration in the form that the estimator uses.
#[derive(Clone)]
pub struct CalibrationPrior {
    /// Robot with the camera and the lens as the prior estimated them.
    pub robot: Robot,
    /// Model of the terms that the new views determine, and all that the prior knows.
    pub model: Model,
    /// Scales of the datasheet, with the prior's error between views.
    pub scales: Hyperparameters,
    /// Parameters and reference of the prior.
    pub guess: JointParameters,
    /// Time between the prior's last view and these, h.
    pub elapsed_h: f64,
    mean: DVector<f64>,
    /// Covariance of the joints' parameters in the model's order, then of the camera mount if the prior has it, too.
    covariance: DMatrix<f64>,
    widened: DMatrix<f64>,
}

/// Result of the test that prior and views agree.
#[derive(Clone, Debug, PartialEq)]
pub struct PriorConsistency {
    /// Square of the estimate's move from the prior under its covariance.
    pub chi2: f64,
    /// Number of directions that the views determine well enough to be tested.
    pub degrees_of_freedom: usize,
    /// Limit of `chi2`: its 0.999 quantile.
    pub limit: f64,
    /// Index of the joint with the largest change in its own standard deviations.
    pub joint: usize,
    /// Mean change of the joint's angle over the views, rad; positive if the new views put it above the prior's.
    pub off_rad: f64,
    /// Standard deviation of `off_rad`, rad.
    pub off_std_rad: f64,
    /// Share of the observations that a fit under the widened prior uses.
    pub used_share: f64,
    /// Number of joints that changed by more than chance.
    pub joints_off: usize,
    /// Shift, m, and rotation, rad, of a camera that was mounted again, if that and no slip of one sensor explains the
    /// views.
    pub camera_moved: Option<[f64; 2]>,
}

impl PriorConsistency {
    /// Returns true if `chi2`, the joint's change or the share of used observations is beyond chance.
    pub fn is_beyond_chance(&self) -> bool {
        // NaN counts as disagreement.
        !(self.chi2 <= self.limit
            && self.off_rad.abs() <= Z_OF_JOINTS * self.off_std_rad
            && self.used_share >= MIN_USED_SHARE)
    }

    /// Refusal of a prior that the views contradict; `None` if the difference may be chance.
    pub fn refusal(&self, robot: &Robot) -> Option<Refusal> {
        self.is_beyond_chance().then(|| Refusal::PriorContradicted {
            joint: robot.sensors[self.joint].joint.clone(),
            off_rad: self.off_rad,
            off_std_rad: self.off_std_rad,
            moves: robot.sensors[self.joint].moves,
            chi2: self.chi2,
            degrees_of_freedom: self.degrees_of_freedom,
            limit: self.limit,
            used_share: self.used_share,
            joints_off: self.joints_off,
            camera_moved: self.camera_moved.map(|[shift_m, turn_rad]| CameraMoved { shift_m, turn_rad }),
        })
    }
}

impl CalibrationPrior {
    /// Prepares `prior` for the estimator; `None` if its covariance is not positive definite.
    pub fn new(prior: &Calibration, applied: &FailureAdjusted) -> Option<Self> {
        let views = &applied.views;
        let mut robot = prior.with_lenses(&applied.robot);
        let mut guess = prior.parameters(&robot);
        if guess.reference == Conditions::default() {
            guess.reference = reference(views);
        }
        // The prior knows the sensor of a locked joint, not where the joint stands.
        let is_locked = |failure: &&Failure| failure.stands_still() && failure.leaves_no_sensor();
        let locked: Vec<usize> = applied.failures.iter().filter(is_locked).map(|failure| failure.joint).collect();
        for &joint in &locked {
            for parameter in ParameterKind::all().map(|kind| Parameter { joint, kind }) {
                guess.set(parameter, JointParameters::default().get(parameter));
            }
        }
        let mut scales = Hyperparameters::datasheet(&robot);
        let known = prior.parameter_covariance(&robot).without(|parameter| locked.contains(&parameter.joint));
        if let Some(std_rad) = known.residual_std_rad {
            for parameter in known.parameters.iter().filter(|p| p.kind == ParameterKind::Offset) {
                scales.joint_std_rad[parameter.joint] = std_rad[parameter.joint].max(1e-5);
            }
        }
        let mut model = Model {
            n_links: prior.link.len(),
            n_compliant: prior.sag.as_ref().map_or(0, |sag| sag.joint.len()),
            ..model(applied, &guess.reference, &known.parameters)
        };
        let has_lens = |number: usize| {
            let name = number.checked_sub(1).map(|further| &robot.further_cameras[further].name);
            prior.lens.iter().any(|lens| lens.camera.as_ref() == name) && robot.camera_at(number).lens.is_known()
        };
        model.blocks.extend((0..=robot.further_cameras.len()).filter(|number| has_lens(*number)).map(Block::Lens));
        let mount = prior.camera_mount.as_ref().and_then(|table| Some((table.link_from_camera()?, mount_rows(prior)?)));
        let mount = mount.filter(|_| model.has(Block::Mount(0)));
        if let Some((link_from_camera, rows)) = &mount {
            robot.camera.mount.link_from_frame = *link_from_camera;
            let rms = |from: usize| {
                let variance = |k: usize| prior.covariance.rows[rows[from + k]][rows[from + k]];
                ((0..3).map(variance).sum::<f64>() / 3.0).max(0.0).sqrt()
            };
            (robot.camera.mount_std_m, robot.camera.mount_std_rad) = (rms(0), rms(3));
        }
        let parameters = model.parameters();
        let elapsed_h = elapsed_h(prior, views);
        let mount = mount.map(|(_, rows)| rows);
        let columns = PriorColumns { robot: &robot, scales: &scales, parameters: &parameters, mount, locked: &locked };
        let (covariance, widened) = covariances(prior, &columns, elapsed_h);
        let n = covariance.nrows();
        let mean = DVector::from_fn(n, |k, _| parameters.get(k).map_or(0.0, |p| guess.get(*p)));
        let (covariance, widened) = (regular(covariance)?, regular(widened)?);
        Some(Self { robot, model, scales, guess, elapsed_h, mean, covariance, widened })
    }

    /// Input of an estimate under the prior.
    pub fn input<'a>(&'a self, views: &'a [View], evidence: HyperparameterMode) -> Option<BundleInput<'a>> {
        self.under(&self.covariance, views, evidence)
    }

    fn under<'a>(
        &'a self,
        covariance: &DMatrix<f64>,
        views: &'a [View],
        evidence: HyperparameterMode,
    ) -> Option<BundleInput<'a>> {
        Some(BundleInput {
            robot: &self.robot,
            views,
            model: self.model.clone(),
            scales: self.scales.clone(),
            guess: self.guess,
            joint_prior: Some(self.known(Cholesky::new(covariance.clone())?.inverse())),
            evidence,
        })
    }

    /// Prior with this information on the parameters, and on the mount if the prior has it.
    fn known(&self, information: DMatrix<f64>) -> JointPrior {
        let n = self.model.parameters().len();
        let mean = self.mean.rows(0, n).into_owned();
        let has_mount = self.mean.len() > n;
        let of = if has_mount { JointPrior::with_mount } else { JointPrior::of_parameters };
        of(mean, information)
    }

    /// Number of gains and offsets with more than half of the datasheet's standard deviation in the prior.
    pub fn n_unknown(&self, datasheet: &Robot) -> usize {
        let parameters = self.model.parameters().into_iter();
        let is_unknown = |(k, p): &(usize, Parameter)| {
            matches!(p.kind, ParameterKind::Gain | ParameterKind::Offset)
                && self.covariance[(*k, *k)].sqrt() > 0.5 * p.prior_std(datasheet)
        };
        parameters.enumerate().filter(is_unknown).count()
    }

    /// Tests whether `views` agree with the prior; `None` if they determine nothing.
    pub fn consistency(&self, views: &[View]) -> Option<PriorConsistency> {
        let (consistency, _) = self.tested(views)?;
        let is_beyond = consistency.is_beyond_chance();
        let camera_moved = is_beyond.then(|| self.camera_moved(views, &consistency)).flatten();
        Some(PriorConsistency { camera_moved, ..consistency })
    }

    /// Shift and rotation of the camera, m and rad, if only a new mount explains `views`. The views must agree with the
    /// prior of the sensors only, and not with a slip of the sensor in `off`.
    fn camera_moved(&self, views: &[View], off: &PriorConsistency) -> Option<[f64; 2]> {
        let agrees = |(consistency, _): &(PriorConsistency, _)| !consistency.is_beyond_chance();
        if self.with_slip_of(off.joint, off.off_rad).tested(views).as_ref().is_some_and(agrees) {
            return None;
        }
        let (_, mount) = self.with_remounted_camera().tested(views).filter(agrees)?;
        let moved = self.robot.camera.mount.link_from_frame.inv_mul(&mount);
        Some([moved.translation.vector.norm(), moved.rotation.angle()])
    }

    /// Returns this prior with a possible slip of the sensor of `joint`, by `size_rad` or the usual size of slips.
    fn with_slip_of(&self, joint: usize, size_rad: f64) -> Self {
        let mut slipped = self.clone();
        let offset = Parameter { joint, kind: ParameterKind::Offset };
        if let Some(k) = self.model.parameters().iter().position(|p| *p == offset) {
            slipped.covariance[(k, k)] += slip_std_rad(&self.robot.sensors[joint]).max(size_rad.abs()).powi(2);
        }
        slipped
    }

    /// Returns this prior of the sensors only, with the camera mounted again.
    fn with_remounted_camera(&self) -> Self {
        let n = self.model.parameters().len();
        let of_sensors = |matrix: &DMatrix<f64>| matrix.view((0, 0), (n, n)).into_owned();
        let mut remounted = self.clone();
        let camera = &mut remounted.robot.camera;
        camera.mount_std_m = camera.mount_std_m.max(REMOUNTED_STD[0]);
        camera.mount_std_rad = camera.mount_std_rad.max(REMOUNTED_STD[1]);
        remounted.model.blocks.insert(Block::Mount(0));
        remounted.mean = self.mean.rows(0, n).into_owned();
        (remounted.covariance, remounted.widened) = (of_sensors(&self.covariance), of_sensors(&self.widened));
        remounted
    }

    /// Test of agreement, and the mount as `views` determine it.
    fn tested(&self, views: &[View]) -> Option<(PriorConsistency, Isometry3<f64>)> {
        let found = estimate(&self.under(&self.widened, views, HyperparameterMode::Given)?)?;
        let n = self.mean.len();
        let posterior = found.posterior.covariance.view((0, 0), (n, n)).into_owned();
        let widened_info = Cholesky::new(self.widened.clone())?.inverse();
        let gain = DMatrix::identity(n, n) - &posterior * widened_info;
        let moved_by = &gain * &self.covariance * gain.transpose() + &gain * &posterior;
        let moved_by = 0.5 * (&moved_by + moved_by.transpose());
        let moved = self.moved(&found);
        let (chi2, degrees_of_freedom) = self.chi_square(&moved, &moved_by)?;
        let joints = joints_moved(&found, &moved, &moved_by);
        let sigmas = |(_, off, std): &(usize, f64, f64)| if *std > 0.0 { off.abs() / std } else { 0.0 };
        let joints_off = joints.iter().filter(|moved| sigmas(moved) > Z_OF_JOINTS).count();
        let (joint, off_rad, off_std_rad) = joints.into_iter().max_by(|a, b| sigmas(a).total_cmp(&sigmas(b)))?;
        let observations = &found.problem.observations;
        let used_share = observations.iter().filter(|s| s.is_used).count() as f64 / observations.len().max(1) as f64;
        let limit = chi_square_999(degrees_of_freedom);
        let consistency = PriorConsistency {
            chi2,
            degrees_of_freedom,
            limit,
            joint,
            off_rad,
            off_std_rad,
            used_share,
            joints_off,
            camera_moved: None,
        };
        Some((consistency, *found.solved.state.pose(Block::Mount(0))))
    }

    fn moved(&self, found: &Estimate<'_>) -> DVector<f64> {
        let mut moved = DVector::zeros(self.mean.len());
        let state = &found.solved.state;
        let n = state.joint.len();
        moved.rows_mut(0, n).copy_from(&(&state.joint - self.mean.rows(0, n)));
        if self.mean.len() == n + 6 {
            let by: Vector6<f64> = armcal_core::spatial::log(
                &found.problem.prior.mean.pose(Block::Mount(0)).inv_mul(state.pose(Block::Mount(0))),
            );
            moved.rows_mut(n, 6).copy_from(&by);
        }
        moved
    }

    fn chi_square(&self, moved: &DVector<f64>, moved_by: &DMatrix<f64>) -> Option<(f64, usize)> {
        if moved.is_empty() {
            return None;
        }
        let lower = Cholesky::new(self.covariance.clone())?.l();
        let whitened = lower.solve_lower_triangular(moved)?;
        let half = lower.solve_lower_triangular(moved_by)?;
        let inner = lower.solve_lower_triangular(&half.transpose())?;
        let eigen = SymmetricEigen::new(0.5 * (&inner + inner.transpose()));
        let (mut chi2, mut n) = (0.0, 0);
        for (value, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > TOLD_SHARE {
                chi2 += direction.dot(&whitened).powi(2) / value;
                n += 1;
            }
        }
        Some((chi2, n))
    }
}

/// Change of each joint: its index, the mean change of its angle over the views and the standard deviation of that,
/// rad.
fn joints_moved(found: &Estimate<'_>, moved: &DVector<f64>, moved_by: &DMatrix<f64>) -> Vec<(usize, f64, f64)> {
    let problem = &found.problem;
    let seen = problem.views.iter().filter(|view| !view.observations.is_empty()).count().max(1) as f64;
    let of_joint = |joint: usize| {
        let mut by = DVector::zeros(moved.len());
        for view in problem.views.iter().filter(|view| !view.observations.is_empty()) {
            for column in problem.layout.of_joint[joint].clone() {
                by[column] += view.basis[column] / seen;
            }
        }
        (joint, by.dot(moved), (moved_by * &by).dot(&by).max(0.0).sqrt())
    };
    let joints = (0..problem.layout.of_joint.len()).filter(|&joint| !problem.layout.of_joint[joint].is_empty());
    joints.map(of_joint).collect()
}

/// Model of the terms that the views determine, and all that the prior knows.
fn model(applied: &FailureAdjusted, reference: &Conditions, known: &[Parameter]) -> Model {
    let mut views = applied.views.clone();
    // Terms act from the prior's reference on: oil as warm in all views, but warmer than then, has columns.
    if let Some(first) = applied.views.first() {
        views.push(View { conditions: *reference, tags: Vec::new(), gripper_tag: None, ..first.clone() });
    }
    let mut model = crate::solve::model_for_views::model_for(&applied.robot, &views);
    for (joint, kinds) in model.joints.iter_mut().enumerate() {
        let wanted = |kind: &ParameterKind| kinds.contains(kind) || known.contains(&Parameter { joint, kind: *kind });
        *kinds = ParameterKind::all().filter(wanted).collect();
    }
    applied.restrict(&mut model);
    model
}

/// Rows of the camera mount in the prior's covariance.
fn mount_rows(prior: &Calibration) -> Option<[usize; 6]> {
    let rows: Vec<usize> = MOUNT_ROWS.iter().filter_map(|name| prior.covariance.row(name)).collect();
    rows.try_into().ok()
}

fn elapsed_h(prior: &Calibration, views: &[View]) -> f64 {
    let then = Stamp { nanos: prior.valid.time_nanos };
    let hours: Vec<f64> = views.iter().map(|view| (view.end.since_s(then) / 3600.0).abs()).collect();
    hours.iter().sum::<f64>() / hours.len().max(1) as f64
}

/// Rows that the prior's covariance should have.
struct PriorColumns<'a> {
    robot: &'a Robot,
    scales: &'a Hyperparameters,
    parameters: &'a [Parameter],
    /// The mount's rows in the prior's covariance.
    mount: Option<[usize; 6]>,
    /// Joints that the prior does not constrain.
    locked: &'a [usize],
}

/// Covariances P0 and P1, see the module.
fn covariances(prior: &Calibration, columns: &PriorColumns<'_>, elapsed_h: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let PriorColumns { robot, scales, parameters, mount, locked } = columns;
    let row = |p: &Parameter| prior.covariance.row(&p.name(robot)).filter(|_| !locked.contains(&p.joint));
    let mut rows: Vec<Option<usize>> = parameters.iter().map(row).collect();
    rows.extend(mount.iter().flatten().map(|row| Some(*row)));
    let n = rows.len();
    let mut covariance = DMatrix::from_fn(n, n, |i, k| match (rows[i], rows[k]) {
        (Some(row), Some(column)) => prior.covariance.rows[row][column],
        _ => 0.0,
    });
    for (k, p) in parameters.iter().enumerate() {
        let spec = &robot.sensors[p.joint];
        if rows[k].is_none() {
            covariance[(k, k)] = scales.prior_std(spec, p.joint, p.kind).max(1e-9).powi(2);
        } else if p.kind == ParameterKind::Offset {
            covariance[(k, k)] += drift_std_rad_per_sqrt_h(spec).powi(2) * elapsed_h;
        }
    }
    // The prior constrains an offset before the sensor slipped among the new views.
    for (k, p) in parameters.iter().enumerate().filter(|(_, p)| p.kind == ParameterKind::Offset) {
        for step in steps_of(parameters, p.joint) {
            let step_rad2 = covariance[(step, step)];
            covariance[(k, k)] += step_rad2;
            covariance[(k, step)] -= step_rad2;
            covariance[(step, k)] -= step_rad2;
        }
    }
    let mut widened = covariance.clone();
    for (k, p) in parameters.iter().enumerate().filter(|(_, p)| p.kind == ParameterKind::Offset) {
        widened[(k, k)] += slip_std_rad(&robot.sensors[p.joint]).powi(2);
    }
    (covariance, widened)
}

/// Standard deviation of a possible slip of a sensor, rad.
fn slip_std_rad(spec: &JointSensorSpec) -> f64 {
    spec.offset_std_rad.max(LEAST_SLIP_STD_RAD)
}

/// Drift by the datasheet, or the usual one if it states none, rad per root of an hour.
pub(crate) fn drift_std_rad_per_sqrt_h(spec: &JointSensorSpec) -> f64 {
    let stated = spec.drift_std_rad_per_sqrt_h;
    if stated == 0.0 { USUAL_DRIFT_STD_RAD_PER_SQRT_H } else { stated }
}

/// Makes `matrix` symmetric, and invertible in spite of the file's rounding.
fn regular(matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let symmetric = 0.5 * (&matrix + matrix.transpose());
    let mut share = ROUNDING;
    while share < MAX_ROUNDING {
        let mut raised = symmetric.clone();
        for k in 0..raised.nrows() {
            raised[(k, k)] = raised[(k, k)] * (1.0 + share) + 1e-20;
        }
        if Cholesky::new(raised.clone()).is_some() {
            return Some(raised);
        }
        share *= 10.0;
    }
    None
}

/// The 0.999 quantile of chi-square (Wilson and Hilferty 1931; within 1 % from two degrees of freedom on).
fn chi_square_999(degrees_of_freedom: usize) -> f64 {
    let k = degrees_of_freedom.max(1) as f64;
    let by = 2.0 / (9.0 * k);
    k * (1.0 - by + Z_999 * by.sqrt()).powi(3)
}

/// Covariance of the joints' parameters and the camera mount, whose rows come last, for calibration.toml.
pub fn with_mount_rows(found: &Estimate<'_>) -> Option<DMatrix<f64>> {
    let at = found.problem.layout.at(Block::Mount(0))?;
    let n = found.problem.layout.n_joint();
    debug_assert_eq!(at, n);
    Some(found.wide_covariance().view((0, 0), (n + 6, n + 6)).into_owned())
}
