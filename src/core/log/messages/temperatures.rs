//! Temperatures of oil and water.

use serde::{Deserialize, Serialize};

use super::basic::Header;
use super::checks::{finite, variance};
use crate::log::error::{DecodeRejection, EncodeError};
use crate::log::header::RecordingHeader;
use crate::log::schema::{RosMessage, RosSchema};
use crate::streams::{TemperatureSample, Thermometer};

/// sensor_msgs/msg/Temperature, degrees Celsius and their square.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Temperature {
    /// Stamp, and the frame of the vehicle.
    pub header: Header,
    /// Temperature of the oil or the water, by topic.
    pub temperature: f64,
    /// Variance of the temperature; 0 if it is unknown.
    pub variance: f64,
}

message!(
    Temperature,
    "sensor_msgs/msg/Temperature",
    "std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n",
    header!(),
);

/// Converts a temperature; the topic states the thermometer.
pub(in crate::log) fn to_ros(m: &TemperatureSample, header: &RecordingHeader) -> Result<Temperature, EncodeError> {
    let header = Header::new(m.stamp, &header.vehicle_frame)?;
    Ok(Temperature { header, temperature: m.temperature_c, variance: m.variance_c2 })
}

pub(in crate::log) fn from_ros(
    m: &Temperature,
    thermometer: Thermometer,
) -> Result<TemperatureSample, DecodeRejection> {
    finite("temperature", [m.temperature])?;
    Ok(TemperatureSample {
        stamp: m.header.stamp.try_into()?,
        thermometer,
        temperature_c: m.temperature,
        variance_c2: variance(m.variance)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn temperature_that_is_not_a_number_is_rejected() {
        let hot = Temperature { temperature: f64::NAN, ..Default::default() };
        assert_eq!(from_ros(&hot, Thermometer::Oil), Err(DecodeRejection::NotFinite { field: "temperature" }));
    }
}
