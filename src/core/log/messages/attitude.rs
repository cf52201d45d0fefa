//! Attitude, body rates and specific force of the vehicle.

use serde::{Deserialize, Serialize};

use super::basic::{Header, Quaternion, Vector3};
use super::checks::{finite, unit_quaternion_wxyz};
use crate::log::error::{DecodeRejection, EncodeError};
use crate::log::header::RecordingHeader;
use crate::log::schema::{RosMessage, RosSchema};
use crate::streams::Attitude;

/// sensor_msgs/msg/Imu, rad/s and m/s2; covariances row by row, with -1 first if the sensor lacks the quantity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Imu {
    /// Stamp, and the frame of the vehicle.
    pub header: Header,
    /// Attitude: `world_from_vehicle`.
    pub orientation: Quaternion,
    /// Covariance of `orientation`, rad2.
    pub orientation_covariance: [f64; 9],
    /// Angular velocity of the vehicle, in its own axes.
    pub angular_velocity: Vector3,
    /// Covariance of `angular_velocity`, rad2/s2.
    pub angular_velocity_covariance: [f64; 9],
    /// Specific force of the vehicle, in its own axes.
    pub linear_acceleration: Vector3,
    /// Covariance of `linear_acceleration`, m2/s4.
    pub linear_acceleration_covariance: [f64; 9],
}

message!(
    Imu,
    "sensor_msgs/msg/Imu",
    "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n",
    "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n",
    "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
    header!(),
    quaternion!(),
    vector3!(),
);

/// Converts an attitude. Covariances are zero, which means "unknown" in ROS.
pub(in crate::log) fn to_ros(m: &Attitude, header: &RecordingHeader) -> Result<Imu, EncodeError> {
    Ok(Imu {
        header: Header::new(m.stamp, &header.vehicle_frame)?,
        orientation: Quaternion::from_wxyz(m.quaternion_wxyz),
        angular_velocity: m.angular_velocity_rad_s.into(),
        linear_acceleration: m.specific_force_m_s2.into(),
        ..Imu::default()
    })
}

pub(in crate::log) fn from_ros(m: &Imu) -> Result<Attitude, DecodeRejection> {
    if m.orientation_covariance[0] < 0.0 {
        return Err(DecodeRejection::NoOrientation);
    }
    let quaternion_wxyz = unit_quaternion_wxyz(&m.orientation)?;
    let angular_velocity_rad_s = m.angular_velocity.into();
    let specific_force_m_s2 = m.linear_acceleration.into();
    finite("angular_velocity", angular_velocity_rad_s)?;
    finite("linear_acceleration", specific_force_m_s2)?;
    let stamp = m.header.stamp.try_into()?;
    Ok(Attitude { stamp, quaternion_wxyz, angular_velocity_rad_s, specific_force_m_s2 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attitude_without_direction_or_finite_numbers_is_rejected() {
        let mut imu = Imu::default();
        assert_eq!(from_ros(&imu), Err(DecodeRejection::QuaternionLength));
        imu.orientation.w = 1.0;
        assert!(from_ros(&imu).is_ok());
        imu.linear_acceleration.z = f64::INFINITY;
        assert_eq!(from_ros(&imu), Err(DecodeRejection::NotFinite { field: "linear_acceleration" }));
        imu.orientation_covariance[0] = -1.0;
        assert_eq!(from_ros(&imu), Err(DecodeRejection::NoOrientation));
    }
}
