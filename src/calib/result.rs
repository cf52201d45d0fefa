//! calibration.toml: the answer, how sure it is, what it rests on and where it holds.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::associate::CaptureData;
use super::camera_mount::CameraMount;
use super::gripper_tag::MountEstimate;
use super::identify::IdentifiedScale;
use super::map::MapResult;
use super::minimum_distance::Solution;
use super::observability::{Unobservable, grouped_names};
use super::problem::{JointParameters, Parameter, ParameterKind, PositionProblem};
use super::uncertainty::{ParameterCovariance, ToolErrorPrediction};
use super::valid_range::ValidRange;
use super::verdict::{Evidence, refusal};
use crate::log::{Recording, hash_messages};
use crate::robot::{FileIssue, Robot, RobotError, parse_toml, read_text};
use crate::routine::Method;
use crate::sensor::{ArmSensors, Correction};
use crate::stats::Summary;

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
    pub fit: FitFigures,
    pub held_out: HeldOutFigures,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_m: Option<Summary>,
    pub valid: ValidRange,
    /// Where the robot has a tag on the gripper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_mount: Option<CameraMount>,
    /// Where the tags were found to be, where no survey said it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<MapResult>,
    pub joint: Vec<JointResult>,
    /// Estimated parameters in the order of the covariance's rows, `joint gain` (relative) or `joint offset` (rad).
    pub covariance: CovarianceTable,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitFigures {
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
    pub rms_px: f64,
    /// How many times the datasheets' linearity the sensors deviate from a straight line, by the residuals; at least 1.
    #[serde(default = "as_the_datasheet_says")]
    pub linearity_scale: f64,
}

fn as_the_datasheet_says() -> f64 {
    1.0
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOutFigures {
    pub views: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_m: Option<f64>,
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
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CovarianceTable {
    pub parameters: Vec<String>,
    pub rows: Vec<Vec<f64>>,
}

/// Why a calibration file was refused.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationFileError {
    #[error(transparent)]
    File(#[from] RobotError),
    #[error("{file}: is for robot `{found}` with joints {found_joints:?}, not for `{expected}`")]
    OtherRobot { file: String, found: String, found_joints: Vec<String>, expected: String },
}

pub(super) struct Parts<'a> {
    pub recording: &'a Recording,
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
    /// Parameters that the views of tags around the arm determined.
    pub n_fitted: usize,
    /// By the tag on the gripper, or why not; none where the robot has none.
    pub mount: &'a Result<Option<MountEstimate>, String>,
    pub map: Option<MapResult>,
    pub unobservable: &'a [Unobservable],
    pub linearity_scale: f64,
    pub task: Option<ToolErrorPrediction>,
}

pub(super) fn assemble(parts: &Parts<'_>) -> Calibration {
    let at = &parts.solution.parameters;
    let held_out = held_out_figures(parts);
    let views = parts.data.fit.iter().filter(|view| !view.tags.is_empty()).count();
    let fit_rms_m = parts.fit.rms_m(at).unwrap_or(f64::NAN);
    let predicted = parts.task.as_ref().map(|task| task.error_m);
    let refusal = refusal(&Evidence {
        outcome: parts.solution.outcome,
        held_out_views: held_out.views,
        held_out_rms_m: held_out.rms_m,
        held_out_nominal_rms_m: held_out.nominal_rms_m,
        fit_rms_m,
        n_parameters: parts.n_fitted,
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
        messages_hash: hash_of_used(parts),
        unobservable: grouped_names(parts.robot, parts.unobservable),
        fit: FitFigures {
            outcome: parts.solution.outcome.name().to_owned(),
            evaluations: parts.solution.evaluations,
            cost_initial: parts.solution.cost_initial,
            cost_final: parts.solution.cost_final,
            views,
            tags_seen: parts.fit.n_observations(),
            rejected: parts.data.rejected.values().sum(),
            rejected_by_reason: parts.data.rejected_by_reason(),
            rms_m: fit_rms_m,
            rms_px: parts.fit.reprojection_rms_px(at).unwrap_or(f64::NAN),
            linearity_scale: parts.linearity_scale,
        },
        held_out,
        predicted_tool_error_m: predicted,
        valid: ValidRange::of(parts.data),
        camera_mount: CameraMount::of(parts.robot, parts.mount),
        map: parts.map.clone(),
        joint: joint_results(parts),
        covariance: CovarianceTable {
            parameters: parts.covariance.parameters.iter().map(|p| p.name(parts.robot)).collect(),
            rows: parts.covariance.matrix.row_iter().map(|row| row.iter().copied().collect()).collect(),
        },
    }
}

fn hash_of_used(parts: &Parts<'_>) -> String {
    let messages = &parts.recording.messages;
    let used = parts.data.used.iter().map(|&idx| (messages[idx].0, &messages[idx].1));
    hash_messages(used, &parts.recording.joint_names).expect("what was read from a recording can be written to one")
}

fn held_out_figures(parts: &Parts<'_>) -> HeldOutFigures {
    let at = &parts.solution.parameters;
    HeldOutFigures {
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
            let (low, high) =
                travel.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(t), high.max(t)));
            let angle = |t: f64| spec.center_rad + model.correction.gain * t + model.correction.offset_rad;
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
            }
        })
        .collect()
}

/// Counts per radian that the fit was made with, over the datasheet's.
fn ratio_of(parts: &Parts<'_>, joint: usize) -> f64 {
    parts.identified.iter().find(|scale| scale.joint == joint).map_or(1.0, |scale| scale.ratio)
}

impl Calibration {
    /// The sensors of `robot` under this calibration.
    ///
    /// # Errors
    /// [`CalibrationFileError::OtherRobot`] when it was made for another arm.
    pub fn sensors(&self, robot: &Robot) -> Result<ArmSensors, CalibrationFileError> {
        let names: Vec<String> = self.joint.iter().map(|joint| joint.name.clone()).collect();
        if self.robot != robot.name || names != robot.joint_names() {
            return Err(CalibrationFileError::OtherRobot {
                file: "calibration.toml".to_owned(),
                found: self.robot.clone(),
                found_joints: names,
                expected: robot.name.clone(),
            });
        }
        let mut sensors = ArmSensors::nominal(robot);
        for (model, joint) in sensors.models.iter_mut().zip(&self.joint) {
            model.correction =
                Correction { gain: joint.gain_rad_per_count * model.spec.counts_per_rad, offset_rad: joint.offset_rad };
        }
        Ok(sensors)
    }

    /// `robot` with the sensor scales that were measured on the way, which the covariance's gains are relative to, and with
    /// sensors as far from straight as the residuals say.
    #[must_use]
    pub fn scaled_robot(&self, robot: &Robot) -> Robot {
        let mut scaled = robot.clone().with_linearity(self.fit.linearity_scale);
        for (spec, joint) in scaled.sensors.iter_mut().zip(&self.joint) {
            if let Some(ratio) = joint.identified_ratio {
                *spec = spec.with_scale(ratio);
            }
        }
        scaled
    }

    /// The parameters relative to the sensors of `robot`, whose joints must be this calibration's.
    pub(super) fn parameters(&self, robot: &Robot) -> JointParameters {
        let mut parameters = JointParameters::default();
        for (joint, (result, spec)) in self.joint.iter().zip(&robot.sensors).enumerate() {
            parameters.gain[joint] = result.gain_rad_per_count * spec.counts_per_rad;
            parameters.offset_rad[joint] = result.offset_rad;
        }
        parameters
    }

    /// The covariance of the estimated parameters for `robot`'s joints; rows that name no joint of it are left out.
    #[must_use]
    pub fn parameter_covariance(&self, robot: &Robot) -> ParameterCovariance {
        let all = (0..robot.n_joints())
            .flat_map(|joint| [ParameterKind::Gain, ParameterKind::Offset].map(|kind| Parameter { joint, kind }));
        let rows: Vec<(usize, Parameter)> = all
            .filter_map(|p| Some((self.covariance.parameters.iter().position(|name| *name == p.name(robot))?, p)))
            .collect();
        let at = |row: usize, column: usize| self.covariance.rows[row].get(column).copied().unwrap_or(f64::NAN);
        ParameterCovariance {
            parameters: rows.iter().map(|(_, p)| *p).collect(),
            matrix: nalgebra::DMatrix::from_fn(rows.len(), rows.len(), |i, j| at(rows[i].0, rows[j].0)),
        }
    }

    /// The file's text.
    ///
    /// # Panics
    /// Never: every value here has a TOML form.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let head = "# Joint sensors as calibrated. angle = center_rad + offset_rad + gain_rad_per_count * travel,\n\
                    # travel = reading - the datasheet's reading at center_rad, in counts, wrapped to half a word.\n";
        let body = toml::to_string(self).expect("plain tables and finite numbers have a TOML form");
        format!("{head}{body}")
    }

    /// Reads a calibration file.
    ///
    /// # Errors
    /// [`CalibrationFileError`] naming file, key and allowed range.
    pub fn read(file: &Path) -> Result<Self, CalibrationFileError> {
        Self::parse(file, &read_text(file)?)
    }

    /// Reads the text of a calibration file; `file` is for messages.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(file: &Path, text: &str) -> Result<Self, CalibrationFileError> {
        let calibration: Self = parse_toml(file, text)?;
        calibration.check(file).map_err(RobotError::from)?;
        Ok(calibration)
    }

    fn check(&self, file: &Path) -> Result<(), FileIssue> {
        FileIssue::check_range(file, "version", f64::from(self.version), 1.0..=1.0)?;
        for joint in &self.joint {
            let check = |key: &str, value: f64, range| {
                FileIssue::check_range(file, &format!("joint `{}`: {key}", joint.name), value, range)
            };
            check("gain_rad_per_count (size)", joint.gain_rad_per_count.abs(), 1e-12..=1e3)?;
            check("offset_rad", joint.offset_rad, -10.0..=10.0)?;
            check("center_rad", joint.center_rad, -100.0..=100.0)?;
        }
        let n = self.covariance.parameters.len();
        if self.covariance.rows.len() != n || self.covariance.rows.iter().any(|row| row.len() != n) {
            return Err(FileIssue::new(file, "covariance.rows", format!("needs {n} rows of {n} numbers")));
        }
        Ok(())
    }
}
