//! `[joint.terms]` and `[reference]` of calibration.toml: terms of a sensor beyond a straight line.

use armcal_core::codes::Code;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::solve::covariance::ParameterCovariance;
use armcal_core::robot::FileIssue;
use armcal_core::sensor::{Conditions, N_SHAPE, SensorModel, Terms};
use armcal_core::time::Stamp;

/// Reference conditions of the terms; absent values were not measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferenceTable {
    /// Oil temperature, degrees Celsius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub oil_c: Option<f64>,
    /// Absolute ambient pressure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure_pa: Option<f64>,
    /// Time in nanoseconds since the epoch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_nanos: Option<i64>,
}

/// Terms of one joint; terms that are zero and were not estimated are absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TermsTable {
    /// Half of the joint's range, by which the shape's functions divide the travel.
    pub half_range_rad: f64,
    /// Coefficients of [`nonlinearity_basis`](armcal_core::sensor::nonlinearity_basis).
    #[serde(skip_serializing_if = "Option::is_none", alias = "shape_rad")]
    pub nonlinearity_rad: Option<Vec<f64>>,
    /// Standard deviation of each coefficient, 0 for fixed coefficients; absent if none was estimated.
    #[serde(skip_serializing_if = "Option::is_none", alias = "shape_rad_std")]
    pub nonlinearity_rad_std: Option<Vec<f64>>,
    /// Change of the offset with the oil temperature.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset_rad_per_k: Option<f64>,
    /// Standard deviation of the term before it; absent if not estimated, as are all below.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset_rad_per_k_std: Option<f64>,
    /// Change with the oil temperature of the gain relative to the datasheet's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_per_k: Option<f64>,
    /// Standard deviation of `gain_per_k`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_per_k_std: Option<f64>,
    /// Change of the offset with the ambient pressure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset_rad_per_mpa: Option<f64>,
    /// Standard deviation of `offset_rad_per_mpa`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset_rad_per_mpa_std: Option<f64>,
    /// Change of the offset with time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drift_rad_per_h: Option<f64>,
    /// Standard deviation of `drift_rad_per_h`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drift_rad_per_h_std: Option<f64>,
    /// Half of the backlash between joint and sensor shaft.
    #[serde(skip_serializing_if = "Option::is_none", alias = "half_play_rad")]
    pub half_backlash_rad: Option<f64>,
    /// Standard deviation of `half_backlash_rad`.
    #[serde(skip_serializing_if = "Option::is_none", alias = "half_play_rad_std")]
    pub half_backlash_rad_std: Option<f64>,
}

impl ReferenceTable {
    /// Returns the reference; `None` if all sensors are straight and no term was estimated.
    pub(crate) fn of(parameters: &JointParameters, covariance: &ParameterCovariance) -> Option<Self> {
        let Conditions { oil_c, pressure_pa, stamp } = parameters.reference;
        let table = Self { oil_c, pressure_pa, time_nanos: stamp.map(|stamp| stamp.nanos) };
        let is_term = |p: &Parameter| !matches!(p.kind, ParameterKind::Gain | ParameterKind::Offset);
        (!parameters.are_linear() || covariance.parameters.iter().any(is_term)).then_some(table)
    }

    /// Returns the reference as the sensor model's conditions.
    #[must_use]
    pub fn conditions(&self) -> Conditions {
        let Self { oil_c, pressure_pa, time_nanos } = *self;
        Conditions { oil_c, pressure_pa, stamp: time_nanos.map(|nanos| Stamp { nanos }) }
    }

    pub(crate) fn check(&self, file: &Path) -> Result<(), FileIssue> {
        for (key, value, range) in
            [("reference.oil_c", self.oil_c, -50.0..=200.0), ("reference.pressure_pa", self.pressure_pa, -1e6..=2e8)]
        {
            value.map_or(Ok(0.0), |value| FileIssue::check_range(file, key, value, range))?;
        }
        Ok(())
    }
}

impl TermsTable {
    /// Returns the terms of `joint`, whose sensor is `model`; `None` for a straight sensor without estimated terms.
    pub(crate) fn of(joint: usize, model: &SensorModel, covariance: &ParameterCovariance) -> Option<Self> {
        let terms = &model.correction.terms;
        let std = |kind| covariance.std(Parameter { joint, kind });
        let shape_std: Vec<Option<f64>> = (0..N_SHAPE as u8).map(|h| std(ParameterKind::Shape(h))).collect();
        let has_shape = terms.nonlinearity_rad != [0.0; N_SHAPE] || shape_std.iter().any(Option::is_some);
        let nonlinearity_rad_std = shape_std.iter().any(Option::is_some).then(|| {
            // A fixed coefficient has no error of its own.
            shape_std.iter().map(|std| std.unwrap_or(0.0)).collect()
        });
        let scalar = |value: f64, kind| (Some(value).filter(|v| *v != 0.0 || std(kind).is_some()), std(kind));
        let (offset_rad_per_k, offset_rad_per_k_std) = scalar(terms.offset_rad_per_k, ParameterKind::OffsetPerK);
        let (gain_per_k, gain_per_k_std) = scalar(terms.gain_per_k, ParameterKind::GainPerK);
        let (offset_rad_per_mpa, offset_rad_per_mpa_std) =
            scalar(terms.offset_rad_per_mpa, ParameterKind::OffsetPerMpa);
        let (drift_rad_per_h, drift_rad_per_h_std) = scalar(terms.drift_rad_per_h, ParameterKind::DriftPerH);
        let (half_backlash_rad, half_backlash_rad_std) = scalar(terms.half_backlash_rad, ParameterKind::HalfBacklash);
        let table = Self {
            half_range_rad: model.spec.half_range_rad,
            nonlinearity_rad: has_shape.then(|| terms.nonlinearity_rad.to_vec()),
            nonlinearity_rad_std,
            offset_rad_per_k,
            offset_rad_per_k_std,
            gain_per_k,
            gain_per_k_std,
            offset_rad_per_mpa,
            offset_rad_per_mpa_std,
            drift_rad_per_h,
            drift_rad_per_h_std,
            half_backlash_rad,
            half_backlash_rad_std,
        };
        let empty = Self { half_range_rad: table.half_range_rad, ..Self::default() };
        (table != empty).then_some(table)
    }

    /// Returns the terms as the sensor model's; absent ones are zero.
    #[must_use]
    pub fn terms(&self) -> Terms {
        let shape = self.nonlinearity_rad.as_deref().unwrap_or_default();
        Terms {
            nonlinearity_rad: std::array::from_fn(|h| shape.get(h).copied().unwrap_or(0.0)),
            offset_rad_per_k: self.offset_rad_per_k.unwrap_or(0.0),
            gain_per_k: self.gain_per_k.unwrap_or(0.0),
            offset_rad_per_mpa: self.offset_rad_per_mpa.unwrap_or(0.0),
            drift_rad_per_h: self.drift_rad_per_h.unwrap_or(0.0),
            half_backlash_rad: self.half_backlash_rad.unwrap_or(0.0),
            ..Terms::default()
        }
    }

    /// Checks the values' ranges; `joint` is the joint's name, for messages.
    pub(crate) fn check(&self, file: &Path, joint: &str) -> Result<(), FileIssue> {
        let key = |name: &str| format!("joint `{joint}`: terms.{name}");
        let check = |name: &str, value: f64, range| FileIssue::check_range(file, &key(name), value, range);
        check("half_range_rad", self.half_range_rad, 1e-3..=100.0)?;
        for (name, values, range) in [
            ("nonlinearity_rad", &self.nonlinearity_rad, -1.0..=1.0),
            ("nonlinearity_rad_std", &self.nonlinearity_rad_std, 0.0..=1e3),
        ] {
            let Some(values) = values else { continue };
            if values.len() != N_SHAPE {
                let problem = format!("has {} numbers, needs {N_SHAPE}", values.len());
                return Err(FileIssue::new(Code::ValueCount, file, key(name), problem));
            }
            for value in values {
                check(name, *value, range.clone())?;
            }
        }
        let std = || 0.0..=1e3;
        for (name, value, range) in [
            ("offset_rad_per_k", self.offset_rad_per_k, -0.1..=0.1),
            ("offset_rad_per_k_std", self.offset_rad_per_k_std, std()),
            ("gain_per_k", self.gain_per_k, -0.01..=0.01),
            ("gain_per_k_std", self.gain_per_k_std, std()),
            ("offset_rad_per_mpa", self.offset_rad_per_mpa, -0.1..=0.1),
            ("offset_rad_per_mpa_std", self.offset_rad_per_mpa_std, std()),
            ("drift_rad_per_h", self.drift_rad_per_h, -1.0..=1.0),
            ("drift_rad_per_h_std", self.drift_rad_per_h_std, std()),
            ("half_backlash_rad", self.half_backlash_rad, -0.2..=0.2),
            ("half_backlash_rad_std", self.half_backlash_rad_std, std()),
        ] {
            value.map_or(Ok(0.0), |value| check(name, value, range))?;
        }
        Ok(())
    }
}
