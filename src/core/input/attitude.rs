//! Attitude of the arm's carrier, by `sensor_msgs/msg/Imu`: the direction of up at the base.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::error::{BadPlace, InputError};
use super::map::{InputMap, NotFinite, QUATERNION_LENGTH_TOLERANCE, Topics};
use super::stamp::TopicClock;
use crate::log::ros::Imu;
use crate::log::{RawMessage, decode};
use crate::time::Stamp;

/// Direction of up at one stamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeReading {
    /// The header's stamp, or the log time if the header has none.
    pub stamp: Stamp,
    /// Unit vector against gravity, in the frame of the arm's base.
    pub up: Vector3<f64>,
    /// Hash of the message's bytes.
    pub digest: [u8; 32],
}

/// Reads the messages of `conditions.attitude`.
pub(super) struct AttitudeReader<'a> {
    file: &'a str,
    not_finite: NotFinite,
    base_from_sensor: UnitQuaternion<f64>,
    clock: TopicClock,
    pub readings: Vec<AttitudeReading>,
    pub left_out: u64,
    messages: u64,
}

impl<'a> AttitudeReader<'a> {
    pub fn new(file: &'a str, map: &InputMap, topics: &Topics) -> Self {
        let (not_finite, base_from_sensor) = (map.not_finite, topics.base_from_attitude);
        let clock = TopicClock::new(map.stamps);
        Self { file, not_finite, base_from_sensor, clock, readings: Vec::new(), left_out: 0, messages: 0 }
    }

    pub fn take(&mut self, raw: &RawMessage<'_>, digest: [u8; 32]) -> Result<(), InputError> {
        self.messages += 1;
        let file = || self.file.to_owned();
        let place = BadPlace::Message { topic: raw.topic().to_owned(), message: self.messages };
        let message: Imu = match decode(raw.data) {
            Ok(message) => message,
            Err(error) => return Err(InputError::Undecodable { file: file(), place, error }),
        };
        if message.orientation_covariance[0] < 0.0 {
            let problem = "the sensor gives no orientation (its covariance begins with -1); leave \
                 `conditions.attitude` out, or record what has one";
            return Err(InputError::Row { file: file(), place, problem: problem.to_owned() });
        }
        let [w, x, y, z] = message.orientation.wxyz();
        let quaternion = Quaternion::new(w, x, y, z);
        if let Some(value) = [w, x, y, z].into_iter().find(|value| !value.is_finite()) {
            if self.not_finite == NotFinite::LeaveOut {
                self.left_out += 1;
                return Ok(());
            }
            let of = raw.topic().to_owned();
            return Err(InputError::NotFinite { file: file(), place, field: "orientation", of, value });
        }
        if (quaternion.norm() - 1.0).abs() > QUATERNION_LENGTH_TOLERANCE {
            let problem = format!("the orientation is no rotation: its length is {:.4}, not 1", quaternion.norm());
            return Err(InputError::Row { file: file(), place, problem });
        }
        let world_from_sensor = UnitQuaternion::from_quaternion(quaternion);
        let up = self.base_from_sensor * (world_from_sensor.inverse() * Vector3::z());
        let stamp = self.clock.read(message.header.stamp, raw.log_time());
        self.readings.push(AttitudeReading { stamp, up, digest });
        Ok(())
    }

    /// Returns the readings in the order of time, and the number of messages left out.
    pub fn finish(mut self) -> (Vec<AttitudeReading>, u64) {
        self.readings.sort_by_key(|reading| reading.stamp);
        (self.readings, self.left_out)
    }
}
