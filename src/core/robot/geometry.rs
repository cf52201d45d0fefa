//! How well the drawing is known: standard deviations of link geometry and tool point.

use std::path::Path;

use serde::Deserialize;

use super::error::FileIssue;

/// One sigma of each axis, about the drawing. `[geometry]` of robot.toml; the defaults are those of a machined arm that
/// was never bent (assumed).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GeometryPriors {
    /// Of each joint's place in its parent link, m.
    pub link_position_std_m: f64,
    /// Of each joint's attitude in its parent link, rad.
    pub link_rotation_std_rad: f64,
    /// Of the tool point in its link, m.
    pub tool_position_std_m: f64,
}

impl Default for GeometryPriors {
    fn default() -> Self {
        Self { link_position_std_m: 5e-4, link_rotation_std_rad: 5e-4, tool_position_std_m: 5e-4 }
    }
}

impl GeometryPriors {
    pub(super) fn check(self, file: &Path) -> Result<Self, FileIssue> {
        FileIssue::check_range(file, "geometry.link_position_std_m", self.link_position_std_m, 0.0..=1.0)?;
        FileIssue::check_range(file, "geometry.link_rotation_std_rad", self.link_rotation_std_rad, 0.0..=1.0)?;
        FileIssue::check_range(file, "geometry.tool_position_std_m", self.tool_position_std_m, 0.0..=1.0)?;
        Ok(self)
    }
}
