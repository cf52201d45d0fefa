//! Inverse kinematics for a tool position: damped least squares inside the limits, with a pull towards a configuration.
//!
//! Levenberg-Marquardt on the position error with a weak pull to the seed configuration in the null space (Nakamura and
//! Hanafusa 1986). Joints at a limit are held for the step.

use nalgebra::{DMatrix, Vector3};

use super::chain::{Chain, JointLimits};
use super::link_poses::Attachment;
use crate::joints::{JointAngles, MAX_JOINTS};
use crate::numeric::{Damping, LeastSquares, Proposal, Stop, StopRule, minimize};

/// Goal of the inverse kinematics: a position of the frame's origin.
#[derive(Clone, Copy, Debug)]
pub struct IkGoal {
    /// Goal of the frame's origin in the base frame, m.
    pub position_m: Vector3<f64>,
}

/// Limits and tolerances of the inverse kinematics.
#[derive(Clone, Debug)]
pub struct IkSettings {
    /// Range allowed to each joint, rad.
    pub limits: Vec<JointLimits>,
    /// True for each joint that stays at the seed's angle.
    pub locked: Vec<bool>,
    /// Distance from the goal at which the search ends.
    pub tolerance_m: f64,
    /// Maximum number of proposed steps.
    pub max_iterations: usize,
}

/// Reason why no angles were found.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum IkError {
    /// The goal is outside the arm's length or its joint limits.
    #[error("out of reach: the nearest point found is {error_m:.3} m from the target")]
    OutOfReach { error_m: f64 },
}

/// Returns the joint angles that bring `tip` to `goal`, starting at `seed` and staying near it.
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
    let angles = clamp(seed, settings);
    let error = position_error(chain, tip, goal, &angles);
    let mut search = Search { chain, tip, goal, settings, angles, error, trial: angles, trial_error: error };
    let stop = StopRule { cost: settings.tolerance_m, ..StopRule::after(settings.max_iterations) };
    let report = minimize(&mut search, &DAMPING, &stop);
    match report.stop {
        Stop::Cost => Ok(search.angles),
        _ => Err(IkError::OutOfReach { error_m: search.error.norm() }),
    }
}

/// Damping added to the normal matrix, m^2/rad^2.
const DAMPING: Damping = Damping { first: 1e-3, min: 1e-9, max: 1e6, down: 0.3, up: 8.0, min_after_rejection: 0.0 };
/// Longest step of a joint, rad.
const MAX_STEP_RAD: f64 = 0.3;

struct Search<'a> {
    chain: &'a Chain,
    tip: &'a Attachment,
    goal: &'a IkGoal,
    settings: &'a IkSettings,
    angles: JointAngles,
    error: Vector3<f64>,
    trial: JointAngles,
    trial_error: Vector3<f64>,
}

/// Its cost is the distance, m.
impl LeastSquares for Search<'_> {
    fn cost(&self) -> f64 {
        self.error.norm()
    }

    fn propose(&mut self, damping: f64) -> Option<Proposal> {
        let poses = self.chain.link_poses(&self.angles);
        let point = poses.frame(self.tip).translation.vector;
        let free: Vec<usize> = (0..self.tip.n_joints.min(MAX_JOINTS)).filter(|&j| !self.settings.locked[j]).collect();
        let mut jacobian = DMatrix::zeros(3, free.len());
        for (column, &joint) in free.iter().enumerate() {
            jacobian.set_column(column, &poses.point_jacobian(joint, &point));
        }
        let normal = jacobian.transpose() * &jacobian + DMatrix::identity(free.len(), free.len()) * damping;
        let delta = normal.cholesky()?.solve(&(jacobian.transpose() * self.error));
        let scale = (MAX_STEP_RAD / delta.amax().max(1e-12)).min(1.0);
        let mut next = self.angles;
        for (column, &joint) in free.iter().enumerate() {
            next[joint] += scale * delta[column];
        }
        self.trial = clamp(&next, self.settings);
        Some(Proposal { length: f64::INFINITY, predicted_gain: f64::INFINITY })
    }

    fn trial_cost(&mut self) -> Option<f64> {
        self.trial_error = position_error(self.chain, self.tip, self.goal, &self.trial);
        // A step that ends against the limits does not move the arm, so it counts as rejected.
        Some(self.trial_error.norm()).filter(|trial| *trial < self.error.norm())
    }

    fn accept(&mut self) {
        (self.angles, self.error) = (self.trial, self.trial_error);
    }
}

fn position_error(chain: &Chain, tip: &Attachment, goal: &IkGoal, angles: &JointAngles) -> Vector3<f64> {
    goal.position_m - chain.link_poses(angles).frame(tip).translation.vector
}

fn clamp(angles: &JointAngles, settings: &IkSettings) -> JointAngles {
    JointAngles::from_fn(angles.len(), |j| {
        let limits = settings.limits[j];
        angles[j].clamp(limits.lower_rad, limits.upper_rad)
    })
}
