//! How the vehicle moves that carries the arm.
//!
//! A `swell` of sinusoids or a recorded motion prescribe it: the arm feels it and does not push back. A `free` vehicle is a
//! body of its own, with thrusters that keep station against current, waves and the arm. [`BaseState`] is what either gives
//! to the arm's sensors; `sea` is how the water moves.

mod free;
mod sea;
mod swell;

use std::sync::Arc;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

pub(super) use super::recorded::VehicleKinematics;
pub(super) use free::FreeVehicle;
pub(super) use sea::{Sea, WaterMotion};

use super::dynamics::Motion;
use super::fault::Impulse;
use super::recorded::RecordedMotion;
use super::spec::VehicleMotionSpec;
use armcal_core::spatial::{Base, Pose, Vehicle, World};

/// Standard gravity, m/s2.
pub(super) const GRAVITY_M_S2: f64 = 9.806_65;

/// A vehicle whose motion is prescribed.
#[derive(Clone, Debug)]
pub(super) struct VehicleMotion {
    vehicle_from_base: Pose<Vehicle, Base>,
    path: Path,
    knocks: Vec<KnockResponse>,
}

#[derive(Clone, Debug)]
enum Path {
    Swell(Box<swell::Swell>),
    Recorded(Arc<RecordedMotion>),
}

/// The base frame's motion at one instant, in base axes unless named otherwise.
#[derive(Clone, Copy, Debug)]
pub(super) struct BaseState {
    pub world_from_vehicle: Pose<World, Vehicle>,
    pub world_from_base: Pose<World, Base>,
    /// Of the base's origin against the world, m/s.
    pub velocity: Vector3<f64>,
    /// Of the base's origin against the world, m/s2.
    pub acceleration: Vector3<f64>,
    /// rad/s.
    pub angular_velocity: Vector3<f64>,
    /// rad/s2.
    pub angular_acceleration: Vector3<f64>,
    /// m/s2.
    pub gravity: Vector3<f64>,
    /// Angular velocity in vehicle axes, rad/s.
    pub vehicle_rate: Vector3<f64>,
    /// Acceleration minus gravity at the vehicle's origin in vehicle axes, m/s2.
    pub vehicle_specific_force: Vector3<f64>,
}

impl VehicleMotion {
    /// The prescribed motion that the world asks for: `recorded` where there is one. A free vehicle starts where this is at 0.
    pub(super) fn new(
        spec: &VehicleMotionSpec,
        recorded: Option<&Arc<RecordedMotion>>,
        vehicle_from_base: Pose<Vehicle, Base>,
        seed: u64,
    ) -> Self {
        let path = match recorded {
            Some(motion) => Path::Recorded(Arc::clone(motion)),
            None => Path::Swell(Box::new(swell::Swell::new(spec, seed))),
        };
        Self { vehicle_from_base, path, knocks: Vec::new() }
    }

    /// Something hits the vehicle at `t_s`: it swings out and its pilot brings it back.
    pub(super) fn knock(&mut self, t_s: f64, knock: &Impulse, mass_kg: f64, inertia_kg_m2: &Vector3<f64>) {
        let world_from_vehicle = self.at(t_s).world_from_vehicle.rotation();
        self.knocks.push(KnockResponse::new(t_s, knock, mass_kg, inertia_kg_m2, &world_from_vehicle));
    }

    /// The state at `t_s` seconds after the start.
    pub(super) fn at(&self, t_s: f64) -> BaseState {
        let mut jet = match &self.path {
            Path::Swell(swell) => swell.at(t_s),
            Path::Recorded(motion) => motion.at(t_s),
        };
        for knock in &self.knocks {
            knock.add_to(&mut jet, t_s);
        }
        BaseState::of(&jet, &self.vehicle_from_base)
    }
}

impl BaseState {
    /// Rigid body: `a_base = a + alpha x r + w x (w x r)`, `v_base = v + w x r`, all in vehicle axes, then in base axes.
    pub(super) fn of(jet: &VehicleKinematics, vehicle_from_base: &Pose<Vehicle, Base>) -> Self {
        let mount = vehicle_from_base.isometry();
        let lever = mount.translation.vector;
        let to_vehicle = jet.rotation.inverse();
        let to_base = mount.rotation.inverse();
        let (rate, turn) = (jet.rate, jet.angular_acceleration);
        let velocity = to_vehicle * jet.velocity + rate.cross(&lever);
        let origin_acceleration = to_vehicle * jet.acceleration;
        let acceleration = origin_acceleration + turn.cross(&lever) + rate.cross(&rate.cross(&lever));
        let gravity = to_vehicle * Vector3::new(0.0, 0.0, -GRAVITY_M_S2);
        let world_from_vehicle =
            Pose::from_isometry(Isometry3::from_parts(Translation3::from(jet.position), jet.rotation));
        Self {
            world_from_vehicle,
            world_from_base: world_from_vehicle * *vehicle_from_base,
            velocity: to_base * velocity,
            acceleration: to_base * acceleration,
            angular_velocity: to_base * rate,
            angular_acceleration: to_base * turn,
            gravity: to_base * gravity,
            vehicle_rate: rate,
            vehicle_specific_force: origin_acceleration - gravity,
        }
    }

    /// Of a free base: its pose, its velocity and the rate of that, both about the base's origin in its axes.
    pub(super) fn of_free_base(
        world_from_base: &Isometry3<f64>,
        velocity: &Motion,
        rate_of_velocity: &Motion,
        vehicle_from_base: &Pose<Vehicle, Base>,
    ) -> Self {
        let mount = vehicle_from_base.isometry();
        let origin = mount.inverse().translation.vector;
        let (w, turn) = (velocity.angular, rate_of_velocity.angular);
        let classical = rate_of_velocity.linear + w.cross(&velocity.linear);
        let to_world = world_from_base.rotation;
        let world_from_vehicle = world_from_base * mount.inverse();
        let jet = VehicleKinematics {
            position: world_from_vehicle.translation.vector,
            velocity: to_world * velocity.at(&origin),
            acceleration: to_world * (classical + turn.cross(&origin) + w.cross(&w.cross(&origin))),
            rotation: world_from_vehicle.rotation,
            rate: mount.rotation * w,
            angular_acceleration: mount.rotation * turn,
        };
        Self::of(&jet, vehicle_from_base)
    }

    /// Velocity about the base's origin.
    pub(super) fn motion(&self) -> Motion {
        Motion::new(self.angular_velocity, self.velocity)
    }

    /// Spatial acceleration about the base's origin: that of the point there less `w x v`.
    pub(super) fn spatial_acceleration(&self) -> Motion {
        let linear = self.acceleration - self.angular_velocity.cross(&self.velocity);
        Motion::new(self.angular_acceleration, linear)
    }
}

/// How a vehicle with prescribed motion answers a knock: `x = c t2 exp(-t/T)`, whose fastest moment has the velocity that
/// the impulse gives to the vehicle alone. Assumed; a free vehicle answers by itself.
#[derive(Clone, Copy, Debug)]
struct KnockResponse {
    start_s: f64,
    /// World axes, m/s2.
    linear: Vector3<f64>,
    /// Vehicle axes, rad/s2.
    angular: Vector3<f64>,
}

/// Time constant of the pilot's answer, s.
const KNOCK_TIME_S: f64 = 1.5;

impl KnockResponse {
    fn new(
        start_s: f64,
        knock: &Impulse,
        mass_kg: f64,
        inertia_kg_m2: &Vector3<f64>,
        world_from_vehicle: &UnitQuaternion<f64>,
    ) -> Self {
        // The rate c (2 t - t2/T) exp(-t/T) is largest at t = (2 - sqrt 2) T.
        let u = 2.0 - std::f64::consts::SQRT_2;
        let largest = (2.0 * u - u * u) * (-u).exp() * KNOCK_TIME_S;
        Self {
            start_s,
            linear: world_from_vehicle * Vector3::from(knock.impulse_n_s) / mass_kg / largest,
            angular: Vector3::from(knock.angular_impulse_n_m_s).component_div(inertia_kg_m2) / largest,
        }
    }

    fn add_to(&self, jet: &mut VehicleKinematics, t_s: f64) {
        let t = t_s - self.start_s;
        if t <= 0.0 {
            return;
        }
        let (u, fade) = (t / KNOCK_TIME_S, (-t / KNOCK_TIME_S).exp());
        let shape = [t * t * fade, t * (2.0 - u) * fade, (2.0 - 4.0 * u + u * u) * fade];
        jet.position += self.linear * shape[0];
        jet.velocity += self.linear * shape[1];
        jet.acceleration += self.linear * shape[2];
        // `R exp(a s)`: the rate seen from the turned vehicle, and its derivative.
        let turn = UnitQuaternion::from_scaled_axis(self.angular * shape[0]);
        let (spin, seen) = (self.angular * shape[1], turn.inverse() * jet.rate);
        jet.rate = seen + spin;
        jet.angular_acceleration =
            turn.inverse() * jet.angular_acceleration + self.angular * shape[2] - spin.cross(&seen);
        jet.rotation *= turn;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(knock: bool) -> VehicleMotion {
        let spec = VehicleMotionSpec { rotation_rms_rad: 0.1, translation_rms_m: 0.3, ..VehicleMotionSpec::default() };
        let mount = Pose::from_position_rpy([1.7, -0.6, 0.1], [0.1, 0.2, -0.4]);
        let mut motion = VehicleMotion::new(&spec, None, mount, 3);
        if knock {
            let knock = Impulse { impulse_n_s: [900.0, -400.0, 100.0], angular_impulse_n_m_s: [200.0, 300.0, -500.0] };
            motion.knock(16.0, &knock, 4000.0, &Vector3::new(2000.0, 3000.0, 3500.0));
        }
        motion
    }

    /// Central differences of the pose against the closed forms, during the swell and after it, and through a knock.
    #[test]
    fn derivatives_agree_with_central_differences() {
        // Truncation of second differences at h = 1e-3 s for periods of 5 s, and rounding 1e-16/h^2.
        const TOLERANCE: f64 = 2e-6;
        let h = 1e-3;
        for motion in [motion(false), motion(true)] {
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
        let state = motion(false).at(0.0);
        assert!(state.velocity.norm() < 1e-12 && state.acceleration.norm() < 1e-12);
        assert!(state.world_from_vehicle.origin().vector().norm() < 1e-12);
    }

    /// The fastest moment has the velocity of impulse over mass.
    #[test]
    fn a_knock_moves_the_vehicle_as_its_impulse_says() {
        let spec = VehicleMotionSpec { rotation_rms_rad: 0.0, translation_rms_m: 0.0, ..VehicleMotionSpec::default() };
        let mut motion = VehicleMotion::new(&spec, None, Pose::identity(), 1);
        let knock = Impulse { impulse_n_s: [800.0, 0.0, 0.0], angular_impulse_n_m_s: [0.0, 0.0, 100.0] };
        motion.knock(2.0, &knock, 4000.0, &Vector3::new(2000.0, 3000.0, 4000.0));
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
