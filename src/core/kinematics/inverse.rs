//! Inverse kinematics for a tool position: damped least squares inside the limits, pulled towards a posture.
//!
//! Levenberg-Marquardt on the position error with a weak pull to the seed posture in the null space
//! (Nakamura and Hanafusa 1986); joints at a limit are held for the step.

use nalgebra::{DMatrix, DVector, Vector3};

use super::chain::{Attachment, Chain, JointLimits};
use crate::joints::{JointAngles, MAX_JOINTS};

/// Where to bring a frame's origin, base frame, m.
#[derive(Clone, Copy, Debug)]
pub struct IkGoal {
    pub position_m: Vector3<f64>,
}

/// What the solver may do.
#[derive(Clone, Debug)]
pub struct IkSettings {
    /// Range allowed to each joint, rad.
    pub limits: Vec<JointLimits>,
    /// Joints that stay at the seed's angle.
    pub locked: Vec<bool>,
    pub tolerance_m: f64,
    pub max_iterations: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum IkError {
    /// The goal is farther away than the arm is long, or behind its limits.
    #[error("out of reach: the nearest point found is {error_m:.3} m from the target")]
    OutOfReach { error_m: f64 },
}

/// Solves for the joint angles that bring `tip` to `goal`, starting at `seed` and staying near it.
///
/// # Errors
/// [`IkError::OutOfReach`] with the distance that remains.
pub fn solve_position(
    chain: &Chain,
    tip: &Attachment,
    goal: &IkGoal,
    seed: &JointAngles,
    settings: &IkSettings,
) -> Result<JointAngles, IkError> {
    let mut angles = clamp(seed, settings);
    let mut error = position_error(chain, tip, goal, &angles);
    let mut damping = 1e-3;
    for _ in 0..settings.max_iterations {
        if error.norm() < settings.tolerance_m {
            return Ok(angles);
        }
        let trial = clamp(&step(chain, tip, &angles, &error, damping, settings), settings);
        let trial_error = position_error(chain, tip, goal, &trial);
        if trial_error.norm() < error.norm() {
            (angles, error) = (trial, trial_error);
            damping = (damping * 0.3).max(1e-9);
        } else {
            damping *= 8.0;
            if damping > 1e6 {
                break;
            }
        }
    }
    if error.norm() < settings.tolerance_m {
        return Ok(angles);
    }
    Err(IkError::OutOfReach { error_m: error.norm() })
}

fn position_error(chain: &Chain, tip: &Attachment, goal: &IkGoal, angles: &JointAngles) -> Vector3<f64> {
    goal.position_m - chain.link_poses(angles).frame(tip).translation.vector
}

fn step(
    chain: &Chain,
    tip: &Attachment,
    angles: &JointAngles,
    error: &Vector3<f64>,
    damping: f64,
    settings: &IkSettings,
) -> JointAngles {
    let poses = chain.link_poses(angles);
    let point = poses.frame(tip).translation.vector;
    let free: Vec<usize> = (0..tip.n_joints.min(MAX_JOINTS)).filter(|&j| !settings.locked[j]).collect();
    let mut jacobian = DMatrix::zeros(3, free.len());
    for (column, &joint) in free.iter().enumerate() {
        jacobian.set_column(column, &poses.point_jacobian(joint, &point));
    }
    let normal = jacobian.transpose() * &jacobian + DMatrix::identity(free.len(), free.len()) * damping;
    let gradient = jacobian.transpose() * DVector::from_column_slice(error.as_slice());
    let mut next = *angles;
    if let Some(cholesky) = normal.cholesky() {
        let delta = cholesky.solve(&gradient);
        let scale = (0.3 / delta.amax().max(1e-12)).min(1.0);
        for (column, &joint) in free.iter().enumerate() {
            next[joint] += scale * delta[column];
        }
    }
    next
}

fn clamp(angles: &JointAngles, settings: &IkSettings) -> JointAngles {
    JointAngles::from_fn(angles.len(), |j| {
        let limits = settings.limits[j];
        angles[j].clamp(limits.lower_rad, limits.upper_rad)
    })
}
