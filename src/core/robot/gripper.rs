//! `[gripper]` of robot.toml: two parallel jaws that slide apart and together.
//!
//! The jaws are links of the URDF, fixed to the tool's link at their rest opening. Mass, collision shapes and
//! kinematics are those of the chain; only the visual shapes of the jaws move.

use crate::codes::Code;
use std::path::Path;

use nalgebra::{Isometry3, Unit, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::error::{FileIssue, RobotError};
use super::shape::PlacedShape;
use super::urdf::UrdfChain;
use crate::kinematics::Attachment;

/// The jaws and their motion.
#[derive(Clone, Debug)]
pub struct GripperSpec {
    /// The two jaws: the first opens along `opens_along`, the second against it.
    pub jaws: [Jaw; 2],
    /// Direction in which the first jaw opens, in the axes of the link that carries the jaws; the second moves the
    /// other way.
    pub opens_along: Unit<Vector3<f64>>,
    /// Link that carries the jaws, as the number of joints proximal to it.
    pub body: usize,
    /// Opening in the URDF.
    pub rest_opening_m: f64,
    /// Largest opening.
    pub opening_max_m: f64,
    /// Time from open to closed at full rate.
    pub closing_time_s: f64,
}

/// The visual shapes of one jaw.
#[derive(Clone, Debug)]
pub struct Jaw {
    /// Name of the jaw's link in the URDF.
    pub name: String,
    /// Shapes in the frame of the link that carries the jaw, at the rest opening.
    pub visuals: Vec<PlacedShape>,
}

impl GripperSpec {
    /// Displacement of jaw 0 or 1 from its pose in the URDF, in the frame of the link that carries it.
    #[must_use]
    pub fn shift(&self, jaw: usize, opening_m: f64) -> Isometry3<f64> {
        let shift_m = 0.5 * (opening_m - self.rest_opening_m) * if jaw == 0 { 1.0 } else { -1.0 };
        Isometry3::from(self.opens_along.scale(shift_m))
    }

    /// Reach of the open jaws beyond the arm's collision shapes, which have the jaws at rest.
    #[must_use]
    pub fn outline_growth_m(&self, opening_m: f64) -> f64 {
        (0.5 * (opening_m - self.rest_opening_m)).max(0.0)
    }
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct GripperFile {
    /// Links of the URDF that are the two jaws.
    jaws: [String; 2],
    /// Direction in which the first jaw opens, in the frame of the tool's link.
    #[schemars(inner(range(min = -1e3, max = 1e3)))]
    opens_along: [f64; 3],
    /// Width between the jaws as the arm carries them.
    #[schemars(range(min = 0.0, max = 2.0))]
    rest_opening_m: f64,
    /// Largest width between the jaws.
    #[schemars(range(min = 1e-3, max = 2.0))]
    opening_max_m: f64,
    /// Time in which the jaws close from the largest width.
    #[schemars(range(min = 0.05, max = 60.0))]
    closing_time_s: f64,
}

impl GripperFile {
    pub(super) fn jaws(&self) -> &[String] {
        &self.jaws
    }

    /// Checks the table against the URDF.
    ///
    /// # Errors
    /// [`RobotError`] naming file, key and allowed range.
    pub(super) fn check(self, file: &Path, arm: &UrdfChain<'_>, tool: &Attachment) -> Result<GripperSpec, RobotError> {
        let issue =
            |key: &str, problem: String| FileIssue::new(Code::ValueInvalid, file, format!("gripper.{key}"), problem);
        let check =
            |key: &str, value: f64, range| FileIssue::check_range(file, &format!("gripper.{key}"), value, range);
        if self.jaws[0] == self.jaws[1] {
            return Err(issue("jaws", format!("names `{}` twice", self.jaws[0])).into());
        }
        for link in &self.jaws {
            if !arm.urdf.has_link(link) {
                return Err(issue("jaws", format!("`{link}` is not a link of the URDF")).into());
            }
            if arm.attachment(link).ok().is_none_or(|jaw| jaw.n_joints != tool.n_joints) {
                return Err(issue("jaws", format!("`{link}` is not fixed to the link of the tool")).into());
            }
        }
        for value in self.opens_along {
            check("opens_along", value, -1e3..=1e3)?;
        }
        let opens_along = Unit::try_new(Vector3::from(self.opens_along), 1e-6)
            .ok_or_else(|| issue("opens_along", "has no direction".to_owned()))?;
        let opening_max_m = check("opening_max_m", self.opening_max_m, 1e-3..=2.0)?;
        let rest_opening_m = check("rest_opening_m", self.rest_opening_m, 0.0..=opening_max_m)?;
        let closing_time_s = check("closing_time_s", self.closing_time_s, 0.05..=60.0)?;
        let [first, second] = self.jaws;
        let jaw = |name: String| -> Result<Jaw, RobotError> {
            let visuals = arm.visuals_of(&name)?;
            Ok(Jaw { name, visuals })
        };
        let jaws = [jaw(first)?, jaw(second)?];
        Ok(GripperSpec { jaws, opens_along, body: tool.n_joints, rest_opening_m, opening_max_m, closing_time_s })
    }
}
