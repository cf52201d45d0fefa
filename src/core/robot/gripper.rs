//! `[gripper]` of robot.toml: two parallel jaws that slide apart and together.
//!
//! The jaws are links of the URDF, fixed to the tool's link where they stand at rest, so that mass, collision and kinematics are
//! the chain's alone; only what is drawn of them moves.

use std::path::Path;

use nalgebra::{Isometry3, Unit, Vector3};
use serde::Deserialize;

use super::error::{FileIssue, RobotError};
use super::shape::PlacedShape;
use super::urdf::UrdfModel;
use crate::kinematics::{Attachment, Chain};

/// The jaws and how they move.
#[derive(Clone, Debug)]
pub struct GripperSpec {
    pub jaws: [Jaw; 2],
    /// Way of the first jaw when they open, axes of the link that carries them; the second goes the other way.
    pub opens_along: Unit<Vector3<f64>>,
    /// The link that carries them, as a number of joints before it.
    pub body: usize,
    /// Between the jaws as the arm carries them, as the URDF has them drawn.
    pub rest_opening_m: f64,
    /// Between the jaws at most.
    pub opening_max_m: f64,
    /// From open to closed at full rate.
    pub closing_time_s: f64,
}

/// One jaw as drawn.
#[derive(Clone, Debug)]
pub struct Jaw {
    pub name: String,
    /// In the frame of the link that carries it, at rest.
    pub visuals: Vec<PlacedShape>,
}

impl GripperSpec {
    /// How far jaw 0 or 1 has gone from where it is drawn, in the frame of the link that carries it.
    #[must_use]
    pub fn shift(&self, jaw: usize, opening_m: f64) -> Isometry3<f64> {
        let way_m = 0.5 * (opening_m - self.rest_opening_m) * if jaw == 0 { 1.0 } else { -1.0 };
        Isometry3::from(self.opens_along.scale(way_m))
    }

    /// By how much the arm's outline grows beyond that of its collision shapes, which have the jaws at rest.
    #[must_use]
    pub fn outline_growth_m(&self, opening_m: f64) -> f64 {
        (0.5 * (opening_m - self.rest_opening_m)).max(0.0)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GripperFile {
    /// Links of the URDF.
    jaws: [String; 2],
    opens_along: [f64; 3],
    rest_opening_m: f64,
    opening_max_m: f64,
    closing_time_s: f64,
}

impl GripperFile {
    pub(super) fn jaws(&self) -> &[String] {
        &self.jaws
    }

    /// Checks the table against the drawing.
    ///
    /// # Errors
    /// [`RobotError`] naming file, key and allowed range.
    pub(super) fn check(
        self,
        file: &Path,
        urdf: &UrdfModel,
        base_link: &str,
        chain: &Chain,
        tool: &Attachment,
    ) -> Result<GripperSpec, RobotError> {
        let issue = |key: &str, problem: String| FileIssue::new(file, format!("gripper.{key}"), problem);
        let check =
            |key: &str, value: f64, range| FileIssue::check_range(file, &format!("gripper.{key}"), value, range);
        if self.jaws[0] == self.jaws[1] {
            return Err(issue("jaws", format!("names `{}` twice", self.jaws[0])).into());
        }
        for link in &self.jaws {
            if !urdf.has_link(link) {
                return Err(issue("jaws", format!("`{link}` is no link of the URDF")).into());
            }
            if urdf.attachment(base_link, link, chain).ok().is_none_or(|jaw| jaw.n_joints != tool.n_joints) {
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
            let visuals = urdf.visuals_of(base_link, &name, chain)?;
            Ok(Jaw { name, visuals })
        };
        let jaws = [jaw(first)?, jaw(second)?];
        Ok(GripperSpec { jaws, opens_along, body: tool.n_joints, rest_opening_m, opening_max_m, closing_time_s })
    }
}
