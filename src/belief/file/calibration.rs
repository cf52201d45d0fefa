//! calibration.toml: the estimate, its uncertainty, the data behind it and its range of validity.

use armcal_core::kind::Kind;
use armcal_core::kinematics::JointKind;
use armcal_core::robot::Robot;
use armcal_core::routine::Method;
use armcal_core::schema::schema_of;
use armcal_core::stats::Summary;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::file::camera_mount::{CameraMount, FurtherCamera};
use crate::file::covariance_file::CovarianceTable;
use crate::file::failed_joint::{FailedJointTable, PriorTable};
use crate::file::lens_table::LensResult;
use crate::file::link_table::LinkResult;
use crate::file::map_table::MapResult;
use crate::file::metrics::{FitMetrics, HeldOutMetrics};
use crate::file::model_table::ModelTable;
use crate::file::sag_table::SagTable;
use crate::file::slide_keys::metric;
use crate::file::terms_table::{ReferenceTable, TermsTable};
use crate::file::valid_range::ValidRange;
use crate::file::verdict_tables::{ObservabilityTable, VerdictTable};
use crate::judge::U95Table;
use crate::say::finding::Finding;
use crate::say::refusal::Refusal;
use crate::say::refusal::words::in_words;
use crate::say::reservation::Reservation;
use crate::solve::details::FitDetails;

/// Verdict: accepted or refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// No reason to refuse was found.
    Accepted,
    /// At least one reason to refuse was found; `refusals` lists them.
    Refused,
}

/// Content of one calibration file.
///
/// `angle_rad = center_rad + offset_rad + gain_rad_per_count * travel_counts`, where `travel_counts` is the reading
/// less the datasheet's reading at `center_rad`, wrapped to half a word either way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Version of the format: 1.
    pub version: u32,
    /// Kind of the document: [`Kind::Calibration`].
    #[serde(default = "Kind::calibration")]
    pub kind: Kind,
    /// Name of the robot.
    pub robot: String,
    /// Method that made the calibration.
    pub method: Method,
    /// Verdict: accepted or refused.
    pub status: Status,
    /// All reasons to refuse, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refusal: Option<String>,
    /// Hash (blake3) of the recorded messages that the calibration was made from.
    pub messages_hash: String,
    /// Hash of the covariance file next to this one. Absent before the calibration is written, and in older files
    /// without a covariance file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance_hash: Option<String>,
    /// Parameters that the data did not determine, and why; they keep the datasheet's values.
    pub unobservable: Vec<String>,
    /// Tag observations that the fit rejected: `view 12: tag 3: 45 sigma`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outliers: Vec<String>,
    /// Outcome of the solver and residuals of the fitted views.
    pub fit: FitMetrics,
    /// Errors at views that the fit did not use.
    pub held_out: HeldOutMetrics,
    /// Predicted tool error over the task's targets, m; absent without a task.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_m: Option<Summary>,
    /// Predicted tool error over the task's targets, m, with link geometry and tool point uncertain by their priors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_with_priors_m: Option<Summary>,
    /// Radius that contains the tool error with 95 % probability, m, and the decision based on it.
    #[serde(default)]
    pub u95: U95Table,
    /// Conditions that the captured views covered.
    pub valid: ValidRange,
    /// Reference conditions of the joints' terms; absent if no joint has terms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<ReferenceTable>,
    /// Estimated camera mount. Present with `bundle`, and with other methods if the robot has a tag on the gripper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_mount: Option<CameraMount>,
    /// Further cameras (`bundle` only) that have views and whose mounts robot.toml does not call exact.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub further_camera: Vec<FurtherCamera>,
    /// Lenses (`bundle` only) whose values in robot.toml the views contradict.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lens: Vec<LensResult>,
    /// Estimated tag poses; absent if a survey gives them all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<MapResult>,
    /// Observability of the parameters (`bundle` only), computed before solving.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observability: Option<ObservabilityTable>,
    /// Checks behind the verdict (`bundle` only) in addition to `held_out`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdict: Option<VerdictTable>,
    /// Model that `bundle` estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelTable>,
    /// Sensor of each joint, base first.
    pub joint: Vec<JointResult>,
    /// Corrections of the joints' poses on their parent links; empty unless the data required them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub link: Vec<LinkResult>,
    /// Compliance of the arm under its weight; absent unless the data required it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sag: Option<SagTable>,
    /// Joints that failed, or whose sensors failed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub failed_joint: Vec<FailedJointTable>,
    /// Prior that a warm calibration by `bundle` started from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorTable>,
    /// Reasons to refuse as data, the most important first.
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "crate::say::refusal::in_files")]
    #[schemars(with = "Vec<Refusal>")]
    pub refusals: Vec<Refusal>,
    /// Errors that only priors limit, the largest at the tool first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reservations: Vec<Reservation>,
    /// Deviations from robot.toml, survey and nominal model (URDF), the most important first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<Finding>,
    /// Covariance of the estimated parameters. It is in a file of its own next to calibration.toml; older files have it
    /// as a table.
    #[serde(default, skip_serializing)]
    pub covariance: CovarianceTable,
    /// Residuals and predictions one by one, for reports; in no file.
    #[serde(skip)]
    pub details: FitDetails,
}

/// Returns the schema of a calibration.
#[must_use]
pub fn calibration_schema() -> serde_json::Value {
    with_slides(schema_of::<Calibration>(Kind::Calibration))
}

/// Names of the schema definitions that hold a joint's values.
const JOINT_TABLES: [&str; 2] = ["JointResult", "TermsTable"];

/// Returns `schema` extended by the keys of slides, which end in `_m` instead of `_rad`.
fn with_slides(mut schema: Value) -> Value {
    let definitions = schema.get_mut("definitions").and_then(Value::as_object_mut);
    for (_, definition) in definitions.into_iter().flatten().filter(|(name, _)| JOINT_TABLES.contains(&name.as_str())) {
        let Some(keys) = definition.get_mut("properties").and_then(Value::as_object_mut) else { continue };
        let renamed: Vec<(String, Value)> = keys.iter().map(|(key, value)| (metric(key), value.clone())).collect();
        let angles: Vec<String> = keys.keys().filter(|key| metric(key) != **key).cloned().collect();
        keys.extend(renamed);
        if let Some(needed) = definition.get_mut("required").and_then(Value::as_array_mut) {
            needed.retain(|key| angles.iter().all(|angle| key != angle));
        }
    }
    schema
}

impl Calibration {
    /// Returns true if any joint slides.
    #[must_use]
    pub fn has_slide(&self) -> bool {
        self.joint.iter().any(|joint| joint.moves.is_slide())
    }

    /// Adds `reasons`, if any, after the calibration's earlier refusals of the same rank.
    pub(crate) fn refuse_for(&mut self, reasons: impl IntoIterator<Item = Refusal>) {
        self.refusals.extend(reasons);
        self.state_refusals();
    }

    /// Adds `reasons` before the earlier refusals of the same rank, unless the first refusal is about the data
    /// themselves.
    pub(crate) fn refuse_first_for(&mut self, reasons: impl IntoIterator<Item = Refusal>) {
        let at = if self.refusals.first().is_some_and(Refusal::is_about_data) { self.refusals.len() } else { 0 };
        self.refusals.splice(at..at, reasons);
        self.state_refusals();
    }

    /// Sets the figures in refusals by the decision rule to those of the final table, which includes stated sigmas.
    pub(crate) fn restate_risk(&mut self) {
        let Some((worst, (risk, worst_m))) =
            self.u95.beyond().and_then(|worst| Some((worst.index + 1, worst.p_beyond_tolerance.zip(worst.u95_m)?)))
        else {
            return;
        };
        for refusal in &mut self.refusals {
            match refusal {
                Refusal::BeyondTolerance { target, probability, u95_m, .. } => {
                    (*target, *probability, *u95_m) = (worst, risk, worst_m);
                }
                Refusal::OffsetsWalk { u95_m, .. } => *u95_m = worst_m,
                _ => {}
            }
        }
        self.state_refusals();
    }

    /// Says where the sigmas are stated that the decision rule refuses for; `keys`: those at the target of that index.
    pub(crate) fn advise_survey(&mut self, keys: impl Fn(usize) -> Vec<String>, robot: &Robot) {
        for refusal in &mut self.refusals {
            if let Refusal::BeyondTolerance { target, survey, is_watched, .. } = refusal {
                (*survey, *is_watched) = (keys(*target - 1), robot.is_watched());
            }
        }
        self.state_refusals();
    }

    fn state_refusals(&mut self) {
        self.refusals.sort_by_key(Refusal::rank);
        self.refusal = in_words(&self.refusals);
        self.status = if self.refusals.is_empty() { Status::Accepted } else { Status::Refused };
    }
}

/// Sensor of one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointResult {
    /// Name of the joint in the URDF.
    pub name: String,
    /// Motion of the joint. If it slides, every value here in rad is in m, and the keys in calibration.toml say so.
    #[serde(default, skip_serializing_if = "JointKind::is_turning")]
    pub moves: JointKind,
    /// Nominal angle at the middle of the joint's range.
    pub center_rad: f64,
    /// Change of the angle per count; negative where the reading falls as the angle grows.
    pub gain_rad_per_count: f64,
    /// Sensor error at mid-range, added to the angle.
    pub offset_rad: f64,
    /// Standard deviation of the gain; the datasheet's where the joint was not determined.
    pub gain_std_rad_per_count: f64,
    /// Standard deviation of the offset; the datasheet's where the joint was not determined.
    pub offset_std_rad: f64,
    /// True if these views, or those of the prior, determined the gain.
    pub gain_estimated: bool,
    /// True if these views, or those of the prior, determined the offset.
    pub offset_estimated: bool,
    /// Angles at both ends of the range that the captured views covered.
    pub covered_rad: [f64; 2],
    /// Reading at angle zero by the datasheet that the calibration was made with; absent in older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset_counts: Option<f64>,
    /// Counts per radian by that datasheet; absent in older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub counts_per_rad: Option<f64>,
    /// Ratio of the gain to the datasheet's; negative where the counts run the other way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_over_datasheet: Option<f64>,
    /// Ratio of the measured counts per radian to the datasheet's, if an unknown scale was measured first. The gain's
    /// relative standard deviation in `covariance` refers to that scale.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identified_ratio: Option<f64>,
    /// Standard deviation of the sensor error that the parameters leave; absent if it equals the datasheet's linearity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_std_rad: Option<f64>,
    /// Terms of the sensor beyond a straight line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terms: Option<TermsTable>,
}
