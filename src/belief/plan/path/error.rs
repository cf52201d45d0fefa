//! Reasons why there is no path.

use armcal_core::codes::{Code, Coded};
use armcal_core::streams::JointAngles;

/// Reason why there is no path.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum PathError {
    #[error(
        "no way round was found after {tried} attempts; what blocks the straight way is {nearest} ({distance_m:.3} \
         m), and \
         {free:.0} % of it are free",
        free = 100.0 * free_share
    )]
    Blocked {
        tried: usize,
        nearest: String,
        /// Distance, m; zero: some arm within the bounds touches.
        distance_m: f64,
        /// Share of the straight edge, from the start, that is certified, 0 to 1.
        free_share: f64,
        /// True if no edge was found that leaves the start.
        is_stuck: bool,
    },
    #[error("the start is too near: {distance_m:.3} m between {nearest}; {needed_m:.3} m are needed (0: in collision)")]
    StartTooNear { nearest: String, distance_m: f64, needed_m: f64 },
    #[error(
        "the goal is too near: {distance_m:.3} m between {nearest}; {needed_m:.3} m are needed (0: in collision); \
         free is the straight way up to {free:.3?} rad",
        free = nearest_free.to_vec()
    )]
    GoalTooNear {
        nearest: String,
        distance_m: f64,
        needed_m: f64,
        /// Nearest free angles on the straight line from the start, found by halving; the way there is not tested.
        nearest_free: JointAngles,
    },
    #[error(
        "the goal turns joint {joint} to {angle_rad:.3} rad; for every arm within the sensors' error to stay off its \
         stops, {lower_rad:.3} to {upper_rad:.3} rad are left"
    )]
    GoalBeyondLimits { joint: usize, angle_rad: f64, lower_rad: f64, upper_rad: f64 },
}

impl Coded for PathError {
    fn code(&self) -> Code {
        match self {
            Self::Blocked { .. } => Code::PathNotFound,
            Self::StartTooNear { .. } => Code::ClearanceTooSmall,
            Self::GoalTooNear { .. } => Code::ClearanceTooSmall,
            Self::GoalBeyondLimits { .. } => Code::JointLimit,
        }
    }
}
