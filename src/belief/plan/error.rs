//! Reasons why there is no plan.

use armcal_core::codes::{Code, Coded};
use armcal_core::kinematics::IkError;

use crate::plan::path::PathError;

/// Reason why there is no plan.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum PlanError {
    #[error(
        "target {n} at ({x:.3}, {y:.3}, {z:.3}) m: {source}",
        n = target + 1, x = at_m[0], y = at_m[1], z = at_m[2]
    )]
    TargetOutOfReach { target: usize, at_m: [f64; 3], source: IkError },
    #[error(
        "target {n} at ({x:.3}, {y:.3}, {z:.3}) m: reached only with {clearance_m:.4} m of clearance between \
         {nearest}; {needed_m:.4} m are needed for every arm within the sensors' error",
        n = target + 1, x = at_m[0], y = at_m[1], z = at_m[2]
    )]
    TargetTooClose { target: usize, at_m: [f64; 3], clearance_m: f64, nearest: String, needed_m: f64 },
    #[error(
        "the arm starts too close: {clearance_m:.3} m between {nearest}; {needed_m:.3} m are needed (0: in collision)"
    )]
    StartTooClose { clearance_m: f64, nearest: String, needed_m: f64 },
    #[error(
        "no pose was found that sees {min_tags} of the {n_tags} surveyed tags and keeps {clearance_m:.3} m clear \
         ({tried} tried): {hint}; place tags where the camera reaches them, or lower capture.min_tags or \
         capture.clearance_m"
    )]
    NoUsefulPose { min_tags: u32, n_tags: usize, clearance_m: f64, tried: usize, hint: String },
    #[error(
        "no pose was found that sees {min_tags} of the {n_tags} surveyed tags: add tags, or lower capture.min_tags to \
         1 .. {n_tags}"
    )]
    TooFewTags { min_tags: u32, n_tags: usize },
    #[error(
        "only {found} of {wanted} poses were found that see {min_tags} tags and keep clear: {hint}; ask for fewer \
         poses, place tags where the camera reaches them, or lower capture.min_tags or capture.clearance_m"
    )]
    TooFewPoses { found: usize, wanted: usize, min_tags: u32, hint: String },
    #[error(transparent)]
    Path(#[from] PathError),
}

impl PlanError {
    /// Returns the error with the target's number set to `number`, its position in the task's list.
    #[must_use]
    pub fn of_target(mut self, number: usize) -> Self {
        if let Self::TargetOutOfReach { target, .. } | Self::TargetTooClose { target, .. } = &mut self {
            *target = number;
        }
        self
    }
}

impl Coded for PlanError {
    fn code(&self) -> Code {
        match self {
            Self::TargetOutOfReach { .. } => Code::TargetOutOfReach,
            Self::TargetTooClose { .. } | Self::StartTooClose { .. } => Code::ClearanceTooSmall,
            Self::NoUsefulPose { .. } | Self::TooFewTags { .. } | Self::TooFewPoses { .. } => Code::PosesMissing,
            Self::Path(error) => error.code(),
        }
    }
}
