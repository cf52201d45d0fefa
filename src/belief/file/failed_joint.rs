//! `[[failed_joint]]` and `[prior]` of calibration.toml: failures and their cost, and whether the views agree with a
//! prior.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::say::FailedJoint;
use armcal_core::kinematics::JointKind;
use armcal_core::robot::FailedKind;
use armcal_core::stats::Summary;

/// A joint that failed, or whose sensor failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FailedJointTable {
    /// Name of the joint in the URDF.
    pub joint: String,
    /// Kind of failure.
    pub kind: FailedKind,
    /// Source of the failure: `declared` or `detected`.
    pub found: String,
    /// Evidence of the failure, in words.
    pub evidence: String,
    /// Poses of the views whose reading of this joint was not used.
    pub poses: Vec<u32>,
    /// First pose after a slip that lasts. The calibration is that of the sensor since then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub since_pose: Option<u32>,
    /// Angle of a joint that is locked or held, rad; m for a slide.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle_rad: Option<f64>,
    /// Standard deviation of `angle_rad`; absent with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle_std_rad: Option<f64>,
    /// Standard deviation of the angle in a view like those if only the camera measures it, rad; m for a slide.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_std_rad: Option<f64>,
    /// Predicted tool error over the task if the joint's angle is known as well as now: from the rest of its sensor, or
    /// as locked. Otherwise the joint may be anywhere in its range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_error_m: Option<Summary>,
    /// Predicted tool error over the task if the camera measures the joint's angle, for which it must see tags.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_error_by_camera_m: Option<Summary>,
    /// Predicted tool error over the task with an uncalibrated sensor that conforms to the datasheet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_error_by_datasheet_m: Option<Summary>,
}

impl FailedJointTable {
    /// Returns the failure in the form that sentences use.
    #[must_use]
    pub fn told(&self) -> FailedJoint<'_> {
        let Self { joint, kind, evidence, since_pose, angle_rad, .. } = self;
        let held = !kind.stands_still() && angle_rad.is_some();
        FailedJoint { joint, kind: *kind, evidence, slipped: since_pose.is_some(), held }
    }
}

/// The prior of a warm calibration, and how well the views agree with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PriorTable {
    /// True if prior and views are consistent. Otherwise a script's recalibration uses only the new views.
    pub agrees: bool,
    /// True if the result uses the prior.
    pub used: bool,
    /// Hash (blake3) of the messages that the prior was made from.
    pub messages_hash: String,
    /// Time since the prior's last view, h.
    pub elapsed_h: f64,
    /// Squared Mahalanobis distance of the estimate from the prior, under the covariance of their difference.
    pub chi_square: f64,
    /// Number of tested directions: those that the views determine well enough.
    pub degrees_of_freedom: usize,
    /// The 0.999 quantile of chi-square for these degrees of freedom.
    pub chi_square_limit: f64,
    /// Joint with the largest mean deviation over the views, in standard deviations.
    pub worst_joint: String,
    /// Motion of `worst_joint`. If it slides, the next two values are in m.
    #[serde(default, skip_serializing_if = "JointKind::is_turning")]
    pub moves: JointKind,
    /// Deviation of that joint's angle, rad; positive where the new views give a larger angle than the prior.
    pub worst_off_rad: f64,
    /// Standard deviation of `worst_off_rad`.
    pub worst_off_std_rad: f64,
}

impl PriorTable {
    pub(crate) fn unused(self) -> Self {
        Self { used: false, ..self }
    }
}
