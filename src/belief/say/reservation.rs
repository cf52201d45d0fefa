//! Reservations of a calibration: elements of the geometry that no view constrains, and that depend on priors.

use crate::say::finding::FindingUnit;
use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use armcal_core::codes::Code;

/// One element that the data do not determine, so that the result holds only if its prior does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Reservation {
    /// The element and its axis: `camera mount, turn about y`.
    pub what: String,
    /// One sigma of the nominal value, in `unit`.
    pub prior_std: f64,
    /// Unit of `prior_std`.
    pub unit: FindingUnit,
    /// Tool error per sigma of the prior, root mean square over the task, m; for several axes, the largest.
    pub tool_error_m: f64,
    /// Tool error for each axis of `what`, m, where it has several that differ.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub by_axis_m: Vec<f64>,
    /// True if U95 includes the element; false where robot.toml states no sigma, and `prior_std` is the default.
    #[serde(default = "is_included", skip_serializing_if = "Clone::clone")]
    pub included: bool,
}

fn is_included() -> bool {
    true
}

impl Reservation {
    /// Code of the element; for an element that U95 does not include, `NotIncluded`.
    #[must_use]
    pub fn code(&self) -> Code {
        let elements = [
            ("camera mount", Code::CameraMount),
            ("camera lens", Code::Lens),
            ("tag survey", Code::Base),
            ("tool", Code::Tool),
        ];
        let element = elements.into_iter().find(|(name, _)| self.what.starts_with(name));
        if self.included { element.map_or(Code::Link, |(_, code)| code) } else { Code::NotIncluded }
    }

    /// Tool error per `unit` of the element, m per m or m per rad.
    #[must_use]
    pub fn tool_error_per_unit(&self) -> f64 {
        self.tool_error_m / self.prior_std
    }
}

impl fmt::Display for Reservation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, prior_std, unit, tool_error_m, by_axis_m, included } = self;
        let all_m = if by_axis_m.is_empty() { std::slice::from_ref(tool_error_m) } else { by_axis_m };
        // The everyday unit.
        let (scale, name) = match unit {
            FindingUnit::Metre => (1e3, "mm"),
            FindingUnit::Radian => (1f64.to_degrees(), "deg"),
            FindingUnit::One => (1e2, "%"),
            FindingUnit::MetrePerNewton => (1e6, "mm per kN"),
            FindingUnit::RadianPerNewtonMetre => (1e3 * 1f64.to_degrees(), "deg per kN m"),
            FindingUnit::Newton => (1.0, "N"),
        };
        let list = |factor: f64| all_m.iter().map(|m| format!("{:.1}", factor * m)).collect::<Vec<_>>().join(", ");
        let (size, moved) = (prior_std * scale, list(1e3));
        if *included {
            write!(f, "{what}: unobservable; ±{size:.2} {name} (robot.toml) moves the tool {moved} mm")
        } else {
            write!(f, "{what}: not included, no sigma is stated; ±{size:.2} {name} would move the tool {moved} mm")
        }
    }
}
