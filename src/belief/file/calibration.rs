//! calibration.toml: the answer, how sure it is, what it rests on and where it holds.

use armcal_core::kind::Kind;
use armcal_core::kinematics::JointKind;
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

/// Whether the answer may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// No reason to refuse was found.
    Accepted,
    /// The reasons are in `refusals`.
    Refused,
}

/// One calibration, as its file has it.
///
/// `angle_rad = center_rad + offset_rad + gain_rad_per_count * travel_counts`, where `travel_counts` is the reading
/// less the datasheet's reading at `center_rad`, wrapped to half a word either way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Of the format: 1.
    pub version: u32,
    /// [`Kind::Calibration`].
    #[serde(default = "Kind::calibration")]
    pub kind: Kind,
    /// Name of the robot.
    pub robot: String,
    /// Method that made it.
    pub method: Method,
    /// Whether it may be used.
    pub status: Status,
    /// All reasons to refuse in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refusal: Option<String>,
    /// Hash of the recorded messages that this rests on (blake3).
    pub messages_hash: String,
    /// Hash of the covariance in the file beside; absent before the calibration was written, and in files of before
    /// there was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance_hash: Option<String>,
    /// What the data did not determine, and why; these keep the datasheet's values.
    pub unobservable: Vec<String>,
    /// Tag observations that the fit rejected: `view 12: tag 3: 45 sigma`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outliers: Vec<String>,
    /// Solver and fitted views.
    pub fit: FitMetrics,
    /// Views that the fit did not use.
    pub held_out: HeldOutMetrics,
    /// Over the task's targets; absent without a task.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_m: Option<Summary>,
    /// The same with what the drawing leaves open: link geometry and tool point with their priors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_with_priors_m: Option<Summary>,
    /// Radius that contains the tool error with 95 % probability, and the decision by that.
    #[serde(default)]
    pub u95: U95Table,
    /// Conditions that the captured views covered.
    pub valid: ValidRange,
    /// What the joints' terms are counted from, where there are any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<ReferenceTable>,
    /// Of `bundle`, and of other methods where the robot has a tag on the gripper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_mount: Option<CameraMount>,
    /// Of `bundle`: the further cameras that have views and whose mounts robot.toml does not call exact.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub further_camera: Vec<FurtherCamera>,
    /// Of `bundle`: the lenses that the views contradict.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lens: Vec<LensResult>,
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
    /// One per joint, base first.
    pub joint: Vec<JointResult>,
    /// Joints' places on their parent links, where the data asked for others than the drawing's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub link: Vec<LinkResult>,
    /// How the arm bends under its weight, where the data asked for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sag: Option<SagTable>,
    /// Joints that failed, or whose sensors did.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub failed_joint: Vec<FailedJointTable>,
    /// What a warm calibration by `bundle` started from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorTable>,
    /// The reasons to refuse as data, the most telling first.
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "crate::say::refusal::in_files")]
    #[schemars(with = "Vec<Refusal>")]
    pub refusals: Vec<Refusal>,
    /// What rests on priors alone, the largest at the tool first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reservations: Vec<Reservation>,
    /// What is other than robot.toml, survey and drawing say, the most telling first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<Finding>,
    /// Not in calibration.toml, but in the file beside it; older files have it as a table.
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

/// Tables of a joint in a calibration.
const JOINT_TABLES: [&str; 2] = ["JointResult", "TermsTable"];

/// Returns the schema of a calibration whose joints may slide: their keys end in `_m` instead of `_rad`.
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
    /// Whether any joint slides.
    #[must_use]
    pub fn has_slide(&self) -> bool {
        self.joint.iter().any(|joint| joint.moves.is_slide())
    }

    /// Refuses for `reasons`, if there are any, behind those that it was refused for before.
    pub(crate) fn refuse_for(&mut self, reasons: impl IntoIterator<Item = Refusal>) {
        self.refusals.extend(reasons);
        self.state_refusals();
    }

    /// The same, before those that it was refused for before, unless those are about the data themselves.
    pub(crate) fn refuse_first_for(&mut self, reasons: impl IntoIterator<Item = Refusal>) {
        let at = if self.refusals.first().is_some_and(Refusal::is_about_data) { self.refusals.len() } else { 0 };
        self.refusals.splice(at..at, reasons);
        self.state_refusals();
    }

    /// Gives the refusals by the decision rule the figures of the final table, which includes stated sigmas.
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
    pub(crate) fn advise_survey(&mut self, of_watched: bool, keys: impl Fn(usize) -> Vec<String>) {
        for refusal in &mut self.refusals {
            if let Refusal::BeyondTolerance { target, survey, is_watched, .. } = refusal {
                (*survey, *is_watched) = (keys(*target - 1), of_watched);
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

/// The sensor of one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointResult {
    /// Name of the joint in the URDF.
    pub name: String,
    /// Whether it slides: then all that is in rad here is in m, and calibration.toml's keys say so.
    #[serde(default, skip_serializing_if = "JointKind::is_turning")]
    pub moves: JointKind,
    /// Middle of the joint's range by the drawing.
    pub center_rad: f64,
    /// Negative where the reading falls as the angle grows.
    pub gain_rad_per_count: f64,
    /// Added to the angle.
    pub offset_rad: f64,
    /// One sigma; the datasheet's where the joint was not determined.
    pub gain_std_rad_per_count: f64,
    /// One sigma; the datasheet's where the joint was not determined.
    pub offset_std_rad: f64,
    /// Whether these views, or those of the prior, determined the gain.
    pub gain_estimated: bool,
    /// Whether these views, or those of the prior, determined the offset.
    pub offset_estimated: bool,
    /// Angles that the captured views covered.
    pub covered_rad: [f64; 2],
    /// The gain over the datasheet's; negative where the counts run the other way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_over_datasheet: Option<f64>,
    /// Counts per radian over the datasheet's, where they were measured first because nobody knew them; the gain's
    /// relative standard deviation in `covariance` is about that scale.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identified_ratio: Option<f64>,
    /// One sigma of what the parameters leave of the sensor's error; absent where that is the datasheet's linearity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_std_rad: Option<f64>,
    /// What the sensor is beyond a straight line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terms: Option<TermsTable>,
}
