//! Motion of the arm's base at one instant.

use nalgebra::{Isometry3, Translation3, Vector3};

use crate::dynamics::{Environment, Motion};
use crate::recorded_motion::VehicleKinematics;
use crate::vehicle::sea::WaterMotion;
use armcal_core::robot::GRAVITY_M_S2;
use armcal_core::spatial::{Base, Pose, Vehicle, World};

/// Motion of the base frame at one instant, in base axes unless named otherwise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BaseState {
    pub world_from_vehicle: Pose<World, Vehicle>,
    pub world_from_base: Pose<World, Base>,
    /// Velocity of the base's origin against the world, m/s.
    pub velocity: Vector3<f64>,
    /// Acceleration of the base's origin against the world, m/s2.
    pub acceleration: Vector3<f64>,
    /// Angular velocity, rad/s.
    pub angular_velocity: Vector3<f64>,
    /// Angular acceleration, rad/s2.
    pub angular_acceleration: Vector3<f64>,
    /// Gravity, m/s2.
    pub gravity: Vector3<f64>,
    /// Angular velocity in vehicle axes, rad/s.
    pub vehicle_rate: Vector3<f64>,
    /// Acceleration minus gravity at the vehicle's origin in vehicle axes, m/s2.
    pub vehicle_specific_force: Vector3<f64>,
}

impl BaseState {
    /// Returns the surroundings of the arm on a base with prescribed motion, in `water` (world axes).
    pub(crate) fn environment(&self, water: &WaterMotion) -> Environment {
        let to_base = self.world_from_base.rotation().inverse();
        Environment {
            gravity: self.gravity,
            base_velocity: self.motion(),
            water_velocity: to_base * water.velocity,
            water_acceleration: to_base * water.acceleration,
        }
    }

    /// Returns the state of the base as a rigid body: `a_base = a + alpha x r + w x (w x r)`, `v_base = v + w x r`, all
    /// in vehicle axes, then in base axes.
    pub(crate) fn of(jet: &VehicleKinematics, vehicle_from_base: &Pose<Vehicle, Base>) -> Self {
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

    /// Returns the state of a free base from its pose, its velocity and the rate of that, both about the base's origin
    /// in its axes.
    pub(crate) fn of_free_base(
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

    /// Returns the velocity about the base's origin.
    pub(crate) fn motion(&self) -> Motion {
        Motion::new(self.angular_velocity, self.velocity)
    }

    /// Returns the spatial acceleration about the base's origin: that of the point there less `w x v`.
    pub(crate) fn spatial_acceleration(&self) -> Motion {
        let linear = self.acceleration - self.angular_velocity.cross(&self.velocity);
        Motion::new(self.angular_acceleration, linear)
    }
}
