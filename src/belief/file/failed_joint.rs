//! `[[failed_joint]]` and `[prior]` of calibration.toml: what failed and what that costs, and whether a prior held.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::say::FailedJoint;
use armcal_core::kinematics::JointKind;
use armcal_core::robot::FailedKind;
use armcal_core::stats::Summary;

/// One joint that failed, or whose sensor did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FailedJointTable {
    /// Name of the joint in the URDF.
    pub joint: String,
    /// What is wrong with it.
    pub kind: FailedKind,
    /// `declared` or `detected`.
    pub found: String,
    /// What shows it.
    pub evidence: String,
    /// Poses of the views whose reading was not used.
    pub poses: Vec<u32>,
    /// Of a slip that lasts: the first pose after it. The sensor is calibrated as it is since then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub since_pose: Option<u32>,
    /// Where a locked joint stands, with one sigma; m of a slide.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle_rad: Option<f64>,
    /// Absent where `angle_rad` is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle_std_rad: Option<f64>,
    /// One sigma of the angle where the camera alone tells it, in a view like those; m of a slide.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_std_rad: Option<f64>,
    /// Predicted tool error over the task where the joint's angle is known ...
    /// ... as well as it now is: by what is left of its sensor, or as locked; else anywhere in its range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_error_m: Option<Summary>,
    /// ... by the camera, which then must see tags.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_error_by_camera_m: Option<Summary>,
    /// ... by a sound sensor of the datasheet, nothing calibrated on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_error_by_datasheet_m: Option<Summary>,
}

impl FailedJointTable {
    /// The same, for sentences.
    #[must_use]
    pub fn told(&self) -> FailedJoint<'_> {
        let Self { joint, kind, evidence, since_pose, .. } = self;
        FailedJoint { joint, kind: *kind, evidence, slipped: since_pose.is_some() }
    }
}

/// The prior of a warm calibration, and how well the views agree with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PriorTable {
    /// Whether prior and views can both be right. Where they cannot, a script's recalibration rests on the new views
    /// alone.
    pub agrees: bool,
    /// Whether the result rests on it.
    pub used: bool,
    /// blake3 of the messages that the prior rests on.
    pub messages_hash: String,
    /// Hours since its last view.
    pub elapsed_h: f64,
    /// Square of the estimate's move from the prior under its covariance.
    pub chi_square: f64,
    /// Number of directions that the views tell enough of to be tested.
    pub degrees_of_freedom: usize,
    /// The 0.999 quantile.
    pub chi_square_limit: f64,
    /// The joint that is off the most in its own sigma: mean over the views.
    pub worst_joint: String,
    /// Whether that joint slides: the two figures that follow are in m then.
    #[serde(default, skip_serializing_if = "JointKind::is_turning")]
    pub moves: JointKind,
    /// Positive where the new views put the joint's angle above the prior's.
    pub worst_off_rad: f64,
    /// One sigma of `worst_off_rad`.
    pub worst_off_std_rad: f64,
}

impl PriorTable {
    pub(crate) fn unused(self) -> Self {
        Self { used: false, ..self }
    }
}
