//! A vehicle's pose, velocity and acceleration at one instant.

use nalgebra::{UnitQuaternion, Vector3};

/// Pose, velocity and acceleration of a vehicle at one instant.
#[derive(Clone, Copy, Debug)]
pub struct VehicleKinematics {
    /// Of the vehicle's origin in the world, m.
    pub position: Vector3<f64>,
    /// World axes, m/s.
    pub velocity: Vector3<f64>,
    /// World axes, m/s2.
    pub acceleration: Vector3<f64>,
    /// From vehicle axes to world axes.
    pub rotation: UnitQuaternion<f64>,
    /// Angular velocity in vehicle axes, rad/s.
    pub rate: Vector3<f64>,
    /// In vehicle axes, rad/s2.
    pub angular_acceleration: Vector3<f64>,
}
