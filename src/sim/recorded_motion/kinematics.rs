//! Pose, velocity and acceleration of a vehicle at one instant.

use nalgebra::{UnitQuaternion, Vector3};

/// Pose, velocity and acceleration of a vehicle at one instant.
#[derive(Clone, Copy, Debug)]
pub struct VehicleKinematics {
    /// Position of the vehicle's origin in the world, m.
    pub position: Vector3<f64>,
    /// Velocity, world axes, m/s.
    pub velocity: Vector3<f64>,
    /// Acceleration, world axes, m/s2.
    pub acceleration: Vector3<f64>,
    /// Rotation from vehicle axes to world axes.
    pub rotation: UnitQuaternion<f64>,
    /// Angular velocity in vehicle axes, rad/s.
    pub rate: Vector3<f64>,
    /// Angular acceleration in vehicle axes, rad/s2.
    pub angular_acceleration: Vector3<f64>,
}
