//! ROS types that several messages contain.
//!
//! Quaternions are x, y, z, w here, as in ROS; everywhere else in this crate w comes first.

use serde::{Deserialize, Serialize};

use crate::log::error::{DecodeRejection, EncodeError};
use crate::time::Stamp;

const NANOS_PER_S: i64 = 1_000_000_000;

/// builtin_interfaces/msg/Time: seconds and nanoseconds since the Unix epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Seconds, rounded down; negative before 1970.
    pub sec: i32,
    /// Remaining nanoseconds, 0..1e9.
    pub nanosec: u32,
}

impl TryFrom<Stamp> for Time {
    type Error = EncodeError;

    fn try_from(stamp: Stamp) -> Result<Self, EncodeError> {
        let sec = i32::try_from(stamp.nanos.div_euclid(NANOS_PER_S)).map_err(|_| EncodeError::StampRange { stamp })?;
        Ok(Self { sec, nanosec: stamp.nanos.rem_euclid(NANOS_PER_S) as u32 })
    }
}

impl TryFrom<Time> for Stamp {
    type Error = DecodeRejection;

    fn try_from(time: Time) -> Result<Self, DecodeRejection> {
        if i64::from(time.nanosec) >= NANOS_PER_S {
            return Err(DecodeRejection::StampNanos { nanosec: time.nanosec });
        }
        Ok(Self { nanos: i64::from(time.sec) * NANOS_PER_S + i64::from(time.nanosec) })
    }
}

/// std_msgs/msg/Header.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Sender's clock.
    pub stamp: Time,
    /// Frame of the message's coordinates; empty if it has none.
    pub frame_id: String,
}

impl Header {
    /// Builds the header of a message at `stamp` with coordinates in `frame_id`.
    ///
    /// # Errors
    /// [`EncodeError::StampRange`].
    pub fn new(stamp: Stamp, frame_id: &str) -> Result<Self, EncodeError> {
        Ok(Self { stamp: stamp.try_into()?, frame_id: frame_id.to_owned() })
    }
}

/// geometry_msgs/msg/Quaternion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the ROS type")]
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

impl Quaternion {
    /// Builds a quaternion of w, x, y, z.
    #[must_use]
    pub fn from_wxyz([w, x, y, z]: [f64; 4]) -> Self {
        Self { x, y, z, w }
    }

    /// Returns w, x, y, z.
    #[must_use]
    pub fn wxyz(self) -> [f64; 4] {
        [self.w, self.x, self.y, self.z]
    }
}

/// geometry_msgs/msg/Vector3.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the ROS type")]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// geometry_msgs/msg/Point, m.
pub type Point = Vector3;

impl From<[f64; 3]> for Vector3 {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}

impl From<Vector3> for [f64; 3] {
    fn from(v: Vector3) -> Self {
        [v.x, v.y, v.z]
    }
}

/// geometry_msgs/msg/Transform, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the ROS type")]
pub struct Transform {
    pub translation: Vector3,
    pub rotation: Quaternion,
}

/// geometry_msgs/msg/Pose, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the ROS type")]
pub struct Pose {
    pub position: Point,
    pub orientation: Quaternion,
}

/// apriltag_msgs/msg/Point, px.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PixelPoint {
    /// Column, to the right; 0 at the centre of the first pixel.
    pub x: f64,
    /// Row, downwards; 0 at the centre of the first pixel.
    pub y: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_before_and_after_the_epoch_round_trip() {
        for nanos in [0, 1, -1, 999_999_999, -1_000_000_000, 1_767_225_600_123_456_789] {
            let time = Time::try_from(Stamp { nanos }).unwrap();
            assert_eq!(Stamp::try_from(time).unwrap().nanos, nanos);
        }
        assert!(Time::try_from(Stamp { nanos: i64::MAX }).is_err());
        assert!(Stamp::try_from(Time { sec: 0, nanosec: 1_000_000_000 }).is_err());
    }
}
