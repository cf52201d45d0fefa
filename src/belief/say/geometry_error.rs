//! An error of the link geometry: which element, in which way, how large, and what it means at the tool.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// In which way an element of the geometry is off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ErrorKind {
    /// Of the element's place, m.
    Shift,
    /// Of its attitude, rad.
    Turn,
}

impl ErrorKind {
    /// Factor from SI to the unit that people read, and that unit.
    #[must_use]
    pub fn display_unit(self) -> (f64, &'static str) {
        match self {
            Self::Shift => (1e3, "mm"),
            Self::Turn => (1f64.to_degrees(), "deg"),
        }
    }
}

/// What the score test of link geometry found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GeometryError {
    /// The link, `camera mount` or `base (or all tags)`.
    pub element: String,
    /// The joint that sits on it; none for the camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
    /// Shifted or turned.
    pub error: ErrorKind,
    /// In the element's own axes, m or rad.
    pub size: [f64; 3],
    /// Chi-square of the score test.
    pub chi2: f64,
    /// Chi-square that chance exceeds too seldom to be believed.
    pub limit: f64,
    /// Root mean square over the task, m.
    pub tool_error_m: f64,
}

/// What stands for the base, or for all tags together: no view tells them apart.
pub(crate) const BASE: &str = "base (or all tags)";

impl GeometryError {
    /// What to do about it.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match (self.element.as_str(), &self.joint) {
            (BASE, _) => "check the frame of the tag map and the position of the base, then correct the wrong one",
            (_, None) => "check the fastening of the camera and its mount in robot.toml",
            _ => "measure the link and correct the URDF",
        }
    }
}

impl fmt::Display for GeometryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { element, joint, error, size, chi2, limit, tool_error_m } = self;
        let what = match (element.as_str(), joint) {
            (BASE, _) => "the base, or the frame of the tag map,".to_owned(),
            (_, None) => "the camera".to_owned(),
            (_, Some(joint)) => joint.clone(),
        };
        let (scale, unit) = error.display_unit();
        let [x, y, z] = size.map(|v| v * scale);
        let norm = (x * x + y * y + z * z).sqrt();
        write!(f, "{element} explains the data better than joint sensors: {what} ")?;
        match error {
            ErrorKind::Shift => {
                write!(f, "is {norm:.1} {unit} from its nominal position, ({x:.1}, {y:.1}, {z:.1}) {unit}")?
            }
            ErrorKind::Turn => {
                write!(f, "is turned by {norm:.2} {unit} from its nominal pose, ({x:.2}, {y:.2}, {z:.2}) {unit}")?;
            }
        }
        write!(f, " in its axes (chi-square {chi2:.0}, limit {limit:.0}; {:.1} mm at the tool)", tool_error_m * 1e3)
    }
}
