//! An error of the link geometry: the element, kind and size of the error, and its effect at the tool.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Kind of a geometry error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ErrorKind {
    /// Error of the element's position, m.
    Shift,
    /// Error of the element's attitude, rad.
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

/// Error that the score test of the link geometry found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GeometryError {
    /// The link, `camera mount` or `base (or all tags)`.
    pub element: String,
    /// The joint on the element; absent for the camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
    /// Kind of the error: shift or turn.
    pub error: ErrorKind,
    /// Error in the element's axes, m or rad.
    pub size: [f64; 3],
    /// Chi-square of the score test.
    pub chi2: f64,
    /// Limit of `chi2`, which chance exceeds too rarely to be the cause.
    pub limit: f64,
    /// Tool error, root mean square over the task, m.
    pub tool_error_m: f64,
}

/// Element name for the base and for all tags together: views cannot distinguish the two.
pub(crate) const BASE: &str = "base (or all tags)";

impl GeometryError {
    /// Advice to correct the error.
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
