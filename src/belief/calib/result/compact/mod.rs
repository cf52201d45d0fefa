//! A calibration in one line of printable ASCII below 512 bytes, for links that carry little (an acoustic modem).
//!
//! `armcal1 ROBOT METHOD VERDICT tTIME eMEDIAN/P95 hHASH rARM JOINT.. #SUM`, see docs/files.md. Corrections are
//! relative to the robot's datasheet, so the line means something only together with the robot folder that it was made
//! with; `r` tells whether the folder at the other end has the same joints. Sensors with terms make an `armcal2`, which
//! has a reference and, behind each joint's gain and offset, its `terms` in whole steps.

mod fields;
mod terms;
#[cfg(test)]
mod terms_tests;
#[cfg(test)]
mod tests;
mod text;
use serde::Serialize;
pub use terms::{CompactReference, CompactTerms};

use crate::calib::refusal::Refusal;
use crate::calib::result::calibration::{Calibration, JointResult, Status};
use crate::calib::result::terms_table::ReferenceTable;
use armcal_core::robot::Robot;
use armcal_core::routine::Method;
use armcal_core::sensor::{ArmSensors, Correction};
use armcal_core::streams::MAX_JOINTS;

/// The text is shorter than this, bytes.
pub const MAX_COMPACT_BYTES: usize = 512;
/// Corrections and their deviations are whole multiples of 1e-7 (gains: relative, offsets: rad). Half of that at 8
/// joints of a 5 m arm at the ends of their ranges moves the tool by less than 0.01 mm.
const STEPS: f64 = 1e7;
/// With terms of 1e-6, which leaves room for them; the tool of a 2 m arm moves by less than 0.02 mm.
const STEPS_WITH_TERMS: f64 = 1e6;
/// Predicted tool errors are whole micrometres.
const UM_PER_M: f64 = 1e6;
/// The largest correction, in steps: 10 times the datasheet's gain, 10 rad.
const MAX_STEPS: i64 = 99_999_999;
/// Digits of the messages' hash that are sent.
const HASH_DIGITS: usize = 12;

/// Why a calibration has no compact form, or a text is none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompactError {
    #[error("no compact calibration: it does not begin with `armcal1` or `armcal2`")]
    NotCompact,
    #[error("compact calibration: version `{found}` is not known; this program reads `armcal1` and `armcal2`")]
    Version { found: String },
    #[error("compact calibration: damaged on its way: the checksum is #{expected}, the text says {found}")]
    Checksum { expected: String, found: String },
    #[error("compact calibration: {field}: `{found}` is not {expected}")]
    Field { field: String, found: String, expected: &'static str },
    #[error("compact calibration: {joints} joints, there may be 1 to {MAX_JOINTS}")]
    Joints { joints: usize },
    #[error("joint `{joint}`: {what} is beyond what the compact form holds")]
    Range { joint: String, what: &'static str },
    #[error("joint `{joint}`: calibration.toml does not tell its gain relative to the datasheet")]
    NoRelativeGain { joint: String },
    #[error("joint `{joint}`: terms about a scale that was measured on the way have no compact form")]
    MeasuredScale { joint: String },
    #[error("the compact form has {bytes} bytes, must be below {MAX_COMPACT_BYTES}")]
    TooLong { bytes: usize },
    #[error("compact calibration: was made for robot `{found}`, not for `{expected}`, or for other joints of it")]
    OtherRobot { found: String, expected: String },
}

/// What the compact text holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CompactCalibration {
    /// `armcal1`; `armcal2` with terms.
    pub format: &'static str,
    /// Long names are shortened, see [`CompactCalibration::fits`].
    pub robot: String,
    pub method: Method,
    pub status: Status,
    /// Short code of the reason where refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refusal_code: Option<String>,
    /// End of the last fitted view, seconds since the Unix epoch.
    pub time_s: i64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_m: Option<PredictedToolError>,
    /// First digits of the full calibration's `messages_hash`.
    pub messages_hash_start: String,
    /// Hash of the robot's joints: their names and the middles of their ranges; with terms also half of the ranges.
    pub joints_hash: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<CompactReference>,
    /// In the order of the chain, base first.
    pub joint: Vec<CompactJoint>,
}

/// Over the task's targets, m, rounded up to whole micrometres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PredictedToolError {
    pub median: f64,
    pub p95: f64,
}

/// Corrections of one joint to its datasheet, with one sigma each; `None` where that is not finite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CompactJoint {
    /// Gain over the datasheet's, less 1.
    pub gain_correction: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_std: Option<f64>,
    /// Otherwise it is the datasheet's.
    pub gain_estimated: bool,
    pub offset_rad: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset_std_rad: Option<f64>,
    pub offset_estimated: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub terms: Option<CompactTerms>,
}

impl CompactCalibration {
    /// The compact form of `calibration`, rounded as its text will be.
    ///
    /// # Errors
    /// [`CompactError`] when a value is not finite or beyond the form's range.
    pub fn of(calibration: &Calibration) -> Result<Self, CompactError> {
        let n = calibration.joint.len();
        if !(1..=MAX_JOINTS).contains(&n) {
            return Err(CompactError::Joints { joints: n });
        }
        let steps = if calibration.reference.is_some() { STEPS_WITH_TERMS } else { STEPS };
        let joint: Vec<CompactJoint> =
            calibration.joint.iter().map(|joint| compact_joint(calibration, joint, steps)).collect::<Result<_, _>>()?;
        let predicted = calibration.predicted_tool_error_m.and_then(|error| {
            Some(PredictedToolError { median: whole_micrometres(error.median)?, p95: whole_micrometres(error.p95)? })
        });
        let time_s = calibration.valid.time_nanos.div_euclid(1_000_000_000);
        let straight = Self {
            format: text::FORMAT,
            robot: text::short_name(&calibration.robot),
            method: calibration.method,
            status: calibration.status,
            refusal_code: refusal_code(calibration).map(str::to_owned),
            time_s,
            predicted_tool_error_m: predicted,
            messages_hash_start: calibration.messages_hash.chars().take(HASH_DIGITS).collect(),
            joints_hash: joints_hash(
                calibration.joint.iter().map(|joint| (joint.name.as_str(), joint.center_rad, None)),
            ),
            reference: None,
            joint,
        };
        match &calibration.reference {
            None => Ok(straight),
            Some(reference) => straight.with_terms(calibration, reference),
        }
    }

    /// As fine as fits.
    fn with_terms(mut self, calibration: &Calibration, reference: &ReferenceTable) -> Result<Self, CompactError> {
        self.format = text::FORMAT_WITH_TERMS;
        let of_table = |joint: &JointResult| joint.terms.as_ref().map(|terms| terms.half_range_rad);
        let joints = calibration.joint.iter().map(|joint| (joint.name.as_str(), joint.center_rad, of_table(joint)));
        self.joints_hash = joints_hash(joints);
        for shape_step_rad in terms::SHAPE_STEPS_RAD {
            self.reference = Some(CompactReference::of(reference, self.time_s, shape_step_rad)?);
            for (compact, joint) in self.joint.iter_mut().zip(&calibration.joint) {
                let Some(table) = &joint.terms else { continue };
                if joint.identified_ratio.is_some() {
                    return Err(CompactError::MeasuredScale { joint: joint.name.clone() });
                }
                compact.terms = Some(CompactTerms::of(&table.terms(), shape_step_rad, &joint.name)?);
            }
            if text::write(&self).len() < MAX_COMPACT_BYTES {
                break;
            }
        }
        Ok(self)
    }

    /// The text, one line without its end.
    ///
    /// # Errors
    /// [`CompactError::TooLong`].
    pub fn to_text(&self) -> Result<String, CompactError> {
        let text = text::write(self);
        if text.len() < MAX_COMPACT_BYTES { Ok(text) } else { Err(CompactError::TooLong { bytes: text.len() }) }
    }

    /// Reads a text; runs of white space count as one space, for links break lines.
    ///
    /// # Errors
    /// [`CompactError`] whatever the text is.
    pub fn from_text(text: &str) -> Result<Self, CompactError> {
        text::read(text)
    }

    /// Whether it was made for `robot`'s name and joints.
    #[must_use]
    pub fn fits(&self, robot: &Robot) -> bool {
        // The joints with terms are known by the text.
        let has_terms = |j: usize| self.joint.get(j).is_some_and(|joint| joint.terms.is_some());
        let joints = robot
            .sensors
            .iter()
            .enumerate()
            .map(|(j, spec)| (spec.joint.as_str(), spec.center_rad, has_terms(j).then_some(spec.half_range_rad)));
        self.robot == text::short_name(&robot.name)
            && self.joint.len() == robot.n_joints()
            && self.joints_hash == joints_hash(joints)
    }

    /// The sensors of `robot` under this calibration.
    ///
    /// # Errors
    /// [`CompactError::OtherRobot`].
    pub fn sensors(&self, robot: &Robot) -> Result<ArmSensors, CompactError> {
        if !self.fits(robot) {
            return Err(CompactError::OtherRobot { found: self.robot.clone(), expected: robot.name.clone() });
        }
        let mut sensors = ArmSensors::nominal(robot);
        sensors.reference = self.reference.map(|reference| reference.conditions(self.time_s)).unwrap_or_default();
        for (model, joint) in sensors.models.iter_mut().zip(&self.joint) {
            let terms = joint.terms.map(|terms| terms.terms()).unwrap_or_default();
            model.correction = Correction { gain: 1.0 + joint.gain_correction, offset_rad: joint.offset_rad, terms };
        }
        Ok(sensors)
    }
}

fn compact_joint(calibration: &Calibration, joint: &JointResult, per_unit: f64) -> Result<CompactJoint, CompactError> {
    let out_of_range = |what| CompactError::Range { joint: joint.name.clone(), what };
    let gain = relative_gain(calibration, joint)?;
    let gain_std = joint.gain_std_rad_per_count * (gain / joint.gain_rad_per_count).abs();
    let rounded = |value: f64, what| {
        let steps = (value * per_unit).round();
        (steps.abs() <= MAX_STEPS as f64).then_some(steps / per_unit).ok_or_else(|| out_of_range(what))
    };
    Ok(CompactJoint {
        gain_correction: rounded(gain - 1.0, "its gain correction")?,
        gain_std: rounded_std(gain_std, per_unit),
        gain_estimated: joint.gain_estimated,
        offset_rad: rounded(joint.offset_rad, "offset_rad")?,
        offset_std_rad: rounded_std(joint.offset_std_rad, per_unit),
        offset_estimated: joint.offset_estimated,
        terms: None,
    })
}

/// Gain over the datasheet's. Where an older calibration.toml does not name it, an estimated gain's deviation stands in
/// it twice, absolute and (in the covariance) relative; one that was not estimated is the datasheet's.
fn relative_gain(calibration: &Calibration, joint: &JointResult) -> Result<f64, CompactError> {
    if let Some(gain) = joint.gain_over_datasheet {
        return Ok(gain);
    }
    if !joint.gain_estimated {
        return Ok(1.0);
    }
    let name = format!("{} gain", joint.name);
    let row = calibration.covariance.row(&name);
    let variance = row.and_then(|row| calibration.covariance.rows.get(row)?.get(row).copied());
    let relative =
        variance.map(|variance| joint.gain_rad_per_count.abs() * variance.sqrt() / joint.gain_std_rad_per_count);
    relative
        .filter(|gain| gain.is_finite() && *gain > 0.0)
        .ok_or_else(|| CompactError::NoRelativeGain { joint: joint.name.clone() })
}

/// A deviation is rounded up, so that nothing looks surer than it is; beyond the range it is as good as unknown.
fn rounded_std(std: f64, per_unit: f64) -> Option<f64> {
    // Not from 1.0000000001 steps to 2: what was rounded before stays.
    let steps = (std * per_unit - 1e-6).ceil();
    (0.0..=MAX_STEPS as f64).contains(&steps).then_some(steps / per_unit)
}

fn whole_micrometres(error_m: f64) -> Option<f64> {
    let um = (error_m * UM_PER_M - 1e-6).ceil();
    (0.0..=MAX_STEPS as f64).contains(&um).then_some(um / UM_PER_M)
}

/// Eight digits that tell one robot's joints from another's.
fn joints_hash<'a>(joints: impl Iterator<Item = (&'a str, f64, Option<f64>)>) -> String {
    let mut hasher = blake3::Hasher::new();
    for (name, center_rad, half_range_rad) in joints {
        hasher.update(&(name.len() as u64).to_le_bytes());
        hasher.update(name.as_bytes());
        hasher.update(&((center_rad * 1e6).round() as i64).to_le_bytes());
        if let Some(half_range_rad) = half_range_rad {
            hasher.update(&((half_range_rad * 1e6).round() as i64).to_le_bytes());
        }
    }
    hasher.finalize().to_hex()[..8].to_owned()
}

/// A short code of the first reason; files of before this version name none.
fn refusal_code(calibration: &Calibration) -> Option<&'static str> {
    let unnamed = calibration.refusal.as_ref().map(|_| "other");
    calibration.refusals.first().map(Refusal::code).or(unnamed)
}
