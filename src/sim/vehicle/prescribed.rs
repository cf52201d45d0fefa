//! Vehicle whose motion is prescribed: a swell or a recorded motion, and its response to impulses.

use std::sync::Arc;

use nalgebra::Vector3;

use crate::fault::Impulse;
use crate::recorded_motion::RecordedMotion;
use crate::spec::VehicleMotionSpec;
use crate::vehicle::base_state::BaseState;
use crate::vehicle::impulse_response::ImpulseResponse;
use crate::vehicle::swell::Swell;
use armcal_core::spatial::{Base, Pose, Vehicle};

/// Vehicle whose motion is prescribed.
#[derive(Clone, Debug)]
pub(crate) struct VehicleMotion {
    vehicle_from_base: Pose<Vehicle, Base>,
    path: Path,
    impulse_responses: Vec<ImpulseResponse>,
}

#[derive(Clone, Debug)]
enum Path {
    Swell(Box<Swell>),
    Recorded(Arc<RecordedMotion>),
}

impl VehicleMotion {
    /// Returns the prescribed motion that the world asks for: `recorded` if there is one. A free vehicle starts with
    /// its state at 0.
    pub(crate) fn new(
        spec: &VehicleMotionSpec,
        recorded: Option<&Arc<RecordedMotion>>,
        vehicle_from_base: Pose<Vehicle, Base>,
        seed: u64,
    ) -> Self {
        let path = match recorded {
            Some(motion) => Path::Recorded(Arc::clone(motion)),
            None => Path::Swell(Box::new(Swell::new(spec, seed))),
        };
        Self { vehicle_from_base, path, impulse_responses: Vec::new() }
    }

    /// Adds an impulse on the vehicle at `t_s`: it is deflected, and its pilot brings it back.
    pub(crate) fn impulse(&mut self, t_s: f64, impulse: &Impulse, mass_kg: f64, inertia_kg_m2: &Vector3<f64>) {
        let world_from_vehicle = self.at(t_s).world_from_vehicle.rotation();
        self.impulse_responses.push(ImpulseResponse::new(t_s, impulse, mass_kg, inertia_kg_m2, &world_from_vehicle));
    }

    /// Returns the state at `t_s` seconds after the start.
    pub(crate) fn at(&self, t_s: f64) -> BaseState {
        let mut jet = match &self.path {
            Path::Swell(swell) => swell.at(t_s),
            Path::Recorded(motion) => motion.at(t_s),
        };
        for impulse in &self.impulse_responses {
            impulse.add_to(&mut jet, t_s);
        }
        BaseState::of(&jet, &self.vehicle_from_base)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn swell() -> VehicleMotion {
        let spec = VehicleMotionSpec { rotation_rms_rad: 0.1, translation_rms_m: 0.3, ..VehicleMotionSpec::default() };
        let mount = Pose::from_position_rpy([1.7, -0.6, 0.1], [0.1, 0.2, -0.4]);
        VehicleMotion::new(&spec, None, mount, 3)
    }

    fn swell_with_impulse() -> VehicleMotion {
        let mut motion = swell();
        let impulse = Impulse { impulse_n_s: [900.0, -400.0, 100.0], angular_impulse_n_m_s: [200.0, 300.0, -500.0] };
        motion.impulse(16.0, &impulse, 4000.0, &Vector3::new(2000.0, 3000.0, 3500.0));
        motion
    }

    /// Central differences of the pose agree with the closed forms, during the swell, after it, and through an impulse.
    #[test]
    fn derivatives_agree_with_central_differences() {
        // Tolerance for the truncation of second differences at h = 1e-3 s for periods of 5 s, and for rounding,
        // 1e-16/h^2.
        const TOLERANCE: f64 = 2e-6;
        let h = 1e-3;
        for motion in [swell(), swell_with_impulse()] {
            for t in [1.3, 4.0, 17.0, 321.0] {
                let [before, now, after] = [t - h, t, t + h].map(|t| motion.at(t));
                let to_base = now.world_from_base.rotation().inverse();
                let [p0, p1, p2] = [before, now, after].map(|s| s.world_from_base.origin().vector());
                assert!((to_base * (p2 - p0) / (2.0 * h) - now.velocity).norm() < TOLERANCE);
                assert!((to_base * (p2 - p1 * 2.0 + p0) / (h * h) - now.acceleration).norm() < TOLERANCE);
                let turn = before.world_from_base.rotation().inverse() * after.world_from_base.rotation();
                assert!((turn.scaled_axis() / (2.0 * h) - now.angular_velocity).norm() < TOLERANCE);
                // The components' derivative in body axes is the angular acceleration.
                let slope = (after.angular_velocity - before.angular_velocity) / (2.0 * h);
                assert!((slope - now.angular_acceleration).norm() < TOLERANCE);
            }
        }
    }

    #[test]
    fn it_starts_at_rest_on_station() {
        let state = swell().at(0.0);
        assert!(state.velocity.norm() < 1e-12 && state.acceleration.norm() < 1e-12);
        assert!(state.world_from_vehicle.origin().vector().norm() < 1e-12);
    }

    /// The largest velocity is impulse over mass.
    #[test]
    fn an_impulse_moves_the_vehicle_as_its_impulse_says() {
        let spec = VehicleMotionSpec { rotation_rms_rad: 0.0, translation_rms_m: 0.0, ..VehicleMotionSpec::default() };
        let mut motion = VehicleMotion::new(&spec, None, Pose::identity(), 1);
        let impulse = Impulse { impulse_n_s: [800.0, 0.0, 0.0], angular_impulse_n_m_s: [0.0, 0.0, 100.0] };
        motion.impulse(2.0, &impulse, 4000.0, &Vector3::new(2000.0, 3000.0, 4000.0));
        let (mut fastest, mut spin): (f64, f64) = (0.0, 0.0);
        for i in 0..20_000 {
            let state = motion.at(f64::from(i) * 1e-3);
            fastest = fastest.max(state.velocity.norm());
            spin = spin.max(state.angular_velocity.norm());
        }
        assert!((fastest - 0.2).abs() < 1e-6 && (spin - 0.025).abs() < 1e-6, "{fastest} {spin}");
        assert!(motion.at(40.0).world_from_vehicle.origin().vector().norm() < 1e-6, "it comes back");
    }
}
