//! Common start of the simulator's tests.

use armcal_core::robot::{JointSensorSpec, SensorKind};

/// Returns a potentiometer of joint `j` without errors, for tests: zero counts at zero, 16 bits.
pub(crate) fn exact_sensor(counts_per_rad: f64, max_rate_rad_s: f64) -> JointSensorSpec {
    JointSensorSpec {
        joint: "j".into(),
        moves: Default::default(),
        kind: SensorKind::Potentiometer,
        offset_counts: 0.0,
        counts_per_rad,
        wrap_counts: 65536.0,
        center_rad: 0.0,
        half_range_rad: 2.0,
        gain_std: 0.0,
        offset_std_rad: 0.0,
        gain_bound: 0.0,
        offset_bound_rad: 0.0,
        noise_std_counts: 0.0,
        linearity_std_rad: 0.0,
        temperature_std_rad_per_k: 0.0,
        drift_std_rad_per_sqrt_h: 0.0,
        max_rate_rad_s,
        stated: None,
    }
}
