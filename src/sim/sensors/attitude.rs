//! The vehicle's attitude sensor: orientation, rates and specific force with white noise.

use nalgebra::{UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::sim::spec::VehicleMotionSpec;
use crate::sim::vehicle::BaseState;
use crate::stats::stream_rng;
use crate::streams::Attitude;
use crate::time::Stamp;

#[derive(Clone, Debug)]
pub(in crate::sim) struct AttitudeSensor {
    spec: VehicleMotionSpec,
    rng: ChaCha8Rng,
}

impl AttitudeSensor {
    pub(in crate::sim) fn new(spec: &VehicleMotionSpec, seed: u64) -> Self {
        Self { spec: *spec, rng: stream_rng(seed, "attitude") }
    }

    pub(in crate::sim) fn sample(&mut self, state: &BaseState, stamp: Stamp) -> Attitude {
        let spec = self.spec;
        let turn = UnitQuaternion::from_scaled_axis(self.noise(spec.attitude_noise_rad));
        let q = state.world_from_vehicle.rotation() * turn;
        Attitude {
            stamp,
            quaternion_wxyz: [q.w, q.i, q.j, q.k],
            angular_velocity_rad_s: (state.vehicle_rate + self.noise(spec.gyro_noise_rad_s)).into(),
            specific_force_m_s2: (state.vehicle_specific_force + self.noise(spec.accelerometer_noise_m_s2)).into(),
        }
    }

    fn noise(&mut self, std: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| std * Distribution::<f64>::sample(&StandardNormal, &mut self.rng))
    }
}
