//! Check for unobservable parameters, before solving.
//!
//! A parameter is unobservable for one of two reasons. Structural: a joint distal to the camera moves nothing that the
//! camera sees. By the data: the linearized problem leaves a parameter less certain than its datasheet does. Such a
//! parameter stays at the datasheet's value, and the result lists its name and reason. The least determined one is
//! removed first, because that may make the others observable.

use crate::methods::constants::observability::{OPEN_SHARE, POSITION_STD_M};
use nalgebra::DMatrix;

use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::positions::position_problem::PositionProblem;
use crate::positions::unobservable::Unobservable;

/// Returns the parameters to estimate, and the unobservable ones, linearized at `guess`.
#[must_use]
pub fn free_parameters(problem: &PositionProblem<'_>, guess: &JointParameters) -> (Vec<Parameter>, Vec<Unobservable>) {
    let robot = problem.robot;
    let mut free = Vec::new();
    let mut unobservable = Vec::new();
    for joint in 0..robot.n_joints() {
        for kind in [ParameterKind::Gain, ParameterKind::Offset] {
            let parameter = Parameter { joint, kind };
            if joint >= robot.n_seen_joints() {
                unobservable.push(Unobservable::distal(parameter));
            } else if parameter.prior_std(robot) > 0.0 {
                free.push(parameter);
            }
        }
    }
    while let Some((worst, ratio)) = least_determined(problem, &free, guess) {
        if ratio <= 1.0 {
            break;
        }
        let parameter = free.remove(worst);
        let reason = if ratio.is_finite() {
            format!("the views leave it {ratio:.1} times less certain than its datasheet does")
        } else {
            "the views do not determine it".to_owned()
        };
        unobservable.push(Unobservable { parameter, reason });
    }
    unobservable.sort_by_key(|u| u.parameter);
    (free, unobservable)
}

/// Returns the free parameter with the largest ratio of its standard deviation from the data to its prior one.
fn least_determined(
    problem: &PositionProblem<'_>,
    free: &[Parameter],
    guess: &JointParameters,
) -> Option<(usize, f64)> {
    if free.is_empty() {
        return None;
    }
    let scaled_std = data_std_in_prior_units(problem, free, guess);
    scaled_std.into_iter().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Returns each parameter's standard deviation from the data only, relative to its prior's; infinite in a null
/// direction.
fn data_std_in_prior_units(problem: &PositionProblem<'_>, free: &[Parameter], guess: &JointParameters) -> Vec<f64> {
    let (_, mut jacobian) = problem.linearize(guess, free);
    for (column, parameter) in free.iter().enumerate() {
        let std = parameter.prior_std(problem.robot);
        jacobian.column_mut(column).scale_mut(std / POSITION_STD_M);
    }
    let information: DMatrix<f64> = jacobian.transpose() * &jacobian;
    let eigen = information.symmetric_eigen();
    // Beyond this spread double precision cannot distinguish the direction from a null direction.
    let floor = eigen.eigenvalues.amax() * 1e-13;
    (0..free.len())
        .map(|row| {
            let mut variance = 0.0;
            for (k, &value) in eigen.eigenvalues.iter().enumerate() {
                let weight = eigen.eigenvectors[(row, k)].powi(2);
                if value > floor {
                    variance += weight / value;
                } else if weight > OPEN_SHARE {
                    variance = f64::INFINITY;
                }
            }
            variance.sqrt()
        })
        .collect()
}
