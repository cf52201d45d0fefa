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
    /// May the result be used, and by what rule; filled in once the summary is whole.
    #[serde(default)]
    pub verdict: VerdictSummary,
    /// Radius that contains the tool error with 95 % probability, m.
    #[serde(default)]
    pub u95_m: U95Summary,
    /// All reasons in words.
    pub refusal: Option<String>,
    /// The same as data, the most telling first.
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "armcal_belief::calib::refusals_in_files")]
    pub refusals: Vec<Refusal>,
    /// By the arm's clock, first to last step.
    pub simulated_s: Option<f64>,
    /// Of that, the time in which the arm was on its way.
    pub motion_s: Option<f64>,
    /// And in which the script only waited.
    pub waited_s: Option<f64>,
    pub wall_s: f64,
    /// Why the script ended before its last step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stopped: Option<String>,
    /// Joints that were given up on the way, in the order of time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub held_joints: Vec<HeldJointSummary>,
    /// What they leave within reach.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub still_reachable: Option<StillReachable>,
    /// Of a simulated arm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub world: Option<WorldSummary>,
    pub capture: CaptureSummary,
    pub calibration: CalibrationSummary,
    pub held_out: HeldOutSummary,
    /// From truth; absent for a real recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub score: Option<Score>,
    /// The script's `assert` steps.
    #[serde(default)]
    pub asserts: Vec<AssertSummary>,
    /// Of `work` steps that follow the online belief.
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
    /// `None` without a task.
    pub tolerance_m: Option<f64>,
    /// Largest probability over the targets.
    pub p_beyond_tolerance: Option<f64>,
    /// Unobservable parameters that U95 includes by their stated sigmas.
    pub conditions: Vec<Condition>,
}

/// Stated sigma that the result depends on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Condition {
    /// Kind of the element, or `not_included`.
    pub code: Code,
    pub what: String,
    /// One stated sigma, in `unit`.
    pub std: f64,
    pub unit: FindingUnit,
    /// Tool motion by one sigma, root mean square over the task, m.
    pub tool_error_m: f64,
    /// U95 includes it.
    pub included: bool,
}

/// U95 over the task.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct U95Summary {
    /// Largest of the targets, or of the recorded configurations without a task; `None` where it is not known.
    pub max: Option<f64>,
    pub targets: Vec<TargetU95>,
}

/// What was believed online at the end, and what happened until then; over time it is in belief.jsonl.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OnlineSummary {
    /// Taken in.
    pub views: usize,
    /// Expected error of the tool over the task, one sigma in space: now.
    pub tool_error_m: Summary,
    /// The same in an hour without any view.
    pub tool_error_in_an_hour_m: Summary,
    /// Whether that of now is within the task's tolerance.
    pub is_good_enough: Option<bool>,
    /// What happened.
    pub events: Vec<OnlineEvent>,
    /// Calibration poses that it asked for between tasks.
    pub asked: Vec<AskedPoses>,
}

impl OnlineSummary {
    /// `None` where there was no belief.
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

/// What simulated the arm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorldSummary {
    /// `featherstone` or `rapier`.
    pub engine: String,
}

/// A joint that did not follow its set-points and was held from then on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldJointSummary {
    pub joint: String,
    /// What was seen of it.
    pub kind: FailedKind,
    /// Where it was last believed to stand, and how far that may be off.
    pub angle_rad: f64,
    pub bound_rad: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaptureSummary {
    pub poses: usize,
    pub poses_skipped: usize,
    pub targets_skipped: usize,
    /// Which, and why.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skipped_targets: Vec<SkippedTarget>,
    /// Views with tags that the fit used.
    pub views: usize,
    pub detections: usize,
    pub rejected: usize,
    /// Single corners that the fit rejected; the others of their tags are in use.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rejected_corners: Option<usize>,
    /// The same by reason.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub rejected_by_reason: BTreeMap<String, usize>,
    /// Contacts of the arm with anything, from truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub collisions: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_clearance_m: Option<f64>,
    /// From truth: the links at the captured views, against the belief of that moment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margins: Option<MarginSummary>,
    /// Views after which belief and poses were renewed, with what was predicted then.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub renewals: Vec<RenewalSummary>,
    /// Why there were no more views.
    #[serde(default, alias = "ended", skip_serializing_if = "Option::is_none")]
    pub stop_reason: Option<String>,
}

/// One renewal of the belief while views were captured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RenewalSummary {
    pub views: usize,
    /// Since the capture began.
    pub elapsed_s: f64,
    /// Root mean square over the task.
    pub predicted_tool_error_m: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CalibrationSummary {
    pub outcome: Outcome,
    pub evaluations: usize,
    pub wall_s: f64,
    /// Absent where the recording has positions or poses of the tags and no corners.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_rms_px: Option<f64>,
    /// Distance between seen and surveyed landmarks over the fitted views, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_rms_m: Option<f64>,
    pub cost_initial: f64,
    pub cost_final: f64,
    pub unobservable: Vec<String>,
    /// The joint whose gain changed most, of those that were estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub largest_gain_change: Option<GainChange>,
    /// One sigma; what people read is U95.
    pub predicted_tool_error_m: Option<Summary>,
    /// The same with what the drawing leaves open.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_with_priors_m: Option<Summary>,
    /// U95 and the decision by it, as calibration.toml has them; summary.json has them as `u95_m` and `verdict`.
    #[serde(skip)]
    pub u95: U95Table,
    /// By the tag on the gripper, where the robot has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_mount: Option<CameraMount>,
    /// The further cameras whose mounts were estimated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub further_camera: Vec<FurtherCamera>,
    /// How much later the joint sensors' stamps are than the camera's, and one sigma, where moving joints tell it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_offset_s: Option<[f64; 2]>,
    /// What rests on priors alone, the largest at the tool first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reservations: Vec<Reservation>,
    /// What is other than robot.toml, survey and drawing say, the most telling first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<Finding>,
    /// Joints that failed, or whose sensors did.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub failed_joint: Vec<FailedJointTable>,
    /// What a warm calibration started from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorTable>,
    /// Where no survey says where the tags are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<MapResult>,
    /// Of `bundle`: what the data determine, before solving.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observability: Option<ObservabilityTable>,
    /// Of `bundle`: what the verdict rests on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdict: Option<VerdictTable>,
}

/// A gain against its datasheet, both relative.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GainChange {
    pub joint: String,
    /// Of either sign.
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
    /// By cross-validation: each view was held out of one fold, and the answer is fitted to all of them.
    #[serde(default, alias = "in_turn")]
    pub cross_validated: bool,
    pub rms_px: Option<f64>,
    pub rms_m: Option<f64>,
    /// The mean of the same distances, where views were cross-validated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_m: Option<f64>,
    /// Mean distance of the camera from where the landmarks' measured poses have it, where the recording has poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_mean_m: Option<f64>,
    /// The same views with the datasheet's sensors.
    pub nominal_rms_m: Option<f64>,
    /// The same by mount and map alone, and whether the calibration beats that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baseline: Option<BaselineComparison>,
    /// Views within the 95 % regions of what they measured.
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
    /// `None` when the script did not come to it, or there is no such figure.
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
    /// The part that a calibration alone can fill.
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

    /// Accepted, every `assert` of the script holds, and what is believed online is good enough at the end.
    #[must_use]
    pub fn is_good(&self) -> bool {
        let is_known = self.online.as_ref().is_none_or(|online| online.is_good_enough != Some(false));
        self.status == Status::Accepted && self.asserts_hold() && is_known
    }

    /// Whether every `assert` of the script holds.
    #[must_use]
    pub fn asserts_hold(&self) -> bool {
        self.asserts.iter().all(|limit| limit.holds)
    }
}
