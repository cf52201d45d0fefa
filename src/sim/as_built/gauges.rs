//! The slow sensors and the attitude sensor as built.

use nalgebra::Vector3;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::spec::WorldSpec;
use armcal_core::stats::stream_rng;

/// Constant errors of thermometers and depth gauge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GaugesAsBuilt {
    pub oil_bias_k: f64,
    pub water_bias_k: f64,
    pub pressure_bias_pa: f64,
    /// Relative.
    pub pressure_scale_error: f64,
}

/// Constant errors of the attitude sensor, in its own axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AttitudeAsBuilt {
    /// Rotation vector of the sensor's axes in the vehicle's.
    pub misalignment_rad: [f64; 3],
    /// At the start.
    pub gyro_bias_rad_s: [f64; 3],
    pub accelerometer_bias_m_s2: [f64; 3],
}

impl GaugesAsBuilt {
    pub(super) fn draw(spec: &WorldSpec, seed: u64) -> Self {
        let normal = |what: &str, std: f64| normal_vector(seed, what, std).x;
        Self {
            oil_bias_k: normal("thermometer/oil", spec.temperature.thermometer_bias_std_k),
            water_bias_k: normal("thermometer/water", spec.temperature.thermometer_bias_std_k),
            pressure_bias_pa: normal("pressure_bias", spec.water.pressure_bias_std_pa),
            pressure_scale_error: normal("pressure_scale", spec.water.pressure_scale_std),
        }
    }

    /// Whether they are exact, as the standard world's are.
    pub(super) fn is_exact(&self) -> bool {
        *self == Self::default()
    }
}

impl AttitudeAsBuilt {
    pub(super) fn draw(spec: &WorldSpec, seed: u64) -> Self {
        let normal = |what: &str, std: f64| normal_vector(seed, what, std).into();
        Self {
            misalignment_rad: normal("attitude/misalignment", spec.vehicle.attitude_misalignment_std_rad),
            gyro_bias_rad_s: normal("attitude/gyro", spec.vehicle.gyro_bias_std_rad_s),
            accelerometer_bias_m_s2: normal("attitude/accelerometer", spec.vehicle.accelerometer_bias_std_m_s2),
        }
    }

    /// Whether it is exact, as the standard world's is.
    pub(super) fn is_exact(&self) -> bool {
        *self == Self::default()
    }
}

fn normal_vector(seed: u64, what: &str, std: f64) -> Vector3<f64> {
    let mut rng = stream_rng(seed, &format!("as_built/{what}"));
    Vector3::from_fn(|_, _| std * Distribution::<f64>::sample(&StandardNormal, &mut rng))
}
