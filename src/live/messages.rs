//! ROS types that recordings lack, for every wire.

use serde::{Deserialize, Serialize};

use crate::{CommandType, LiveError};
use armcal_core::log::ros::{Header, JointState, Time};
use armcal_core::log::{CdrError, decode, encode};
use armcal_core::time::Stamp;

/// Type of [`Bool`].
pub(crate) const BOOL: &str = "std_msgs/msg/Bool";

/// std_msgs/msg/Bool.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Bool {
    pub data: bool,
}

/// trajectory_msgs/msg/JointTrajectory.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct JointTrajectory {
    header: Header,
    joint_names: Vec<String>,
    points: Vec<JointTrajectoryPoint>,
}

/// trajectory_msgs/msg/JointTrajectoryPoint.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct JointTrajectoryPoint {
    positions: Vec<f64>,
    velocities: Vec<f64>,
    accelerations: Vec<f64>,
    effort: Vec<f64>,
    time_from_start: Time,
}

/// std_msgs/msg/Float64MultiArray.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Float64MultiArray {
    layout: MultiArrayLayout,
    data: Vec<f64>,
}

/// std_msgs/msg/MultiArrayLayout.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct MultiArrayLayout {
    dim: Vec<MultiArrayDimension>,
    data_offset: u32,
}

/// std_msgs/msg/MultiArrayDimension.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct MultiArrayDimension {
    label: String,
    size: u32,
    stride: u32,
}

/// A message that carries a set-point.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum CommandMessage {
    Trajectory(JointTrajectory),
    Array(Float64MultiArray),
    State(JointState),
}

/// Set-point in any of the types that carry one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Command {
    pub stamp: Stamp,
    /// Joint names of the driver; empty if the type has none.
    pub names: Vec<String>,
    pub positions: Vec<f64>,
    /// Time within which the set-point is to be reached, s; zero if the type has none.
    pub within_s: f64,
}

impl Command {
    /// Returns the set-point as a message of one of the types that drivers take.
    pub fn message(&self, message_type: CommandType) -> Result<CommandMessage, LiveError> {
        let header = Header::new(self.stamp, "")?;
        let (names, positions) = (self.names.clone(), self.positions.clone());
        Ok(match message_type {
            CommandType::JointTrajectory => {
                let nanos = (self.within_s * 1e9).round().clamp(0.0, 1e18) as i64;
                let time_from_start =
                    Time { sec: (nanos / 1_000_000_000) as i32, nanosec: (nanos % 1_000_000_000) as u32 };
                let (velocities, accelerations, effort) = (Vec::new(), Vec::new(), Vec::new());
                let point = JointTrajectoryPoint { positions, velocities, accelerations, effort, time_from_start };
                CommandMessage::Trajectory(JointTrajectory { header, joint_names: names, points: vec![point] })
            }
            CommandType::Float64MultiArray => {
                CommandMessage::Array(Float64MultiArray { layout: MultiArrayLayout::default(), data: positions })
            }
            CommandType::JointState => {
                CommandMessage::State(JointState { header, name: names, position: positions, ..JointState::default() })
            }
        })
    }

    pub fn encode(&self, message_type: CommandType, out: &mut Vec<u8>) -> Result<(), LiveError> {
        encode(&self.message(message_type)?, out).map_err(|error| LiveError::Encode(error.into()))
    }

    /// Decodes a set-point; of a trajectory it takes the last point.
    pub fn decode(message_type: CommandType, bytes: &[u8]) -> Result<Self, CdrError> {
        let stamp = |header: &Header| Stamp::try_from(header.stamp).unwrap_or(Stamp { nanos: 0 });
        Ok(match message_type {
            CommandType::JointTrajectory => {
                let message: JointTrajectory = decode(bytes)?;
                let last = message.points.last().ok_or(CdrError::Value)?;
                let within_s = f64::from(last.time_from_start.sec) + 1e-9 * f64::from(last.time_from_start.nanosec);
                let (stamp, positions) = (stamp(&message.header), last.positions.clone());
                Self { stamp, names: message.joint_names, positions, within_s }
            }
            CommandType::Float64MultiArray => {
                let message: Float64MultiArray = decode(bytes)?;
                Self { stamp: Stamp { nanos: 0 }, names: Vec::new(), positions: message.data, within_s: 0.0 }
            }
            CommandType::JointState => {
                let message: JointState = decode(bytes)?;
                let stamp = stamp(&message.header);
                Self { stamp, names: message.name, positions: message.position, within_s: 0.0 }
            }
        })
    }

    /// Returns the positions in the order of `names`; `None` if one is missing or is no number.
    pub fn in_order(&self, names: &[&str]) -> Option<Vec<f64>> {
        let positions: Vec<f64> = if self.names.is_empty() {
            self.positions.clone()
        } else {
            let position = |name: &&str| {
                let index = self.names.iter().position(|own| own == name)?;
                self.positions.get(index).copied()
            };
            names.iter().map(position).collect::<Option<_>>()?
        };
        (positions.len() == names.len() && positions.iter().all(|position| position.is_finite())).then_some(positions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_point_survives_each_of_its_types() {
        let names = vec!["a".to_owned(), "b".to_owned()];
        let command =
            Command { stamp: Stamp { nanos: 5_000_000_007 }, names, positions: vec![1.5, -2.5], within_s: 0.02 };
        let mut bytes = Vec::new();
        for message_type in [CommandType::JointTrajectory, CommandType::Float64MultiArray, CommandType::JointState] {
            command.encode(message_type, &mut bytes).unwrap();
            let back = Command::decode(message_type, &bytes).unwrap();
            assert_eq!(back.in_order(&["a", "b"]), Some(vec![1.5, -2.5]), "{message_type:?}");
            if message_type == CommandType::JointTrajectory {
                assert_eq!(back, command);
                assert_eq!(back.in_order(&["b", "a"]), Some(vec![-2.5, 1.5]));
                assert_eq!(back.in_order(&["b", "c"]), None);
            }
            for end in 0..bytes.len() {
                assert!(Command::decode(message_type, &bytes[..end]).is_err(), "{message_type:?}, {end} bytes");
            }
        }
    }
}
