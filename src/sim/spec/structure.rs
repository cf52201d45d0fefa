//! `[world.structure]`.

use armcal_core::codes::Code;
use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::table::CheckedTable;
use armcal_core::robot::FileIssue;

/// Compliance, payload and hose of the arm, none of which the standard world has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StructureSpec {
    /// Compliance by joint: turn of the link behind its sensor per torque; 0 for joints that are not named.
    #[schemars(extend("additionalProperties" = { "type": "number", "minimum": 0.0, "maximum": 1e-2 }))]
    pub joint_compliance_rad_per_nm: BTreeMap<String, f64>,
    /// Full width of the backlash between sensor and link, by joint, for joints with a compliance.
    #[schemars(extend("additionalProperties" = { "type": "number", "minimum": 0.0, "maximum": 0.1 }))]
    pub bearing_play_rad: BTreeMap<String, f64>,
    /// Turn of the base on the vehicle per moment, about each of its axes.
    #[schemars(inner(range(min = 0.0, max = 1e-2)))]
    pub mount_compliance_rad_per_nm: [f64; 3],
    /// Motion of the base on the vehicle per force, along each of its axes.
    #[schemars(inner(range(min = 0.0, max = 1e-2)))]
    pub mount_compliance_m_per_n: [f64; 3],
    /// Damping of the mount over its stiffness; assumed.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub mount_damping_s: f64,
    /// Mass of a ball in the gripper; 0 for none.
    #[schemars(range(min = 0.0, max = 1e4))]
    pub payload_kg: f64,
    /// Density of the payload; steel by default.
    #[schemars(range(min = 100.0, max = 2e4))]
    pub payload_density_kg_m3: f64,
    /// Centre of the payload from the tool point, axes of the tool's link.
    #[schemars(inner(range(min = -10.0, max = 10.0)))]
    pub payload_offset_m: [f64; 3],
    /// Link to which a hose is tied; there is no hose without a stiffness.
    pub hose_link: String,
    /// Point at which the hose is tied, in the link's frame.
    #[schemars(inner(range(min = -10.0, max = 10.0)))]
    pub hose_point_m: [f64; 3],
    /// Point from which the hose comes, base frame.
    pub hose_anchor_m: [f64; 3],
    /// Length of the hose, which pulls when its ends are farther apart.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub hose_length_m: f64,
    /// Stiffness of the hose's pull; 0 for no hose.
    #[schemars(range(min = 0.0, max = 1e4))]
    pub hose_stiffness_n_m: f64,
}

impl Default for StructureSpec {
    fn default() -> Self {
        Self {
            joint_compliance_rad_per_nm: BTreeMap::new(),
            bearing_play_rad: BTreeMap::new(),
            mount_compliance_rad_per_nm: [0.0; 3],
            mount_compliance_m_per_n: [0.0; 3],
            mount_damping_s: 0.01,
            payload_kg: 0.0,
            payload_density_kg_m3: 7850.0,
            payload_offset_m: [0.0; 3],
            hose_link: String::new(),
            hose_point_m: [0.0; 3],
            hose_anchor_m: [0.0; 3],
            hose_length_m: 0.0,
            hose_stiffness_n_m: 0.0,
        }
    }
}

impl StructureSpec {
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the compliance of a joint, rad/(N m); 0 for a joint that is not named.
    pub(crate) fn joint_compliance(&self, joint: &str) -> f64 {
        self.joint_compliance_rad_per_nm.get(joint).copied().unwrap_or(0.0)
    }

    /// Returns the backlash of a joint's bearing, rad; 0 for a joint that is not named.
    pub(crate) fn bearing_play(&self, joint: &str) -> f64 {
        self.bearing_play_rad.get(joint).copied().unwrap_or(0.0)
    }

    /// Returns true if the base yields on the vehicle.
    pub(crate) fn mount_gives(&self) -> bool {
        self.mount_compliance_rad_per_nm != [0.0; 3] || self.mount_compliance_m_per_n != [0.0; 3]
    }
}

impl CheckedTable for StructureSpec {
    fn check(&self, file: &Path, table: &str) -> Result<(), FileIssue> {
        let check = |key: &str, value: f64, range| {
            FileIssue::check_range(file, &format!("{table}.{key}"), value, range).map(|_| ())
        };
        let vector = |key: &str, values: &[f64; 3], range: std::ops::RangeInclusive<f64>| {
            let each = |(axis, value): (usize, &f64)| check(&format!("{key}[{axis}]"), *value, range.clone());
            values.iter().enumerate().try_for_each(each)
        };
        for (joint, compliance) in &self.joint_compliance_rad_per_nm {
            check(&format!("joint_compliance_rad_per_nm.{joint}"), *compliance, 0.0..=1e-2)?;
        }
        for (joint, play) in &self.bearing_play_rad {
            check(&format!("bearing_play_rad.{joint}"), *play, 0.0..=0.1)?;
            if *play > 0.0 && self.joint_compliance(joint) == 0.0 {
                let problem = "needs joint_compliance_rad_per_nm of that joint: what lies beyond the play gives, too";
                return Err(FileIssue::new(
                    Code::KeyMissing,
                    file,
                    format!("{table}.bearing_play_rad.{joint}"),
                    problem,
                ));
            }
        }
        vector("mount_compliance_rad_per_nm", &self.mount_compliance_rad_per_nm, 0.0..=1e-2)?;
        vector("mount_compliance_m_per_n", &self.mount_compliance_m_per_n, 0.0..=1e-2)?;
        check("mount_damping_s", self.mount_damping_s, 0.0..=10.0)?;
        check("payload_kg", self.payload_kg, 0.0..=1e4)?;
        check("payload_density_kg_m3", self.payload_density_kg_m3, 100.0..=2e4)?;
        vector("payload_offset_m", &self.payload_offset_m, -10.0..=10.0)?;
        vector("hose_point_m", &self.hose_point_m, -10.0..=10.0)?;
        vector("hose_anchor_m", &self.hose_anchor_m, -10.0..=10.0)?;
        check("hose_length_m", self.hose_length_m, 0.0..=100.0)?;
        check("hose_stiffness_n_m", self.hose_stiffness_n_m, 0.0..=1e4)
    }
}
