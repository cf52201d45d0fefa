//! Test for a slip of a joint's sensor while the views were captured.
//!
//! A step d of one sensor at a change point c is a trial parameter, zero in the model: the joint's angle at the same
//! reading is larger by d in all views before c. The joint's error e_v in view v is counted from there, so d acts only
//! through the errors' prior. The score z and information I of d, with everything else marginalised, are
//!
//! ```text
//! z = sum w_v e_v        I = sum w_v - sum w_u w_v cov(e_u, e_v)        over views before c, w = 1 / var(e)
//! ```
//!
//! with the posterior covariance of the errors (Rao 1948). `z^2 / I` is chi-square with one degree of freedom. A step
//! that is not in the model inflates the joint's own fitted variance, and chi-square stays small. A step takes r off
//! the errors' sum of squares `S = sum w e^2`. It counts `-N ln(1 - r / N)`, with the variance fitted again to N =
//! `sum (1 - var / prior var)` errors and the prior's few.

pub(crate) use crate::explain::constants::step_test::MIN_SIDE;
use crate::explain::constants::step_test::{LEAST_TOLD, SATURATED};
use nalgebra::DVector;

use crate::solve::estimate::Estimate;
use crate::solve::evidence::NU_JOINT;

/// Possible step of one joint's sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepCandidate {
    pub joint: usize,
    /// First view after the step, in the order of time.
    pub since: usize,
    /// Excess of the joint's angle at the same reading before the step, rad.
    pub size_rad: f64,
    /// Twice the logarithm of the likelihoods' ratio.
    pub likelihood_ratio: f64,
}

/// Prior of the offsets before the first view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OffsetPrior {
    Datasheet,
    /// An earlier calibration: the offsets may have changed since, in all views alike.
    Calibrated,
}

/// Error of a joint in one view.
pub(crate) struct JointError {
    pub view_idx: usize,
    pub error_rad: f64,
    /// Inverse of the prior's variance.
    pub weight: f64,
    /// Posterior variance if the common parameters were known.
    pub own_var: f64,
    /// Derivative of the error by the common parameters.
    pub by_common: DVector<f64>,
    /// Share of the prior's variance that the view takes away.
    pub told: f64,
}

impl Estimate<'_> {
    /// The likeliest step of each joint over all change points between `views`, which are in the order of time.
    pub(crate) fn likeliest_steps(&self, views: &[usize], offsets: OffsetPrior) -> Vec<StepCandidate> {
        let by_joint = self.joint_errors(views);
        let of_joint = |(joint, errors): (usize, &Vec<JointError>)| self.likeliest_step(joint, errors, offsets);
        by_joint.iter().enumerate().filter_map(of_joint).collect()
    }

    fn likeliest_step(&self, joint: usize, errors: &[JointError], offsets: OffsetPrior) -> Option<StepCandidate> {
        let n = errors.iter().map(|error| error.told).sum::<f64>() + NU_JOINT;
        let squares: f64 = errors.iter().map(|error| error.weight * error.error_rad.powi(2)).sum();
        let sides = MIN_SIDE..(errors.len() + 1).saturating_sub(MIN_SIDE);
        let chi2 = |score: f64, information: f64, by_common: &DVector<f64>| {
            let left = information - by_common.dot(&(&self.posterior.covariance * by_common));
            if left > 0.0 { (score * score / left, score / left) } else { (0.0, 0.0) }
        };
        let (mut score, mut information) = (0.0, 0.0);
        let mut by_common = DVector::zeros(self.problem.layout.n);
        let mut best: Option<(f64, StepCandidate)> = None;
        for (at, error) in errors.iter().enumerate() {
            if sides.contains(&at) {
                let (chi2, size_rad) = chi2(score, information, &by_common);
                if best.as_ref().is_none_or(|(most, _)| chi2 > *most) {
                    let of_errors = chi2.min(squares).min(SATURATED * n);
                    let likelihood_ratio = chi2 - of_errors - n * (-of_errors / n).ln_1p();
                    let since = error.view_idx;
                    best = Some((chi2, StepCandidate { joint, since, size_rad, likelihood_ratio }));
                }
            }
            score += error.weight * error.error_rad;
            information += error.weight - error.weight.powi(2) * error.own_var;
            by_common.axpy(error.weight, &error.by_common, 1.0);
        }
        let of_all = if offsets == OffsetPrior::Calibrated { chi2(score, information, &by_common).0 } else { 0.0 };
        best.filter(|(most, _)| *most > of_all).map(|(_, candidate)| candidate)
    }

    /// Errors of each joint proximal to the camera, in the views that determine them enough.
    pub(crate) fn joint_errors(&self, views: &[usize]) -> Vec<Vec<JointError>> {
        let problem = &self.problem;
        let mut first_group = Vec::with_capacity(problem.views.len());
        let mut n_groups = 0;
        for view in &problem.views {
            first_group.push(n_groups);
            n_groups += 1 + usize::from(view.gripper.is_some());
        }
        let mut by_joint: Vec<Vec<JointError>> = (0..problem.n_seen_joints).map(|_| Vec::new()).collect();
        for &view_idx in views {
            let view = &problem.views[view_idx];
            let own = &self.solved.normal.eliminated[first_group[view_idx]];
            let followed = own.inverse * own.own_by_columns(problem, &self.solved.normal.by_tag, view_idx);
            for (joint, errors) in by_joint.iter_mut().enumerate() {
                let variance = problem.joint_error_var(view, joint);
                let told = 1.0 - self.posterior.own[view_idx][joint] / variance;
                if view.is_free[joint] || variance <= 0.0 || told < LEAST_TOLD {
                    continue;
                }
                errors.push(JointError {
                    view_idx,
                    error_rad: self.solved.state.joint_error[view_idx][joint],
                    weight: 1.0 / variance,
                    own_var: own.inverse[(joint, joint)],
                    by_common: followed.row(joint).transpose(),
                    told,
                });
            }
        }
        by_joint
    }
}
