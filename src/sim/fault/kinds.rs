//! Kinds of faults, as routines name them.

use serde::{Deserialize, Serialize};

/// One fault; it is permanent unless it has a duration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Fault {
    /// The sensor slips on its shaft: it reads `by_rad` more from now on.
    SensorJump { joint: String, by_rad: f64 },
    /// The sensor keeps the word that it reads now.
    SensorStuck { joint: String },
    /// The sensor's wire breaks: its word says nothing about the joint any more.
    SensorDead { joint: String },
    /// The valve jams shut: the oil holds the joint where it is.
    JointLocked { joint: String },
    /// This share of the supply pressure is lost, of one joint's valve (a hose leaks) or of the pump.
    PressureLost {
        #[serde(default, skip_serializing_if = "Option::is_none")]
        joint: Option<String>,
        /// 0: none is lost, 1: all of it.
        ratio: f64,
    },
    /// The tag falls off.
    TagLost { id: u32 },
    /// The tag is displaced by a translation and a rotation vector in its own axes.
    TagMoved {
        id: u32,
        #[serde(default)]
        by_m: [f64; 3],
        #[serde(default)]
        by_rad: [f64; 3],
    },
    /// The detector takes the tag for another one.
    TagMisread { id: u32, as_id: u32 },
    /// The camera sees nothing for a while.
    Silt { seconds: f64 },
    /// Something strikes the vehicle: a force in vehicle axes for a moment, at a point of it (its origin, if left out).
    #[serde(rename = "vehicle_knocked")]
    VehicleImpulse {
        force_n: [f64; 3],
        duration_s: f64,
        #[serde(default)]
        at_m: [f64; 3],
    },
    /// Something strikes a link at its centre of mass: a force in base axes for a moment.
    #[serde(rename = "arm_bumped")]
    ArmImpulse { link: String, force_n: [f64; 3], duration_s: f64 },
}

/// A fault and when it happens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScheduledFault {
    /// Seconds after the start; `None`: at its step of the script.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_s: Option<f64>,
    #[serde(flatten)]
    pub fault: Fault,
}

impl From<Fault> for ScheduledFault {
    /// At a step of the script.
    fn from(fault: Fault) -> Self {
        Self { at_s: None, fault }
    }
}

impl Fault {
    /// As routines name it.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::SensorJump { .. } => "sensor_jump",
            Self::SensorStuck { .. } => "sensor_stuck",
            Self::SensorDead { .. } => "sensor_dead",
            Self::JointLocked { .. } => "joint_locked",
            Self::PressureLost { .. } => "pressure_lost",
            Self::TagLost { .. } => "tag_lost",
            Self::TagMoved { .. } => "tag_moved",
            Self::TagMisread { .. } => "tag_misread",
            Self::Silt { .. } => "silt",
            Self::VehicleImpulse { .. } => "vehicle_knocked",
            Self::ArmImpulse { .. } => "arm_bumped",
        }
    }

    /// Its values in a routine besides the kind: `by_rad = 0.05, joint = "wrist_yaw"`.
    #[must_use]
    pub fn details(&self) -> String {
        let mut table = toml::Table::try_from(self).unwrap_or_default();
        table.remove("kind");
        table.iter().map(|(key, value)| format!("{key} = {value}")).collect::<Vec<_>>().join(", ")
    }
}
