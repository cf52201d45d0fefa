//! `[[failed_joint]]` and `[prior]` of calibration.toml: what failed and what that costs, and whether a prior held.

use serde::{Deserialize, Serialize};

use super::associate::View;
use super::bundle::{Estimate, Failure, FailureSource, PriorConsistency};
use super::problem::JointParameters;
use super::uncertainty::{ParameterCovariance, predict_tool_error};
use armcal_core::robot::{FailedJoint, FailedKind, Robot};
use armcal_core::stats::Summary;
use armcal_core::streams::ReachTask;

/// One joint that failed, or whose sensor did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailedJointTable {
    pub joint: String,
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
    /// Where a locked joint stands, with one sigma.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle_rad: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle_std_rad: Option<f64>,
    /// One sigma of the angle where the camera alone tells it, in a view like those.
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

/// The prior of a warm calibration, and how well the views agree with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorTable {
    /// Whether prior and views can both be right. Where they cannot, a script's recalibration rests on the new views alone.
    pub agrees: bool,
    /// Whether the result rests on it.
    pub used: bool,
    /// blake3 of the messages that the prior rests on.
    pub messages_hash: String,
    /// Hours since its last view.
    pub elapsed_h: f64,
    pub chi_square: f64,
    pub degrees_of_freedom: usize,
    /// The 0.999 quantile.
    pub chi_square_limit: f64,
    /// The joint that is off the most in its own sigma: mean over the views.
    pub worst_joint: String,
    pub worst_off_rad: f64,
    pub worst_off_std_rad: f64,
}

impl PriorTable {
    pub(super) fn unused(self) -> Self {
        Self { used: false, ..self }
    }

    pub(super) fn of(messages_hash: &str, elapsed_h: f64, agreement: &PriorConsistency, robot: &Robot) -> Self {
        Self {
            agrees: !agreement.is_beyond_chance(),
            used: true,
            messages_hash: messages_hash.to_owned(),
            elapsed_h,
            chi_square: agreement.chi2,
            degrees_of_freedom: agreement.degrees_of_freedom,
            chi_square_limit: agreement.limit,
            worst_joint: robot.sensors[agreement.joint].joint.clone(),
            worst_off_rad: agreement.off_rad,
            worst_off_std_rad: agreement.off_std_rad,
        }
    }
}

/// An estimate with failed joints, on the way to the tool.
pub(super) struct FailureImpact<'a> {
    pub datasheet: &'a Robot,
    /// As the estimate has it, camera and tags where they were found.
    pub robot: &'a Robot,
    pub views: &'a [View],
    pub failures: &'a [Failure],
    pub found: &'a Estimate<'a>,
    pub parameters: &'a JointParameters,
    /// With the locked joints' rows.
    pub covariance: &'a ParameterCovariance,
    pub task: Option<&'a ReachTask>,
}

/// How a failed joint's angle is known.
#[derive(Clone, Copy, PartialEq, Eq)]
enum AngleSource {
    AsItIs,
    ByCamera,
    ByDatasheet,
}

impl FailureImpact<'_> {
    /// The tool error that is to be expected as things are.
    pub(super) fn tool_error_m(&self) -> Option<Summary> {
        self.tool_error_where(usize::MAX, AngleSource::AsItIs)
    }

    pub(super) fn tables(&self) -> Vec<FailedJointTable> {
        self.failures.iter().map(|failure| self.table(failure)).collect()
    }

    fn table(&self, failure: &Failure) -> FailedJointTable {
        let joint = failure.joint;
        let pose = |&view_idx: &usize| self.views[view_idx].pose_idx;
        let is_locked = failure.kind == FailedKind::Locked;
        let has_no_sensor = failure.leaves_no_sensor();
        let angle = self.locked_angle(failure);
        FailedJointTable {
            joint: self.robot.sensors[joint].joint.clone(),
            kind: failure.kind,
            found: match failure.found {
                FailureSource::Declared => "declared",
                FailureSource::Detected => "detected",
            }
            .to_owned(),
            evidence: failure.evidence.clone(),
            poses: failure.views.iter().map(pose).collect(),
            since_pose: failure.since.as_ref().map(pose),
            angle_rad: angle.map(|(angle_rad, _)| angle_rad),
            angle_std_rad: angle.map(|(_, std_rad)| std_rad),
            camera_std_rad: self.camera_std_rad(failure),
            tool_error_m: self.tool_error_m(),
            tool_error_by_camera_m: (has_no_sensor && !is_locked)
                .then(|| self.tool_error_where(joint, AngleSource::ByCamera))
                .flatten(),
            tool_error_by_datasheet_m: has_no_sensor
                .then(|| self.tool_error_where(joint, AngleSource::ByDatasheet))
                .flatten(),
        }
    }

    /// Where a locked joint stands and one sigma, rad: the mean over the views, which all show one angle.
    fn locked_angle(&self, failure: &Failure) -> Option<(f64, f64)> {
        if failure.kind != FailedKind::Locked {
            return None;
        }
        let joint = failure.joint;
        let seen: Vec<usize> = (0..self.views.len()).filter(|&k| self.found.uses(k)).collect();
        let n = seen.len().max(1) as f64;
        let angle_rad = seen.iter().map(|&k| self.found.angle(k, joint).0).sum::<f64>() / n;
        let std_rad = self.found.mean_angle_std_rad(joint);
        Some((angle_rad, std_rad))
    }

    /// Root mean square over the views in which the camera alone told the angle.
    fn camera_std_rad(&self, failure: &Failure) -> Option<f64> {
        let freed: Vec<f64> = failure
            .views
            .iter()
            .filter(|&&k| failure.kind != FailedKind::Locked && self.found.uses(k))
            .map(|&k| self.found.angle(k, failure.joint).1.powi(2))
            .collect();
        (!freed.is_empty()).then(|| (freed.iter().sum::<f64>() / freed.len() as f64).sqrt())
    }

    /// With the angle of `joint` known in that way, those of the other failed joints as they are.
    fn tool_error_where(&self, joint: usize, known: AngleSource) -> Option<Summary> {
        let mut robot = self.robot.clone();
        let mut covariance = self.covariance.clone();
        let mut residual_std_rad = covariance.residual_std_rad?;
        for failure in self.failures {
            let j = failure.joint;
            let known = if j == joint { known } else { AngleSource::AsItIs };
            let spec = &mut robot.sensors[j];
            match known {
                AngleSource::AsItIs if failure.kind == FailedKind::Locked => {
                    let declared = FailedJoint { joint: j, kind: FailedKind::Locked };
                    if let Some((angle_rad, _)) = self.locked_angle(failure) {
                        robot.stowed[j] = angle_rad;
                    }
                    robot = robot.with_failed(&[declared]);
                }
                AngleSource::AsItIs if failure.leaves_no_sensor() => {
                    // Uniform over the range.
                    (spec.offset_std_rad, spec.gain_std) = (0.0, 0.0);
                    residual_std_rad[j] = spec.half_range_rad / 3.0_f64.sqrt();
                }
                AngleSource::AsItIs => {}
                AngleSource::ByCamera => {
                    (spec.offset_std_rad, spec.gain_std) = (0.0, 0.0);
                    residual_std_rad[j] = self.camera_std_rad(failure)?;
                }
                AngleSource::ByDatasheet => {
                    *spec = self.datasheet.sensors[j].clone();
                    residual_std_rad[j] = spec.linearity_std_rad;
                    covariance = covariance.without_joint(j);
                    robot.failed.retain(|declared| declared.joint != j);
                }
            }
        }
        covariance.residual_std_rad = Some(residual_std_rad);
        predict_tool_error(&robot, self.parameters, &covariance, self.task).map(|predicted| predicted.error_m)
    }

    /// Why the calibration cannot be used for its task, or at all.
    pub(super) fn refusal(&self, tables: &[FailedJointTable]) -> Option<String> {
        let reasons: Vec<String> =
            self.failures.iter().zip(tables).filter_map(|(failure, table)| self.one_refusal(failure, table)).collect();
        (!reasons.is_empty()).then(|| reasons.join("; "))
    }

    fn one_refusal(&self, failure: &Failure, table: &FailedJointTable) -> Option<String> {
        let name = &table.joint;
        if failure.has_too_few_views_since(self.views.len()) {
            let n = self.views.len() - failure.views.len();
            return Some(format!("{name}: {}; {n} views are too few to calibrate it as it is now", table.evidence));
        }
        let task = self.task?;
        let is_needed = failure.joint < self.robot.tool.mount.n_joints;
        if !failure.leaves_no_sensor() || failure.kind == FailedKind::Locked || !is_needed {
            return None;
        }
        let mm = |summary: Option<Summary>| summary.map_or(f64::INFINITY, |s| s.p95 * 1e3);
        let (blind, seeing) = (mm(table.tool_error_m), mm(table.tool_error_by_camera_m));
        Some(format!(
            "the sensor of {name} is {}, and the task needs that joint: without it the tool error is {blind:.0} mm for a tolerance of \
             {:.1} mm; while the camera sees tags and tells the joint's angle it is {seeing:.1} mm",
            failure.kind.name(),
            task.tolerance_m * 1e3
        ))
    }
}
