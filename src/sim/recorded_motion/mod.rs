//! A vehicle's motion from a recording: poses over time, made twice differentiable.
//!
//! A cubic spline runs through every sample's position and quaternion; the quaternion is normalised where it is read, so that no
//! attitude is special. Velocity and acceleration are the exact derivatives of what is read. The world starts at the first
//! sample, as fast as the recording is there; towards the end the recording plays slower and slower, and the vehicle
//! holds where the last sample has it.

mod kinematics;
mod motion;
mod spline;
mod table;

pub use kinematics::VehicleKinematics;
pub use motion::RecordedMotion;

#[cfg(test)]
mod tests;
