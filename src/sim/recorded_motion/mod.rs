//! Motion of a vehicle from a recording: poses over time, twice differentiable.
//!
//! A cubic spline interpolates positions and quaternions; quaternions are normalised on evaluation, without a singular
//! attitude. Velocity and acceleration are its exact derivatives. The world starts at the first sample with its
//! velocity. Towards the end the recording slows down, and the vehicle stops at the last sample.

mod kinematics;
mod motion;
mod spline;
mod table;

pub use kinematics::VehicleKinematics;
pub use motion::RecordedMotion;

#[cfg(test)]
mod tests;
