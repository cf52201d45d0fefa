//! summary.json. Lengths in m, angles in rad, times in s.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::score::{MarginSummary, Score};
use armcal_belief::calib::online::OnlineEvent;
use armcal_belief::calib::{
    BaselineComparison, Calibration, CameraMount, FailedJointTable, FurtherCamera, JointResult, MapResult,
    ObservabilityTable, PriorTable, Refusal, Reservation, Status, VerdictTable, ViewContainment,
};
use armcal_belief::judge::{TargetU95, U95Table};
use armcal_belief::say::{Finding, FindingUnit};
use armcal_belief::session::{AskedPoses, OnlineOutcome, SkippedTarget, StillReachable};
use armcal_core::codes::Code;
use armcal_core::numeric::Outcome;
use armcal_core::robot::FailedKind;
use armcal_core::routine::AssertFigure;
use armcal_core::stats::Summary;

/// The figures of a run or of a calibration, for programs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunSummary {
    pub version: u32,
    /// `None` where a recording was calibrated without a routine.
    pub routine: Option<String>,
    pub robot: String,
    pub seed: Option<u64>,
    pub method: String,
    pub status: Status,
    /// Decision on the use of the result, and its rule; filled in once the summary is complete.
    #[serde(default)]
    pub verdict: VerdictSummary,
    /// Radius that contains the tool error with 95 % probability, m.
    #[serde(default)]
    pub u95_m: U95Summary,
    /// All reasons of the refusal in words.
    pub refusal: Option<String>,
    /// The reasons of the refusal as data, the most telling first.
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "armcal_belief::calib::refusals_in_files")]
    pub refusals: Vec<Refusal>,
    /// Duration from the first step to the last by the arm's clock, s.
    pub simulated_s: Option<f64>,
    /// Part of `simulated_s` in which the arm moved, s.
    pub motion_s: Option<f64>,
    /// Part of `simulated_s` in which the script only waited, s.
    pub waited_s: Option<f64>,
    pub wall_s: f64,
    /// Reason that the script ended before its last step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stopped: Option<String>,
    /// Joints that were abandoned during the run, in the order of time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub held_joints: Vec<HeldJointSummary>,
    /// Targets that remain reachable with the held joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub still_reachable: Option<StillReachable>,
    /// Simulation settings; absent for a real arm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub world: Option<WorldSummary>,
    pub capture: CaptureSummary,
    pub calibration: CalibrationSummary,
    pub held_out: HeldOutSummary,
    /// Errors from the simulator's truth; absent for a real recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub score: Option<Score>,
    /// Limits of the script's `assert` steps.
    #[serde(default)]
    pub asserts: Vec<AssertSummary>,
    /// Online estimate during `work` steps that follow it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub online: Option<OnlineSummary>,
}

/// A verdict for programs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VerdictSummary {
    /// `green`, `amber` or `refused`.
    pub grade: String,
    /// Reasons of the grade, the most telling first.
    pub codes: Vec<Code>,
    pub rule: String,
    /// Tolerance of the task for the tool error, m; `None` without a task.
    pub tolerance_m: Option<f64>,
    /// Largest probability over the targets that the tool error exceeds the tolerance.
    pub p_beyond_tolerance: Option<f64>,
    /// Unobservable parameters that U95 includes by their stated sigmas.
    pub conditions: Vec<Condition>,
}

/// Stated sigma that the result depends on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Condition {
    /// Kind of the unobservable parameter, or `not_included`.
    pub code: Code,
    pub what: String,
    /// Stated standard deviation, in `unit`.
    pub std: f64,
    pub unit: FindingUnit,
    /// Tool motion by one sigma, root mean square over the task, m.
    pub tool_error_m: f64,
    /// True if U95 includes this parameter.
    pub included: bool,
}

/// U95 over the task.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct U95Summary {
    /// Largest U95 of the targets, m, or of the recorded configurations without a task; `None` if it is unknown.
    pub max: Option<f64>,
    pub targets: Vec<TargetU95>,
}

/// The online estimate at the end, and the events until then; its values over time are in belief.jsonl.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OnlineSummary {
    /// Views that the estimate includes.
    pub views: usize,
    /// Predicted tool error over the task at the end, one standard deviation in space, m.
    pub tool_error_m: Summary,
    /// Predicted tool error over the task one hour later without any further view, m.
    pub tool_error_in_an_hour_m: Summary,
    /// True if the predicted tool error at the end is within the task's tolerance.
    pub is_good_enough: Option<bool>,
    /// Events of the online estimate, in the order of time.
    pub events: Vec<OnlineEvent>,
    /// Calibration poses that the estimate requested between tasks.
    pub asked: Vec<AskedPoses>,
}

impl OnlineSummary {
    /// Summary of the last estimate; `None` if there was no online estimate.
    #[must_use]
    pub fn of(online: &OnlineOutcome) -> Option<Self> {
        let last = online.log.beliefs().last()?;
        Some(Self {
            views: last.views,
            tool_error_m: last.tool_error_m,
            tool_error_in_an_hour_m: last.tool_error_in_an_hour_m,
            is_good_enough: online.is_good_enough,
            events: online.log.events().cloned().collect(),
            asked: online.asked.clone(),
        })
    }
}

/// Simulation of the arm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorldSummary {
    /// Physics engine: `featherstone` or `rapier`.
    pub engine: String,
}

/// A joint that did not follow its set-points and was held from then on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldJointSummary {
    pub joint: String,
    /// Kind of failure that was observed.
    pub kind: FailedKind,
    /// Last estimate of the joint angle, rad. `bound_rad` is the largest error that it may have, rad.
    pub angle_rad: f64,
    pub bound_rad: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaptureSummary {
    pub poses: usize,
    pub poses_skipped: usize,
    pub targets_skipped: usize,
    /// The skipped targets with reasons.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skipped_targets: Vec<SkippedTarget>,
    /// Views with tags that the fit used.
    pub views: usize,
    pub detections: usize,
    pub rejected: usize,
    /// Single corners that the fit rejected; the others of their tags are in use.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rejected_corners: Option<usize>,
    /// Rejected observations by reason.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub rejected_by_reason: BTreeMap<String, usize>,
    /// Contacts of the arm with anything, from truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub collisions: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_clearance_m: Option<f64>,
    /// Errors of the links at the captured views against the estimate of that moment, from the simulator's truth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margins: Option<MarginSummary>,
    /// Views after which estimate and poses were updated, with the tool error predicted then.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub renewals: Vec<RenewalSummary>,
    /// Reason that the capture ended.
    #[serde(default, alias = "ended", skip_serializing_if = "Option::is_none")]
    pub stop_reason: Option<String>,
}

/// One update of the estimate while views were captured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RenewalSummary {
    pub views: usize,
    /// Time since the capture began, s.
    pub elapsed_s: f64,
    /// Predicted tool error over the task, root mean square, m.
    pub predicted_tool_error_m: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CalibrationSummary {
    pub outcome: Outcome,
    pub evaluations: usize,
    pub wall_s: f64,
    /// Residual of the tags' corners, rms, px; absent where the recording has positions or poses of the tags and no
    /// corners.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_rms_px: Option<f64>,
    /// Distance between observed and surveyed landmarks over the fitted views, rms, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_rms_m: Option<f64>,
    pub cost_initial: f64,
    pub cost_final: f64,
    pub unobservable: Vec<String>,
    /// Largest change of an estimated gain, with its joint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub largest_gain_change: Option<GainChange>,
    /// Predicted tool error over the task, one standard deviation, m; reports for people state U95.
    pub predicted_tool_error_m: Option<Summary>,
    /// Predicted tool error over the task with the uncertainty of the nominal model included, one standard deviation,
    /// m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_with_priors_m: Option<Summary>,
    /// U95 and the decision by it, as in calibration.toml; summary.json has them as `u95_m` and `verdict`.
    #[serde(skip)]
    pub u95: U95Table,
    /// Camera mount as determined by the tag on the gripper, where the robot has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_mount: Option<CameraMount>,
    /// Further cameras whose mounts were estimated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub further_camera: Vec<FurtherCamera>,
    /// Delay of the joint sensors' stamps behind the camera's and its standard deviation, s; `None` where no joint
    /// moved enough to determine it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_offset_s: Option<[f64; 2]>,
    /// Parameters that only their priors determine, the largest at the tool first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reservations: Vec<Reservation>,
    /// Deviations from robot.toml, survey and nominal model (URDF), the most telling first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<Finding>,
    /// Failed joints, and joints whose sensors failed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub failed_joint: Vec<FailedJointTable>,
    /// Earlier calibration that served as prior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorTable>,
    /// Estimated tag map, where no survey gives the tags' poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<MapResult>,
    /// Parameters that the data determine, computed before solving; only for `bundle`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observability: Option<ObservabilityTable>,
    /// Figures that the verdict depends on; only for `bundle`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdict: Option<VerdictTable>,
}

/// Gain relative to its datasheet value; `change` and `std` are relative.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GainChange {
    pub joint: String,
    /// Gain over its datasheet value, less one; of either sign.
    pub change: f64,
    pub std: f64,
}

impl GainChange {
    fn largest(joints: &[JointResult]) -> Option<Self> {
        let estimated = joints.iter().filter(|joint| joint.gain_estimated);
        let changes = estimated.filter_map(|joint| {
            let gain = joint.gain_over_datasheet?;
            let std = joint.gain_std_rad_per_count * (gain / joint.gain_rad_per_count).abs();
            Some(Self { joint: joint.name.clone(), change: gain - 1.0, std })
        });
        changes.max_by(|a, b| a.change.abs().total_cmp(&b.change.abs()))
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOutSummary {
    pub views: usize,
    /// True if the views are cross-validated: each view was held out of one fold, and the answer is fitted to all
    /// views.
    #[serde(default, alias = "in_turn")]
    pub cross_validated: bool,
    pub rms_px: Option<f64>,
    pub rms_m: Option<f64>,
    /// Mean distance over the cross-validated views, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_m: Option<f64>,
    /// Mean distance of the camera from its position by the landmarks' measured poses, m; only where the recording has
    /// poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_mean_m: Option<f64>,
    /// Distance for the same views with the datasheet's sensors, rms, m.
    pub nominal_rms_m: Option<f64>,
    /// Comparison with a baseline of mount and map only, and whether the calibration has the smaller distances.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baseline: Option<BaselineComparison>,
    /// Count of the views within the 95 % regions of their measurements.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within_95: Option<ViewContainment>,
}

/// One limit of an `assert` step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AssertSummary {
    /// Number of the step in the script, from 1.
    pub step: usize,
    pub key: AssertFigure,
    pub limit: f64,
    /// Value of the figure; `None` if the script did not reach the step, or the figure does not exist.
    pub value: Option<f64>,
    pub holds: bool,
}

impl CalibrationSummary {
    fn of(calibration: &Calibration, wall_s: f64) -> Self {
        Self {
            outcome: calibration.fit.outcome,
            evaluations: calibration.fit.evaluations,
            wall_s,
            residual_rms_px: calibration.fit.rms_px,
            residual_rms_m: calibration.fit.rms_m.is_finite().then_some(calibration.fit.rms_m),
            cost_initial: calibration.fit.cost_initial,
            cost_final: calibration.fit.cost_final,
            unobservable: calibration.unobservable.clone(),
            largest_gain_change: GainChange::largest(&calibration.joint),
            predicted_tool_error_m: calibration.predicted_tool_error_m,
            predicted_tool_error_with_priors_m: calibration.predicted_tool_error_with_priors_m,
            u95: calibration.u95.clone(),
            camera_mount: calibration.camera_mount.clone(),
            further_camera: calibration.further_camera.clone(),
            time_offset_s: calibration.model.as_ref().and_then(|model| model.time_offset_s),
            reservations: calibration.reservations.clone(),
            findings: calibration.findings.clone(),
            failed_joint: calibration.failed_joint.clone(),
            prior: calibration.prior.clone(),
            map: calibration.map.clone(),
            observability: calibration.observability.clone(),
            verdict: calibration.verdict.clone(),
        }
    }
}

impl RunSummary {
    /// The part of the summary that a calibration can fill without a run.
    #[must_use]
    pub fn of_calibration(calibration: &Calibration, calibration_wall_s: f64) -> Self {
        Self {
            version: 1,
            routine: None,
            robot: calibration.robot.clone(),
            seed: None,
            method: calibration.method.to_string(),
            status: calibration.status,
            verdict: VerdictSummary::default(),
            u95_m: U95Summary { max: calibration.u95.max_m, targets: calibration.u95.target.clone() },
            refusal: calibration.refusal.clone(),
            refusals: calibration.refusals.clone(),
            simulated_s: None,
            motion_s: None,
            waited_s: None,
            stopped: None,
            online: None,
            held_joints: Vec::new(),
            still_reachable: None,
            wall_s: calibration_wall_s,
            world: None,
            capture: CaptureSummary {
                poses: calibration.fit.views
                    + if calibration.held_out.cross_validated { 0 } else { calibration.held_out.views },
                poses_skipped: 0,
                targets_skipped: 0,
                skipped_targets: Vec::new(),
                views: calibration.fit.views,
                detections: calibration.fit.tags_seen,
                rejected: calibration.fit.rejected,
                rejected_corners: calibration.fit.rejected_corners,
                rejected_by_reason: calibration.fit.rejected_by_reason.clone(),
                collisions: None,
                min_clearance_m: None,
                margins: None,
                renewals: Vec::new(),
                stop_reason: None,
            },
            calibration: CalibrationSummary::of(calibration, calibration_wall_s),
            held_out: HeldOutSummary {
                views: calibration.held_out.views,
                cross_validated: calibration.held_out.cross_validated,
                rms_px: calibration.held_out.rms_px,
                rms_m: calibration.held_out.rms_m,
                mean_m: calibration.held_out.mean_m,
                camera_mean_m: calibration.held_out.camera_mean_m,
                nominal_rms_m: calibration.held_out.nominal_rms_m,
                baseline: calibration.held_out.baseline,
                within_95: calibration.held_out.within_95,
            },
            score: None,
            asserts: Vec::new(),
        }
    }

    /// True if the calibration is accepted, every `assert` of the script holds, and the online estimate is good enough
    /// at the end.
    #[must_use]
    pub fn is_good(&self) -> bool {
        let is_known = self.online.as_ref().is_none_or(|online| online.is_good_enough != Some(false));
        self.status == Status::Accepted && self.asserts_hold() && is_known
    }

    /// True if every `assert` of the script holds.
    #[must_use]
    pub fn asserts_hold(&self) -> bool {
        self.asserts.iter().all(|limit| limit.holds)
    }
}
