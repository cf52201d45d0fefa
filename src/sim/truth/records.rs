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
    /// Text of `[world]` as TOML, every key written out.
    pub spec_toml: String,
    /// As-built values that were drawn for the seed.
    pub as_built: AsBuilt,
}

/// True state at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthState {
    /// Time by the arm's clock.
    pub stamp: Stamp,
    /// Joint angles, rad.
    pub angles: JointAngles,
    /// Joint rates, rad/s.
    pub rates: JointAngles,
    /// Torques of the oil columns, N m.
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

/// Start of a contact of two parts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TruthContact {
    /// Time by the arm's clock.
    pub stamp: Stamp,
    /// Name of a link or of a part around the arm.
    pub part_a: String,
    /// Name of the other part.
    pub part_b: String,
}

/// Nearest two parts at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct TruthClearance {
    /// Time by the arm's clock.
    pub stamp: Stamp,
    /// Distance of their surfaces; at most 0 if they touch.
    pub distance_m: f64,
    /// Name of a link or of a part around the arm.
    pub part_a: String,
    /// Name of the other part.
    pub part_b: String,
}

/// Fault in the simulated world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TruthFault {
    /// Time by the arm's clock.
    pub stamp: Stamp,
    /// Kind as routines name it.
    pub kind: String,
    /// Other values in the routine: `joint = "wrist_yaw"`.
    pub details: String,
}

/// Sink of the truth, in the order of time.
pub trait TruthSink {
    /// Takes the header, first and once.
    ///
    /// # Errors
    /// [`SinkError`] here and below if it cannot be stored.
    fn begin(&mut self, header: &TruthHeader) -> Result<(), SinkError>;

    /// Takes a state.
    ///
    /// # Errors
    /// See [`Self::begin`].
    fn state(&mut self, state: &TruthState) -> Result<(), SinkError>;

    /// Takes a contact.
    ///
    /// # Errors
    /// See [`Self::begin`].
    fn contact(&mut self, contact: &TruthContact) -> Result<(), SinkError>;

    /// Takes a clearance.
    ///
    /// # Errors
    /// See [`Self::begin`].
    fn clearance(&mut self, clearance: &TruthClearance) -> Result<(), SinkError>;

    /// Takes a fault.
    ///
    /// # Errors
    /// See [`Self::begin`].
    fn fault(&mut self, fault: &TruthFault) -> Result<(), SinkError>;

    /// Ends the stream, last and once.
    ///
    /// # Errors
    /// See [`Self::begin`].
    fn finish(self: Box<Self>) -> Result<(), SinkError>;
}

/// TOML has no integers beyond 63 bits, so the seed is written as text.
mod seed_text {
    use serde::{Deserialize, Deserializer, Serializer, de};

    pub(super) fn serialize<S: Serializer>(seed: &u64, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(seed)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
    }
}
