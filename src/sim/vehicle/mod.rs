//! How the vehicle moves that carries the arm.
//!
//! A `swell` of sinusoids or a recorded motion prescribe it: the arm feels it and does not push back. A `free` vehicle is a
//! body of its own, with thrusters that keep station against current, waves and the arm. [`BaseState`] is what either gives
//! to the arm's sensors; `sea` is how the water moves.

mod base_state;
mod free;
mod impulse_response;
mod prescribed;
mod sea;
mod sinusoids;
mod swell;

pub(crate) use base_state::{BaseState, GRAVITY_M_S2};
pub(crate) use free::FreeVehicle;
pub(crate) use prescribed::VehicleMotion;
pub(crate) use sea::{Sea, WaterMotion};
