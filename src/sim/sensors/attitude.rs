//! The vehicle's attitude sensor: orientation, rates and specific force.
//!
//! All values are in the sensor's own axes, which have a constant misalignment against the vehicle's. The orientation
//! has noise, the rates have a random-walk bias and noise, the specific force has a bias and noise.

use nalgebra::{UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::as_built::AttitudeAsBuilt;
use crate::spec::VehicleMotionSpec;
use crate::vehicle::BaseState;
use armcal_core::stats::stream_rng;
use armcal_core::streams::Attitude;
use armcal_core::time::Stamp;

#[derive(Clone, Debug)]
pub(crate) struct AttitudeSensor {
    attitude_noise_rad: f64,
    gyro_noise_rad_s: f64,
    accelerometer_noise_m_s2: f64,
    gyro_drift_rad_s_per_sqrt_h: f64,
    vehicle_from_sensor: UnitQuaternion<f64>,
    gyro_bias: Vector3<f64>,
    accelerometer_bias: Vector3<f64>,
    /// Time of the last sample.
    last: Option<Stamp>,
    rng: ChaCha8Rng,
    drift: ChaCha8Rng,
}

impl AttitudeSensor {
    pub(crate) fn new(spec: &VehicleMotionSpec, built: &AttitudeAsBuilt, seed: u64) -> Self {
        Self {
            attitude_noise_rad: spec.attitude_noise_rad,
            gyro_noise_rad_s: spec.gyro_noise_rad_s,
            accelerometer_noise_m_s2: spec.accelerometer_noise_m_s2,
            gyro_drift_rad_s_per_sqrt_h: spec.gyro_drift_rad_s_per_sqrt_h,
            vehicle_from_sensor: UnitQuaternion::from_scaled_axis(Vector3::from(built.misalignment_rad)),
            gyro_bias: built.gyro_bias_rad_s.into(),
            accelerometer_bias: built.accelerometer_bias_m_s2.into(),
            last: None,
            rng: stream_rng(seed, "attitude"),
            drift: stream_rng(seed, "attitude/gyro_drift"),
        }
    }

    pub(crate) fn sample(&mut self, state: &BaseState, stamp: Stamp) -> Attitude {
        self.drift_until(stamp);
        let turn = UnitQuaternion::from_scaled_axis(normal(&mut self.rng, self.attitude_noise_rad));
        let q = state.world_from_vehicle.rotation() * self.vehicle_from_sensor * turn;
        let to_sensor = self.vehicle_from_sensor.inverse();
        let rate = to_sensor * state.vehicle_rate + self.gyro_bias;
        let force = to_sensor * state.vehicle_specific_force + self.accelerometer_bias;
        Attitude {
            stamp,
            quaternion_wxyz: [q.w, q.i, q.j, q.k],
            angular_velocity_rad_s: (rate + normal(&mut self.rng, self.gyro_noise_rad_s)).into(),
            specific_force_m_s2: (force + normal(&mut self.rng, self.accelerometer_noise_m_s2)).into(),
        }
    }

    fn drift_until(&mut self, stamp: Stamp) {
        let elapsed_s = self.last.map_or(0.0, |last| stamp.since_s(last).max(0.0));
        self.last = Some(stamp);
        if self.gyro_drift_rad_s_per_sqrt_h > 0.0 {
            let std = self.gyro_drift_rad_s_per_sqrt_h * (elapsed_s / 3600.0).sqrt();
            self.gyro_bias += normal(&mut self.drift, std);
        }
    }
}

fn normal(rng: &mut ChaCha8Rng, std: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| std * Distribution::<f64>::sample(&StandardNormal, rng))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::VehicleMotion;
    use armcal_core::spatial::Pose;
    use armcal_core::time::SIMULATION_EPOCH;

    fn silent() -> VehicleMotionSpec {
        VehicleMotionSpec {
            attitude_noise_rad: 0.0,
            gyro_noise_rad_s: 0.0,
            accelerometer_noise_m_s2: 0.0,
            ..VehicleMotionSpec::default()
        }
    }

    fn state(t_s: f64) -> BaseState {
        VehicleMotion::new(&silent(), None, Pose::identity(), 3).at(t_s)
    }

    #[test]
    fn a_turned_sensor_measures_in_its_own_axes() {
        let built = AttitudeAsBuilt {
            misalignment_rad: [0.0, 0.0, std::f64::consts::FRAC_PI_2],
            gyro_bias_rad_s: [1e-3, 0.0, 0.0],
            accelerometer_bias_m_s2: [0.0, 0.02, 0.0],
        };
        let state = state(20.0);
        let sample = AttitudeSensor::new(&silent(), &built, 1).sample(&state, SIMULATION_EPOCH);
        // Its x axis is the vehicle's y, its y the vehicle's -x.
        let (rate, force) = (state.vehicle_rate, state.vehicle_specific_force);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        close(sample.angular_velocity_rad_s[0], rate.y + 1e-3);
        close(sample.angular_velocity_rad_s[1], -rate.x);
        close(sample.specific_force_m_s2[0], force.y);
        close(sample.specific_force_m_s2[1], -force.x + 0.02);
        let [w, x, y, z] = sample.quaternion_wxyz;
        let turned = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        let axis = turned * Vector3::x();
        assert!((axis - state.world_from_vehicle.rotation() * Vector3::y()).norm() < 1e-12);
    }

    /// In a quarter of an hour, the walk reaches half of the hourly figure, at 20 Hz or in one stride.
    #[test]
    fn the_gyros_bias_walks_with_the_root_of_time() {
        let spec = VehicleMotionSpec { gyro_drift_rad_s_per_sqrt_h: 2e-4, ..silent() };
        let state = state(20.0);
        for n in [1, 90] {
            let mut squares = 0.0;
            for seed in 0..1000 {
                let mut sensor = AttitudeSensor::new(&spec, &AttitudeAsBuilt::default(), seed);
                let mut rate = [0.0; 3];
                for k in 0..=n {
                    let stamp = SIMULATION_EPOCH.plus_s(900.0 * f64::from(k) / f64::from(n));
                    rate = sensor.sample(&state, stamp).angular_velocity_rad_s;
                }
                squares += (Vector3::from(rate) - state.vehicle_rate).norm_squared();
            }
            // 3000 axes determine the variance to 2.6 %.
            let ratio = squares / 3000.0 / 1e-8;
            assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
        }
    }
}
