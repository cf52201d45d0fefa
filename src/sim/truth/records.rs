//! Records of the truth's stream and the sink that takes them.

use serde::{Deserialize, Serialize};

use crate::as_built::AsBuilt;
use armcal_core::spatial::{Base, Camera, Pose, Tool, Vehicle, World};
use armcal_core::streams::{JointAngles, SinkError};
use armcal_core::time::Stamp;

/// Constants of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TruthHeader {
    /// Name of the robot.
    pub robot: String,
    /// Name of the vehicle.
    pub vehicle: String,
    /// Names of the joints, base first.
    pub joint_names: Vec<String>,
    /// Seed of the world.
    #[serde(with = "seed_text")]
    pub seed: u64,
    /// `[world]` as TOML text, every key written out.
    pub spec_toml: String,
    /// What was drawn for the seed.
    pub as_built: AsBuilt,
}

/// The true state at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthState {
    /// By the arm's clock.
    pub stamp: Stamp,
    /// rad.
    pub angles: JointAngles,
    /// rad/s.
    pub rates: JointAngles,
    /// Of the oil columns, N m.
    pub torques: JointAngles,
    /// True pose of the tool point.
    pub base_from_tool: Pose<Base, Tool>,
    /// True pose of the camera.
    pub base_from_camera: Pose<Base, Camera>,
    /// True pose of the vehicle.
    pub world_from_vehicle: Pose<World, Vehicle>,
    /// Oil temperature, degrees Celsius.
    pub oil_c: f64,
    /// Water temperature, degrees Celsius.
    pub water_c: f64,
}

/// Two parts began to touch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TruthContact {
    /// By the arm's clock.
    pub stamp: Stamp,
    /// Name of a link or of something around the arm.
    pub part_a: String,
    /// The other part.
    pub part_b: String,
}

/// The nearest two parts at one instant; not above 0 where they touch.
#[derive(Clone, Debug, PartialEq)]
pub struct TruthClearance {
    /// By the arm's clock.
    pub stamp: Stamp,
    /// Distance of their surfaces.
    pub distance_m: f64,
    /// Name of a link or of something around the arm.
    pub part_a: String,
    /// The other part.
    pub part_b: String,
}

/// Something broke.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TruthFault {
    /// By the arm's clock.
    pub stamp: Stamp,
    /// As routines name it.
    pub kind: String,
    /// Its other values in the routine: `joint = "wrist_yaw"`.
    pub details: String,
}

/// Takes the truth as it comes, in the order of time.
pub trait TruthSink {
    /// Comes first, once.
    ///
    /// # Errors
    /// Here and below: when it cannot be kept.
    fn begin(&mut self, header: &TruthHeader) -> Result<(), SinkError>;

    /// # Errors
    /// See [`Self::begin`].
    fn state(&mut self, state: &TruthState) -> Result<(), SinkError>;

    /// # Errors
    /// See [`Self::begin`].
    fn contact(&mut self, contact: &TruthContact) -> Result<(), SinkError>;

    /// # Errors
    /// See [`Self::begin`].
    fn clearance(&mut self, clearance: &TruthClearance) -> Result<(), SinkError>;

    /// # Errors
    /// See [`Self::begin`].
    fn fault(&mut self, fault: &TruthFault) -> Result<(), SinkError>;

    /// Comes last, once.
    ///
    /// # Errors
    /// See [`Self::begin`].
    fn finish(self: Box<Self>) -> Result<(), SinkError>;
}

/// TOML has no integers beyond 63 bits: the seed travels as text.
mod seed_text {
    use serde::{Deserialize, Deserializer, Serializer, de};

    pub(super) fn serialize<S: Serializer>(seed: &u64, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(seed)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
    }
}
