//! calibration.toml: the answer, how sure it is, what it rests on and where it holds.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::associate::CaptureData;
use super::camera_mount::CameraMount;
use super::failed_joint::{FailedJointTable, PriorTable};
use super::gripper_tag::MountEstimate;
use super::identify::IdentifiedScale;
use super::map::MapResult;
use super::methods::{EndStopReading, Solution};
use super::model_table::ModelTable;
use super::observability::{Unobservable, grouped_names};
use super::problem::{JointParameters, Parameter, ParameterKind, PositionProblem};
use super::terms_table::{ReferenceTable, TermsTable};
use super::uncertainty::{ParameterCovariance, ToolErrorPrediction};
use super::valid_range::ValidRange;
use super::verdict::{AcceptanceData, refusal};
use super::verdict_tables::{ObservabilityTable, VerdictTable};
use armcal_core::robot::Robot;
use armcal_core::routine::Method;
use armcal_core::sensor::ConditionChange;
use armcal_core::stats::Summary;

/// Whether the answer may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    Accepted,
    Refused,
}

/// One calibration, as its file has it.
///
/// `angle_rad = center_rad + offset_rad + gain_rad_per_count * travel_counts`, where `travel_counts` is the reading less
/// the datasheet's reading at `center_rad`, wrapped to half a word either way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    pub version: u32,
    pub robot: String,
    pub method: Method,
    pub status: Status,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refusal: Option<String>,
    /// Hash of the recorded messages that this rests on (blake3).
    pub messages_hash: String,
    /// What the data did not determine, and why; these keep the datasheet's values.
    pub unobservable: Vec<String>,
    /// Sightings that were left out because they do not agree with the rest: `pose 12: tag 3: 45 sigma`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outliers: Vec<String>,
    pub fit: FitMetrics,
    pub held_out: HeldOutMetrics,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_m: Option<Summary>,
    pub valid: ValidRange,
    /// What the joints' terms are counted from, where there are any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<ReferenceTable>,
    /// Where the robot has a tag on the gripper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_mount: Option<CameraMount>,
    /// Where the tags were found to be, where no survey said it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<MapResult>,
    /// Of `bundle`: what the data determine, before solving.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observability: Option<ObservabilityTable>,
    /// Of `bundle`: what the verdict rests on beside `held_out`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdict: Option<VerdictTable>,
    /// What `bundle` took for its model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelTable>,
    pub joint: Vec<JointResult>,
    /// Joints that failed, or whose sensors did.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub failed_joint: Vec<FailedJointTable>,
    /// What a warm calibration by `bundle` started from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorTable>,
    /// Estimated parameters in the order of the covariance's rows, by [`Parameter::name`]: gains relative, offsets in rad, ...
    pub covariance: CovarianceTable,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitMetrics {
    pub outcome: String,
    pub evaluations: usize,
    pub cost_initial: f64,
    pub cost_final: f64,
    pub views: usize,
    pub tags_seen: usize,
    pub rejected: usize,
    /// The same by reason; not in the file.
    #[serde(default, skip_serializing)]
    pub rejected_by_reason: BTreeMap<String, usize>,
    pub rms_m: f64,
    /// Absent where the recording has positions or poses and no corners.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_px: Option<f64>,
    /// How many times the datasheets' linearity the sensors deviate from a straight line, by the residuals; at least 1.
    #[serde(default = "as_the_datasheet_says")]
    pub linearity_scale: f64,
}

fn as_the_datasheet_says() -> f64 {
    1.0
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOutMetrics {
    pub views: usize,
    /// Every view was held out in turn and fitted in the end; else the fit never saw these.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub in_turn: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_m: Option<f64>,
    /// The mean of the same distances, where views were held out in turn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_m: Option<f64>,
    /// Mean distance of the camera from where the landmarks' measured poses have it, m; where the recording has poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_mean_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_px: Option<f64>,
    /// The same views with the datasheet's sensors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nominal_rms_m: Option<f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointResult {
    pub name: String,
    pub center_rad: f64,
    pub gain_rad_per_count: f64,
    pub offset_rad: f64,
    /// One sigma; the datasheet's where the joint was not determined.
    pub gain_std_rad_per_count: f64,
    pub offset_std_rad: f64,
    pub gain_estimated: bool,
    pub offset_estimated: bool,
    /// Angles that the captured views covered.
    pub covered_rad: [f64; 2],
    /// The gain over the datasheet's; negative where the counts run the other way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_over_datasheet: Option<f64>,
    /// Counts per radian over the datasheet's, where they were measured first because nobody knew them; the gain's relative
    /// standard deviation in `covariance` is about that scale.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identified_ratio: Option<f64>,
    /// One sigma of what the parameters leave of the sensor's error; absent where that is the datasheet's linearity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_std_rad: Option<f64>,
    /// What the sensor is beyond a straight line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terms: Option<TermsTable>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CovarianceTable {
    pub parameters: Vec<String>,
    pub rows: Vec<Vec<f64>>,
}

pub(super) struct Parts<'a> {
    pub messages_hash: String,
    pub robot: &'a Robot,
    pub method: Method,
    pub data: &'a CaptureData,
    /// What a warm calibration started from.
    pub prior: Option<&'a Calibration>,
    pub identified: &'a [IdentifiedScale],
    pub fit: &'a PositionProblem<'a>,
    pub held_out: &'a PositionProblem<'a>,
    pub solution: &'a Solution,
    pub covariance: &'a ParameterCovariance,
    /// Parameters of sensors that move the camera, determined or not.
    pub n_wanted: usize,
    /// By the tag on the gripper, or why not; none where the robot has none.
    pub mount: &'a Result<Option<MountEstimate>, String>,
    pub map: Option<MapResult>,
    pub unobservable: &'a [Unobservable],
    pub linearity_scale: f64,
    pub task: Option<ToolErrorPrediction>,
    /// Of views that were left out in turn, where the method does that; else the recording's own held-out views count.
    pub cross_validated: Option<HeldOutMetrics>,
}

pub(super) fn assemble(parts: &Parts<'_>) -> Calibration {
    let at = &parts.solution.parameters;
    let held_out = parts.cross_validated.clone().unwrap_or_else(|| held_out_figures(parts));
    let views = parts.data.fit.iter().filter(|view| !view.tags.is_empty()).count();
    let fit_rms_m = parts.fit.rms_m(at).unwrap_or(f64::NAN);
    let predicted = parts.task.as_ref().map(|task| task.error_m);
    let refusal = refusal(&AcceptanceData {
        outcome: parts.solution.outcome,
        held_out_views: held_out.views,
        held_out_rms_m: held_out.rms_m,
        held_out_nominal_rms_m: held_out.nominal_rms_m,
        fit_rms_m,
        n_parameters: parts.n_wanted,
        fit_views: views,
        predicted_tool_error_m: predicted.map(|p| p.p95),
        tolerance_m: parts.data.task.as_ref().map(|task| task.tolerance_m),
    });
    Calibration {
        version: 1,
        robot: parts.robot.name.clone(),
        method: parts.method,
        status: if refusal.is_some() { Status::Refused } else { Status::Accepted },
        refusal,
        messages_hash: parts.messages_hash.clone(),
        unobservable: grouped_names(parts.robot, parts.unobservable),
        fit: FitMetrics {
            outcome: parts.solution.outcome.name().to_owned(),
            evaluations: parts.solution.evaluations,
            cost_initial: parts.solution.cost_initial,
            cost_final: parts.solution.cost_final,
            views,
            tags_seen: parts.fit.n_observations(),
            rejected: parts.data.rejected.values().sum(),
            rejected_by_reason: parts.data.rejected_by_reason(),
            rms_m: fit_rms_m,
            rms_px: parts.fit.reprojection_rms_px(at),
            linearity_scale: parts.linearity_scale,
        },
        held_out,
        predicted_tool_error_m: predicted,
        valid: ValidRange::of(parts.data),
        reference: ReferenceTable::of(at, parts.covariance),
        camera_mount: CameraMount::of(parts.robot, parts.mount),
        map: parts.map.clone(),
        observability: None,
        verdict: None,
        model: None,
        outliers: Vec::new(),
        joint: joint_results(parts),
        failed_joint: Vec::new(),
        prior: None,
        covariance: CovarianceTable {
            parameters: parts.covariance.parameters.iter().map(|p| p.name(parts.robot)).collect(),
            rows: covariance_rows(parts.covariance),
        },
    }
}

/// Larger tables are written with fewer digits.
const FULL_DIGITS_ROWS: usize = 24;

/// With seven significant digits where they are many: the file, and whoever holds the result in memory, have the same numbers.
pub(super) fn covariance_rows(covariance: &ParameterCovariance) -> Vec<Vec<f64>> {
    shortened_rows(&covariance.matrix)
}

pub(super) fn shortened_rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let is_large = matrix.nrows() > FULL_DIGITS_ROWS;
    let shortened = |value: &f64| {
        let short = || format!("{value:.6e}").parse().unwrap_or(*value);
        if is_large && value.is_finite() { short() } else { *value }
    };
    matrix.row_iter().map(|row| row.iter().map(shortened).collect()).collect()
}

fn held_out_figures(parts: &Parts<'_>) -> HeldOutMetrics {
    let at = &parts.solution.parameters;
    HeldOutMetrics {
        in_turn: false,
        mean_m: None,
        camera_mean_m: None,
        views: parts.data.held_out.iter().filter(|view| !view.tags.is_empty()).count(),
        rms_m: parts.held_out.rms_m(at),
        rms_px: parts.held_out.reprojection_rms_px(at),
        nominal_rms_m: parts.held_out.rms_m(&JointParameters::default()),
    }
}

fn joint_results(parts: &Parts<'_>) -> Vec<JointResult> {
    let sensors = parts.solution.parameters.sensors(parts.robot);
    sensors
        .models
        .iter()
        .enumerate()
        .map(|(joint, model)| {
            let spec = &model.spec;
            let gain = Parameter { joint, kind: ParameterKind::Gain };
            let offset = Parameter { joint, kind: ParameterKind::Offset };
            let (gain_std, offset_std) = (parts.covariance.std(gain), parts.covariance.std(offset));
            let travel = parts.data.fit.iter().filter(|v| !v.tags.is_empty()).map(|view| view.travel_rad[joint]);
            let at_stop = |(_, stop): &&(_, EndStopReading)| parts.method == Method::JointLimits && stop.joint == joint;
            let stops = parts.data.stops.iter().filter(at_stop).map(|(_, stop)| stop.travel_rad);
            let (low, high) = travel
                .chain(stops)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(t), high.max(t)));
            let angle = |t: f64| model.correction.angle_rad(spec, t, &ConditionChange::default(), 0.0);
            // What the new views did not determine is as sure as it was before.
            let before = parts.prior.map(|prior| &prior.joint[joint]);
            let gain_std_before =
                before.map_or(spec.gain_std / spec.counts_per_rad.abs(), |j| j.gain_std_rad_per_count);
            JointResult {
                name: spec.joint.clone(),
                center_rad: spec.center_rad,
                gain_rad_per_count: model.correction.gain / spec.counts_per_rad,
                offset_rad: model.correction.offset_rad,
                gain_std_rad_per_count: gain_std.map_or(gain_std_before, |std| std / spec.counts_per_rad.abs()),
                offset_std_rad: offset_std.unwrap_or(before.map_or(spec.offset_std_rad, |j| j.offset_std_rad)),
                gain_estimated: gain_std.is_some() || before.is_some_and(|j| j.gain_estimated),
                offset_estimated: offset_std.is_some() || before.is_some_and(|j| j.offset_estimated),
                covered_rad: if low <= high { [angle(low), angle(high)] } else { [spec.center_rad; 2] },
                gain_over_datasheet: Some(model.correction.gain / ratio_of(parts, joint)),
                identified_ratio: parts.identified.iter().find(|scale| scale.joint == joint).map(|scale| scale.ratio),
                residual_std_rad: parts.covariance.residual_std_rad.map(|std_rad| std_rad[joint]),
                terms: TermsTable::of(joint, model, parts.covariance),
            }
        })
        .collect()
}

/// Counts per radian that the fit was made with, over the datasheet's.
fn ratio_of(parts: &Parts<'_>, joint: usize) -> f64 {
    parts.identified.iter().find(|scale| scale.joint == joint).map_or(1.0, |scale| scale.ratio)
}
