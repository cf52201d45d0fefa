//! `[[light]]` of a vehicle's file.

use crate::codes::Code;
use std::path::Path;

use nalgebra::{Point3, Unit, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::FileIssue;
use super::part::check_place;

/// A white light on a vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct VehicleLight {
    /// Name in the vehicle's file.
    pub name: String,
    /// Position of the source in the vehicle's frame.
    pub position_m: Point3<f64>,
    /// Axis of the beam in the vehicle's frame, away from the source.
    pub direction: Unit<Vector3<f64>>,
    /// Luminous flux.
    pub flux_lm: f64,
    /// Angle from the beam's axis to half of its intensity.
    pub half_angle_rad: f64,
}

#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LightFile {
    /// Name of the light.
    name: String,
    /// Position in the vehicle's frame.
    #[schemars(inner(range(min = -1e4, max = 1e4)))]
    position_m: [f64; 3],
    /// Axis of the beam in the vehicle's frame, of any length.
    #[schemars(inner(range(min = -1e3, max = 1e3)))]
    direction: [f64; 3],
    /// Luminous flux.
    #[schemars(range(min = 0.0, max = 1e7))]
    flux_lm: f64,
    /// Half of the beam's opening angle.
    #[schemars(range(min = 0.02, max = 3.0))]
    half_angle_rad: f64,
}

impl LightFile {
    /// Checks the light, number `n` of the list.
    ///
    /// # Errors
    /// [`FileIssue`] naming file, key and allowed range.
    pub(super) fn check(&self, file: &Path, n: usize) -> Result<VehicleLight, FileIssue> {
        let at = |key: &str| format!("light[{n}].{key}");
        let check = |key: &str, value: f64, range| FileIssue::check_range(file, &at(key), value, range);
        check_place(file, &at("position_m"), &self.position_m)?;
        for value in self.direction {
            check("direction", value, -1e3..=1e3)?;
        }
        let direction = Unit::try_new(Vector3::from(self.direction), 1e-6)
            .ok_or_else(|| FileIssue::new(Code::ValueInvalid, file, at("direction"), "has no direction"))?;
        Ok(VehicleLight {
            name: self.name.clone(),
            position_m: Point3::from(self.position_m),
            direction,
            flux_lm: check("flux_lm", self.flux_lm, 0.0..=1e7)?,
            half_angle_rad: check("half_angle_rad", self.half_angle_rad, 0.02..=3.0)?,
        })
    }
}
