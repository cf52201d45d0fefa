//! Conversion of a full calibration to the compact one, rounded as its text will be, and from there to sensors.

use crate::file::calibration::{Calibration, JointResult};
use crate::file::compact::content::{CompactCalibration, CompactJoint, PredictedToolError};
use crate::file::compact::error::CompactError;
use crate::file::compact::precision::{HASH_DIGITS, MAX_COMPACT_BYTES, MAX_STEPS, STEPS, STEPS_WITH_TERMS, UM_PER_M};
use crate::file::compact::terms::{CompactReference, CompactTerms, SHAPE_STEPS_RAD};
use crate::file::compact::text;
use crate::file::terms_table::ReferenceTable;
use armcal_core::codes::Coded;
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, Correction};
use armcal_core::streams::MAX_JOINTS;

impl CompactCalibration {
    /// Returns the compact form of `calibration`, rounded as its text will be.
    ///
    /// # Errors
    /// [`CompactError`] when a value is not finite or beyond the form's range.
    pub fn of(calibration: &Calibration) -> Result<Self, CompactError> {
        if !calibration.link.is_empty() || calibration.sag.is_some() {
            return Err(CompactError::Links);
        }
        if let Some(slide) = calibration.joint.iter().find(|joint| joint.moves.is_slide()) {
            return Err(CompactError::Slide { joint: slide.name.clone() });
        }
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

    /// Adds the terms with the finest step that fits into the text.
    fn with_terms(mut self, calibration: &Calibration, reference: &ReferenceTable) -> Result<Self, CompactError> {
        self.format = text::FORMAT_WITH_TERMS;
        let of_table = |joint: &JointResult| joint.terms.as_ref().map(|terms| terms.half_range_rad);
        let joints = calibration.joint.iter().map(|joint| (joint.name.as_str(), joint.center_rad, of_table(joint)));
        self.joints_hash = joints_hash(joints);
        for shape_step_rad in SHAPE_STEPS_RAD {
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

    /// Returns the text, one line without its end.
    ///
    /// # Errors
    /// [`CompactError::TooLong`].
    pub fn to_text(&self) -> Result<String, CompactError> {
        let text = text::write(self);
        if text.len() < MAX_COMPACT_BYTES { Ok(text) } else { Err(CompactError::TooLong { bytes: text.len() }) }
    }

    /// Reads a text. A run of white space counts as one space because links break lines.
    ///
    /// # Errors
    /// [`CompactError`] if the text is no valid compact calibration.
    pub fn from_text(text: &str) -> Result<Self, CompactError> {
        text::read(text)
    }

    /// Returns true if the calibration was made for `robot`'s name and joints.
    #[must_use]
    pub fn fits(&self, robot: &Robot) -> bool {
        // The text shows which joints have terms.
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

    /// Returns the sensors of `robot` under this calibration.
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

/// Returns the ratio of the gain to the datasheet's. Older files do not state it, but hold an estimated gain's
/// deviation twice: absolute and, in the covariance, relative. A gain that was not estimated is the datasheet's.
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

/// Rounds a standard deviation up, so that it never becomes too small; returns `None` beyond the range.
fn rounded_std(std: f64, per_unit: f64) -> Option<f64> {
    // Tolerance: a value that was rounded before stays, instead of growing from 1.0000000001 steps to 2.
    let steps = (std * per_unit - 1e-6).ceil();
    (0.0..=MAX_STEPS as f64).contains(&steps).then_some(steps / per_unit)
}

fn whole_micrometres(error_m: f64) -> Option<f64> {
    let um = (error_m * UM_PER_M - 1e-6).ceil();
    (0.0..=MAX_STEPS as f64).contains(&um).then_some(um / UM_PER_M)
}

/// Returns a hash of eight digits that identifies a robot's joints.
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

/// Returns the code of the first refusal; `other` where a file holds only its sentence.
fn refusal_code(calibration: &Calibration) -> Option<&'static str> {
    let unnamed = calibration.refusal.as_ref().map(|_| "other");
    calibration.refusals.first().map(|refusal| refusal.code().as_str()).or(unnamed)
}
