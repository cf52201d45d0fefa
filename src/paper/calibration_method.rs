//! The paper's methods in the form that the estimator calls.

use armcal_belief::calib::{CalibrationMethod, CommonErrors, ParameterCovariance, PositionProblem, PositionSolution};
use armcal_belief::model::{JointParameters, Parameter};
use armcal_core::routine::Method;

use crate::minimum_distance::minimum_distance;
use crate::minimum_variance::{determined_by_variance, variance_covariance};
use crate::position_method::PositionMethod;
use crate::search::SearchOptions;

/// Returns the calibration method that solves by `method`.
#[must_use]
pub fn calibration_method(method: Method) -> CalibrationMethod {
    match method {
        Method::Bundle => CalibrationMethod::Bundle,
        Method::JointLimits => CalibrationMethod::JointLimits,
        Method::MinimumDistance => CalibrationMethod::Positions { method, solve: by_distance },
        Method::MinimumVariance => CalibrationMethod::Positions { method, solve: by_variance },
    }
}

fn by_distance(
    problem: &PositionProblem<'_>,
    free: &[Parameter],
    guess: &JointParameters,
    errors: &CommonErrors,
) -> Option<PositionSolution> {
    let solution = minimum_distance(problem, free, guess);
    let (covariance, by_mount) = ParameterCovariance::estimate(problem, free, &solution.parameters, errors);
    Some(PositionSolution { determined: free.to_vec(), solution, covariance, by_mount, unobservable: Vec::new() })
}

fn by_variance(
    problem: &PositionProblem<'_>,
    free: &[Parameter],
    guess: &JointParameters,
    errors: &CommonErrors,
) -> Option<PositionSolution> {
    let (determined, unobservable) = determined_by_variance(problem, free, guess);
    if determined.is_empty() {
        return None;
    }
    let solution = PositionMethod::MinimumVariance.solve(problem, &determined, guess, &SearchOptions::default());
    let (covariance, by_mount) = variance_covariance(problem, &determined, &solution.parameters, errors);
    Some(PositionSolution { determined, solution, covariance, by_mount, unobservable })
}
