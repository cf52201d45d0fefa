//! Parts of `armcal2` beyond `armcal1`: the reference, and each joint's terms in whole steps.
//!
//! A number of steps is one to four printable characters: digits of base 45. The last is from the first half of
//! [`DIGITS`], those before it from the second half. So small numbers are short and need no space between them.

pub(crate) use crate::file::constants::compact_terms::SHAPE_STEPS_RAD;
use crate::file::constants::compact_terms::{
    BASE, DRIFT_STEPS, GAIN_STEPS, LARGEST_STEPS, MAX_DIGITS, OFFSET_STEPS, OIL_STEPS, PLAY_STEPS, PRESSURE_STEPS,
};
use serde::Serialize;

use crate::file::compact::error::CompactError;
use crate::file::compact::fields::{bad, whole};
use crate::file::compact::precision::MAX_STEPS;
use crate::file::terms_table::ReferenceTable;
use armcal_core::sensor::{Conditions, N_SHAPE, Terms};
use armcal_core::time::Stamp;

/// Printable ASCII except quotes, backslash and backquote.
const DIGITS: &[u8; 90] = b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+,-./:;<=>?@[]^_{|}~";

/// Reference conditions of the terms, and the step of the written coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CompactReference {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub oil_c: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pressure_pa: Option<f64>,
    /// Reference time, in seconds after the calibration's time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after_time_s: Option<i64>,
    /// Step of the shapes' coefficients.
    pub shape_step_rad: f64,
}

/// Terms of one joint, as in [`Terms`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CompactTerms {
    pub nonlinearity_rad: [f64; N_SHAPE],
    pub offset_rad_per_k: f64,
    pub gain_per_k: f64,
    pub offset_rad_per_mpa: f64,
    pub drift_rad_per_h: f64,
    pub half_backlash_rad: f64,
}

impl CompactReference {
    pub(crate) fn of(table: &ReferenceTable, time_s: i64, shape_step_rad: f64) -> Result<Self, CompactError> {
        let range = |what| CompactError::Range { joint: "reference".to_owned(), what };
        let rounded = |value: Option<f64>, per_unit: f64, what| {
            let steps = |value: f64| Some((value * per_unit).round()).filter(|steps| steps.abs() <= MAX_STEPS as f64);
            value.map(|value| steps(value).map(|steps| steps / per_unit).ok_or_else(|| range(what))).transpose()
        };
        let after = |nanos: i64| {
            let seconds = (nanos as f64 * 1e-9).round() as i64;
            seconds.checked_sub(time_s).filter(|s| s.abs() <= MAX_STEPS).ok_or_else(|| range("its time"))
        };
        Ok(Self {
            oil_c: rounded(table.oil_c, OIL_STEPS, "oil_c")?,
            pressure_pa: rounded(table.pressure_pa, PRESSURE_STEPS, "pressure_pa")?,
            after_time_s: table.time_nanos.map(after).transpose()?,
            shape_step_rad,
        })
    }

    pub(crate) fn conditions(&self, time_s: i64) -> Conditions {
        let nanos = |after_s: i64| time_s.saturating_add(after_s).saturating_mul(1_000_000_000);
        let stamp = self.after_time_s.map(|after_s| Stamp { nanos: nanos(after_s) });
        Conditions { oil_c: self.oil_c, pressure_pa: self.pressure_pa, stamp }
    }

    /// Returns text such as `c2050/20100/-1200/5`, in 0.01 C, kPa, s and 1e-6 rad; `x` for an unknown value.
    pub(crate) fn to_text(self) -> String {
        let steps = |value: Option<f64>, per_unit: f64| {
            value.map_or_else(|| "x".to_owned(), |value| ((value * per_unit).round() as i64).to_string())
        };
        let time = self.after_time_s.map_or_else(|| "x".to_owned(), |after| after.to_string());
        let (oil, pressure) = (steps(self.oil_c, OIL_STEPS), steps(self.pressure_pa, PRESSURE_STEPS));
        format!("c{oil}/{pressure}/{time}/{}", step_in_words(self.shape_step_rad))
    }

    pub(crate) fn from_text(word: &str) -> Result<Self, CompactError> {
        let wrong = || bad("reference", word, "c, then oil, pressure, time and step");
        let parts: Vec<&str> = word.strip_prefix('c').ok_or_else(wrong)?.split('/').collect();
        let [oil, pressure, time, step] = parts[..] else { return Err(wrong()) };
        let number = |part: &str| match (part, part.strip_prefix('-')) {
            ("x", _) => Ok(None),
            (_, Some(size)) => whole(size).map(|steps| Some(-steps)).ok_or_else(wrong),
            (size, None) => whole(size).map(Some).ok_or_else(wrong),
        };
        let scaled = |part: &str, per_unit: f64| Ok(number(part)?.map(|steps| steps as f64 / per_unit));
        let is_step = |known: &f64| step_in_words(*known) == step;
        Ok(Self {
            oil_c: scaled(oil, OIL_STEPS)?,
            pressure_pa: scaled(pressure, PRESSURE_STEPS)?,
            after_time_s: number(time)?,
            shape_step_rad: SHAPE_STEPS_RAD.into_iter().find(is_step).ok_or_else(wrong)?,
        })
    }
}

/// Returns the terms other than the shape, in the order of the text, each with its steps per unit.
fn scalars(terms: &mut CompactTerms) -> [(&mut f64, f64); 5] {
    [
        (&mut terms.offset_rad_per_k, OFFSET_STEPS),
        (&mut terms.gain_per_k, GAIN_STEPS),
        (&mut terms.offset_rad_per_mpa, OFFSET_STEPS),
        (&mut terms.drift_rad_per_h, DRIFT_STEPS),
        (&mut terms.half_backlash_rad, PLAY_STEPS),
    ]
}

/// Returns the step in units of 1e-6 rad.
fn step_in_words(step_rad: f64) -> String {
    format!("{:.0}", step_rad * 1e6)
}

/// Returns steps per radian as a whole number, so that a value read back prints as it was written.
fn per_rad(step_rad: f64) -> f64 {
    (1.0 / step_rad).round()
}

impl CompactTerms {
    /// Returns `terms` rounded as the text will be.
    pub(crate) fn of(terms: &Terms, shape_step_rad: f64, joint: &str) -> Result<Self, CompactError> {
        let Terms {
            nonlinearity_rad,
            offset_rad_per_k,
            gain_per_k,
            offset_rad_per_mpa,
            drift_rad_per_h,
            half_backlash_rad,
            // No calibration has a bump.
            bump: _,
        } = *terms;
        let mut rounded = Self {
            nonlinearity_rad,
            offset_rad_per_k,
            gain_per_k,
            offset_rad_per_mpa,
            drift_rad_per_h,
            half_backlash_rad,
        };
        let out_of_range = || CompactError::Range { joint: joint.to_owned(), what: "a term" };
        let round = |value: &mut f64, per_unit: f64| {
            let steps = (*value * per_unit).round();
            *value = Some(steps / per_unit).filter(|_| steps.abs() <= LARGEST_STEPS as f64).ok_or_else(out_of_range)?;
            Ok(())
        };
        scalars(&mut rounded).into_iter().try_for_each(|(value, per_unit)| round(value, per_unit))?;
        rounded.nonlinearity_rad.iter_mut().try_for_each(|value| round(value, per_rad(shape_step_rad)))?;
        Ok(rounded)
    }

    #[must_use]
    pub fn terms(&self) -> Terms {
        let Self {
            nonlinearity_rad,
            offset_rad_per_k,
            gain_per_k,
            offset_rad_per_mpa,
            drift_rad_per_h,
            half_backlash_rad,
        } = *self;
        Terms {
            nonlinearity_rad,
            offset_rad_per_k,
            gain_per_k,
            offset_rad_per_mpa,
            drift_rad_per_h,
            half_backlash_rad,
            ..Terms::default()
        }
    }

    /// Returns the text of the five scalars, then of the shape up to its last nonzero coefficient.
    pub(crate) fn to_text(mut self, shape_step_rad: f64) -> String {
        let mut text = String::new();
        let mut push = |value: f64, per_unit: f64| push_steps(&mut text, (value * per_unit).round() as i64);
        for (value, per_unit) in scalars(&mut self) {
            push(*value, per_unit);
        }
        let n = N_SHAPE - self.nonlinearity_rad.iter().rev().take_while(|value| **value == 0.0).count();
        for value in &self.nonlinearity_rad[..n] {
            push(*value, per_rad(shape_step_rad));
        }
        text
    }

    pub(crate) fn from_text(text: &str, shape_step_rad: f64) -> Option<Self> {
        let mut steps = Vec::new();
        let mut left = text.as_bytes();
        while !left.is_empty() {
            let (value, rest) = read_steps(left)?;
            steps.push(value as f64);
            left = rest;
        }
        let mut terms = Self::default();
        let (scalar_steps, shape_steps) = steps.split_at_checked(5)?;
        for ((value, per_unit), steps) in scalars(&mut terms).into_iter().zip(scalar_steps) {
            *value = steps / per_unit;
        }
        for (value, steps) in terms.nonlinearity_rad.get_mut(..shape_steps.len())?.iter_mut().zip(shape_steps) {
            *value = steps / per_rad(shape_step_rad);
        }
        Some(terms)
    }
}

/// Writes a number of steps. The codes of 0, -1, 1, -2, ... are 0, 1, 2, 3, ...; codes of n digits follow those of n -
/// 1, so that each number has one form.
fn push_steps(text: &mut String, steps: i64) {
    let mut code = if steps < 0 { -2 * steps - 1 } else { 2 * steps };
    let mut digits = vec![DIGITS[(code % BASE) as usize]];
    code /= BASE;
    while code > 0 {
        code -= 1;
        digits.push(DIGITS[(BASE + code % BASE) as usize]);
        code /= BASE;
    }
    text.extend(digits.iter().rev().map(|digit| char::from(*digit)));
}

/// Returns the first number and the text that follows it.
fn read_steps(text: &[u8]) -> Option<(i64, &[u8])> {
    let mut code = 0;
    for (n, byte) in text.iter().enumerate().take(MAX_DIGITS + 1) {
        let digit = DIGITS.iter().position(|digit| digit == byte)? as i64;
        code = code * BASE + digit % BASE;
        if digit < BASE {
            let steps = if code % 2 == 0 { code / 2 } else { -(code + 1) / 2 };
            return (steps.abs() <= LARGEST_STEPS).then_some((steps, &text[n + 1..]));
        }
        code += 1;
    }
    None
}
