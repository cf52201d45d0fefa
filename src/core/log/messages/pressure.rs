//! Pressure of the depth sensor.

use serde::{Deserialize, Serialize};

use super::basic::Header;
use super::checks::{finite, variance};
use crate::log::error::{DecodeRejection, EncodeError};
use crate::log::header::RecordingHeader;
use crate::log::schema::{RosMessage, RosSchema};
use crate::streams::PressureSample;

/// sensor_msgs/msg/FluidPressure, Pa and Pa squared.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FluidPressure {
    /// Stamp, and the frame of the vehicle.
    pub header: Header,
    /// Absolute pressure.
    pub fluid_pressure: f64,
    /// Variance of the pressure; 0 if it is unknown.
    pub variance: f64,
}

message!(
    FluidPressure,
    "sensor_msgs/msg/FluidPressure",
    "std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance\n",
    header!(),
);

pub(in crate::log) fn to_ros(m: &PressureSample, header: &RecordingHeader) -> Result<FluidPressure, EncodeError> {
    let header = Header::new(m.stamp, &header.vehicle_frame)?;
    Ok(FluidPressure { header, fluid_pressure: m.pressure_pa, variance: m.variance_pa2 })
}

pub(in crate::log) fn from_ros(m: &FluidPressure) -> Result<PressureSample, DecodeRejection> {
    finite("fluid_pressure", [m.fluid_pressure])?;
    Ok(PressureSample {
        stamp: m.header.stamp.try_into()?,
        pressure_pa: m.fluid_pressure,
        variance_pa2: variance(m.variance)?,
    })
}
