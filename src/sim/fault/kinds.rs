//! Kinds of faults, as routines name them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Fault of the world; it is permanent unless it has a duration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Fault {
    /// The sensor slips on its shaft: it reads `by_rad` more from now on.
    SensorJump {
        /// Name of the joint in the URDF.
        joint: String,
        /// Slip, rad; positive: it reads a larger angle.
        #[schemars(range(min = -3.2, max = 3.2))]
        by_rad: f64,
    },
    /// The sensor keeps its present reading.
    SensorStuck {
        /// Name of the joint in the URDF.
        joint: String,
    },
    /// The sensor's wire breaks: its reading is independent of the joint.
    SensorDead {
        /// Name of the joint in the URDF.
        joint: String,
    },
    /// The sensor's sense is reversed: readings are mirrored about the middle of the joint's range.
    SensorReversed {
        /// Name of the joint in the URDF.
        joint: String,
    },
    /// A spot of the track wears: a bump on the reading about an angle.
    SensorWorn {
        /// Name of the joint in the URDF.
        joint: String,
        /// Joint angle at the middle of the spot.
        #[schemars(range(min = -6.3, max = 6.3))]
        at_rad: f64,
        /// Height of the bump; not beyond its width.
        #[schemars(range(min = -1.0, max = 1.0))]
        by_rad: f64,
        /// Standard width of the spot.
        #[schemars(range(min = 1e-3, max = 1.0))]
        width_rad: f64,
    },
    /// The wiper starts to lose contact at random.
    SensorDying {
        /// Name of the joint in the URDF.
        joint: String,
        /// Rate of drop-outs, 1/s; each lasts as `world.joint_sensors.dropout_mean_s` says.
        #[schemars(range(min = 0.0, max = 100.0))]
        dropout_per_s: f64,
    },
    /// The camera slips on its mount, by a translation and a rotation vector in its own axes.
    CameraSlipped {
        /// Translation along the camera's axes.
        #[serde(default)]
        #[schemars(inner(range(min = -0.5, max = 0.5)))]
        by_m: [f64; 3],
        /// Rotation vector along the camera's axes.
        #[serde(default)]
        #[schemars(inner(range(min = -3.2, max = 3.2)))]
        by_rad: [f64; 3],
    },
    /// The valve jams shut: the oil holds the joint where it is.
    JointLocked {
        /// Name of the joint in the URDF.
        joint: String,
    },
    /// The valve of one joint (a leaking hose) or the pump loses a share of the supply pressure.
    PressureLost {
        /// Name of the joint in the URDF; `None`: the pump.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        joint: Option<String>,
        /// Lost share: 0 is none, 1 is all.
        #[schemars(range(min = 0.0, max = 1.0))]
        ratio: f64,
    },
    /// The tag falls off.
    TagLost {
        /// Number of the tag.
        id: u32,
    },
    /// The tag is displaced by a translation and a rotation vector in its own axes.
    TagMoved {
        /// Number of the tag.
        id: u32,
        /// Translation along the tag's axes.
        #[serde(default)]
        #[schemars(inner(range(min = -2.0, max = 2.0)))]
        by_m: [f64; 3],
        /// Rotation vector along the tag's axes.
        #[serde(default)]
        #[schemars(inner(range(min = -3.2, max = 3.2)))]
        by_rad: [f64; 3],
    },
    /// The detector reads a wrong id from the tag.
    TagMisread {
        /// Number of the tag.
        id: u32,
        /// Id that is read instead.
        #[schemars(range(min = 0, max = 2147483647))]
        as_id: u32,
    },
    /// Silt blinds the camera for a time.
    Silt {
        /// Duration for which the camera is blind.
        #[schemars(range(min = 0.0, max = 1e6))]
        seconds: f64,
    },
    /// A short force strikes the vehicle, in vehicle axes, at a point of it (its origin, if left out).
    #[serde(rename = "vehicle_knocked")]
    VehicleImpulse {
        /// Force in vehicle axes.
        #[schemars(inner(range(min = -1e6, max = 1e6)))]
        force_n: [f64; 3],
        /// Duration of the force.
        #[schemars(range(min = 0.01, max = 10.0))]
        duration_s: f64,
        /// Point of the force in the vehicle's frame.
        #[serde(default)]
        #[schemars(inner(range(min = -10.0, max = 10.0)))]
        at_m: [f64; 3],
    },
    /// A short force strikes a link at its centre of mass, in base axes.
    #[serde(rename = "arm_bumped")]
    ArmImpulse {
        /// Name of the link in the URDF.
        link: String,
        /// Force in base axes.
        #[schemars(inner(range(min = -1e5, max = 1e5)))]
        force_n: [f64; 3],
        /// Duration of the force.
        #[schemars(range(min = 0.01, max = 10.0))]
        duration_s: f64,
    },
}

/// Latest time of a fault since the start, s.
pub(crate) const LATEST_FAULT_S: f64 = 1e6;

/// Fault with its time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScheduledFault {
    /// Time since the start, s; `None`: at its step of the script.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_s: Option<f64>,
    /// Fault that happens.
    #[serde(flatten)]
    pub fault: Fault,
}

impl From<Fault> for ScheduledFault {
    /// Schedules the fault at a step of the script.
    fn from(fault: Fault) -> Self {
        Self { at_s: None, fault }
    }
}

impl Fault {
    /// Returns the kind as routines name it.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::SensorJump { .. } => "sensor_jump",
            Self::SensorStuck { .. } => "sensor_stuck",
            Self::SensorDead { .. } => "sensor_dead",
            Self::SensorReversed { .. } => "sensor_reversed",
            Self::SensorWorn { .. } => "sensor_worn",
            Self::SensorDying { .. } => "sensor_dying",
            Self::CameraSlipped { .. } => "camera_slipped",
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

    /// Returns the values in a routine without the kind: `by_rad = 0.05, joint = "wrist_yaw"`.
    #[must_use]
    pub fn details(&self) -> String {
        let mut table = toml::Table::try_from(self).unwrap_or_default();
        table.remove("kind");
        table.iter().map(|(key, value)| format!("{key} = {value}")).collect::<Vec<_>>().join(", ")
    }
}
