//! Thermometers and depth gauge as built.

use serde::{Deserialize, Serialize};

use crate::as_built::normal::normal_vector;
use crate::spec::WorldSpec;

/// Constant errors of thermometers and depth gauge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GaugesAsBuilt {
    /// Error added to the reading of the oil's thermometer.
    pub oil_bias_k: f64,
    /// Error added to the reading of the water's thermometer.
    pub water_bias_k: f64,
    /// Error added to the reading of the depth gauge.
    pub pressure_bias_pa: f64,
    /// Relative error of the depth gauge's scale.
    pub pressure_scale_error: f64,
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

    /// Returns true if the gauges are exact, as in the standard world.
    pub(super) fn is_exact(&self) -> bool {
        *self == Self::default()
    }
}
