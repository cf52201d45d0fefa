//! The attitude sensor as built.

use serde::{Deserialize, Serialize};

use crate::as_built::normal::normal_vector;
use crate::spec::VehicleMotionSpec;

/// Constant errors of the attitude sensor, in its own axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AttitudeAsBuilt {
    /// Rotation vector of the sensor's axes in the vehicle's.
    pub misalignment_rad: [f64; 3],
    /// Gyro bias at the start, rad/s.
    pub gyro_bias_rad_s: [f64; 3],
    /// Bias of the specific force, constant, m/s2.
    pub accelerometer_bias_m_s2: [f64; 3],
}

impl AttitudeAsBuilt {
    pub(super) fn draw(spec: &VehicleMotionSpec, seed: u64) -> Self {
        let normal = |what: &str, std: f64| normal_vector(seed, what, std).into();
        Self {
            misalignment_rad: normal("attitude/misalignment", spec.attitude_misalignment_std_rad),
            gyro_bias_rad_s: normal("attitude/gyro", spec.gyro_bias_std_rad_s),
            accelerometer_bias_m_s2: normal("attitude/accelerometer", spec.accelerometer_bias_std_m_s2),
        }
    }

    /// Returns true if the sensor is exact, as in the standard world.
    pub(super) fn is_exact(&self) -> bool {
        *self == Self::default()
    }
}
