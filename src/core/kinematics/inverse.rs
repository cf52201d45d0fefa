//! Inverse kinematics for a tool position: damped least squares inside the limits, pulled towards a posture.
//!
//! Levenberg-Marquardt on the position error with a weak pull to the seed posture in the null space
//! (Nakamura and Hanafusa 1986); joints at a limit are held for the step.

use nalgebra::{DMatrix, Vector3};

use super::chain::{Chain, JointLimits};
use super::link_poses::Attachment;
use crate::joints::{JointAngles, MAX_JOINTS};
use crate::numeric::{Damping, LeastSquares, Proposal, Stop, StopRule, minimize};

/// Where to bring a frame's origin, base frame, m.
#[derive(Clone, Copy, Debug)]
pub struct IkGoal {
    /// Where the frame's origin is to be, base frame.
    pub position_m: Vector3<f64>,
}

/// What the solver may do.
#[derive(Clone, Debug)]
pub struct IkSettings {
    /// Range allowed to each joint, rad.
    pub limits: Vec<JointLimits>,
    /// Joints that stay at the seed's angle.
    pub locked: Vec<bool>,
    /// Distance from the goal at which the search ends.
    pub tolerance_m: f64,
    /// Limit of the steps proposed.
    pub max_iterations: usize,
}

/// Why no angles were found.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
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

/// Added to the normal matrix, m^2/rad^2.
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
        // Against its limits the arm goes nowhere: that is no step that helps.
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
