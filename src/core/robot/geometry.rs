//! Prior standard deviations of the nominal model: link geometry, tool point and compliances.

use std::path::Path;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::error::FileIssue;
use crate::codes::Code;

/// Prior standard deviations about the nominal model, per axis: `[geometry]` of robot.toml. The defaults are those of a
/// machined arm that was never bent (assumed). They weigh explanations; no uncertainty may be based on them.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(from = "GeometryTable")]
pub struct GeometryPriors {
    /// Standard deviation of each joint's position in its parent link, m.
    pub link_position_std_m: f64,
    /// Standard deviation of each joint's attitude in its parent link, rad.
    pub link_rotation_std_rad: f64,
    /// Standard deviation of the tool point in its link, m.
    pub tool_position_std_m: f64,
    /// Standard deviation of each joint's compliance behind its sensor, rad/(N m).
    pub joint_compliance_std_rad_per_nm: f64,
    /// Standard deviation of the mount's compliance about each axis of the base, rad/(N m).
    pub mount_compliance_std_rad_per_nm: f64,
    /// Standard deviation of a load in the gripper, weight less buoyancy, N.
    pub tool_load_std_n: f64,
    /// Direction against gravity, in the base frame; of any length.
    pub up: [f64; 3],
    /// Distances between tags, measured without the camera.
    pub tag_distances: Vec<TagDistance>,
    /// Standard deviations that robot.toml states.
    pub stated: StatedGeometry,
}

/// Distance between the centres of two tags.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TagDistance {
    /// Ids of the two tags.
    pub tags: [u32; 2],
    /// Distance between the centres, by tape or laser.
    #[schemars(range(min = 1e-3, max = 1e3))]
    pub distance_m: f64,
    /// Standard deviation of the distance.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub std_m: f64,
}

/// Flags of the standard deviations that robot.toml states; the others are defaults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StatedGeometry {
    /// True if `link_position_std_m` is stated.
    pub link_position: bool,
    /// True if `link_rotation_std_rad` is stated.
    pub link_rotation: bool,
    /// True if `tool_position_std_m` is stated.
    pub tool_position: bool,
}

/// `[geometry]` as written in the file.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct GeometryTable {
    /// Standard deviation of each joint's position in its parent link, per axis; absent: 0.0005, not included in U95.
    #[schemars(range(min = 0.0, max = 1.0))]
    link_position_std_m: Option<f64>,
    /// Standard deviation of each joint's attitude in its parent link, per axis; absent: 0.0005, not included in U95.
    #[schemars(range(min = 0.0, max = 1.0))]
    link_rotation_std_rad: Option<f64>,
    /// Standard deviation of the tool point in its link, per axis; absent: 0.0005, not included in U95.
    #[schemars(range(min = 0.0, max = 1.0))]
    tool_position_std_m: Option<f64>,
    /// Standard deviation of each joint's compliance behind its sensor.
    #[schemars(range(min = 0.0, max = 1e-2))]
    joint_compliance_std_rad_per_nm: f64,
    /// Standard deviation of the mount's compliance, about each axis of the base.
    #[schemars(range(min = 0.0, max = 1e-2))]
    mount_compliance_std_rad_per_nm: f64,
    /// Standard deviation of a load in the gripper, weight less buoyancy.
    #[schemars(range(min = 0.0, max = 1e5))]
    tool_load_std_n: f64,
    /// Direction against gravity in the base frame, of any length.
    up: [f64; 3],
    /// Distances between tags that were measured without the camera; used if the views show both tags.
    tag_distance: Vec<TagDistance>,
}

impl Default for GeometryTable {
    fn default() -> Self {
        let usual = GeometryPriors::default();
        Self {
            link_position_std_m: None,
            link_rotation_std_rad: None,
            tool_position_std_m: None,
            joint_compliance_std_rad_per_nm: usual.joint_compliance_std_rad_per_nm,
            mount_compliance_std_rad_per_nm: usual.mount_compliance_std_rad_per_nm,
            tool_load_std_n: usual.tool_load_std_n,
            up: usual.up,
            tag_distance: usual.tag_distances,
        }
    }
}

impl From<GeometryTable> for GeometryPriors {
    fn from(table: GeometryTable) -> Self {
        let usual = Self::default();
        Self {
            link_position_std_m: table.link_position_std_m.unwrap_or(usual.link_position_std_m),
            link_rotation_std_rad: table.link_rotation_std_rad.unwrap_or(usual.link_rotation_std_rad),
            tool_position_std_m: table.tool_position_std_m.unwrap_or(usual.tool_position_std_m),
            joint_compliance_std_rad_per_nm: table.joint_compliance_std_rad_per_nm,
            mount_compliance_std_rad_per_nm: table.mount_compliance_std_rad_per_nm,
            tool_load_std_n: table.tool_load_std_n,
            up: table.up,
            tag_distances: table.tag_distance,
            stated: StatedGeometry {
                link_position: table.link_position_std_m.is_some(),
                link_rotation: table.link_rotation_std_rad.is_some(),
                tool_position: table.tool_position_std_m.is_some(),
            },
        }
    }
}

impl Default for GeometryPriors {
    fn default() -> Self {
        Self {
            link_position_std_m: 5e-4,
            link_rotation_std_rad: 5e-4,
            tool_position_std_m: 5e-4,
            joint_compliance_std_rad_per_nm: 1e-6,
            mount_compliance_std_rad_per_nm: 1e-6,
            tool_load_std_n: 200.0,
            up: [0.0, 0.0, 1.0],
            tag_distances: Vec::new(),
            stated: StatedGeometry::default(),
        }
    }
}

impl GeometryPriors {
    pub(super) fn check(self, file: &Path) -> Result<Self, FileIssue> {
        for (key, value, most) in [
            ("link_position_std_m", self.link_position_std_m, 1.0),
            ("link_rotation_std_rad", self.link_rotation_std_rad, 1.0),
            ("tool_position_std_m", self.tool_position_std_m, 1.0),
            ("joint_compliance_std_rad_per_nm", self.joint_compliance_std_rad_per_nm, 1e-2),
            ("mount_compliance_std_rad_per_nm", self.mount_compliance_std_rad_per_nm, 1e-2),
            ("tool_load_std_n", self.tool_load_std_n, 1e5),
            ("up (length)", Vector3::from(self.up).norm() - 1e-6, 1e3),
        ] {
            FileIssue::check_range(file, &format!("geometry.{key}"), value, 0.0..=most)?;
        }
        for TagDistance { tags: [a, b], distance_m, std_m } in &self.tag_distances {
            let key = |key: &str| format!("geometry.tag_distance of tags {a} and {b}: {key}");
            FileIssue::check_range(file, &key("distance_m"), *distance_m, 1e-3..=1e3)?;
            FileIssue::check_range(file, &key("std_m"), *std_m, 1e-6..=1.0)?;
            if a == b {
                return Err(FileIssue::new(Code::ValueInvalid, file, key("tags"), "must be two tags"));
            }
        }
        Ok(self)
    }
}
