//! Motion of the vehicle that carries the arm.
//!
//! A `swell` of sinusoids or a recorded motion prescribes it (`prescribed`); the arm does not move the vehicle. A
//! `free` vehicle is a separate body, with thrusters for station keeping. [`BaseState`] has the motion of the arm's
//! base; `sea` has that of the water.

mod base_state;
mod free;
mod ground;
mod impulse_response;
mod prescribed;
mod sea;
mod sinusoids;
mod swell;

pub(crate) use base_state::BaseState;
pub(crate) use free::FreeVehicle;
pub(crate) use prescribed::VehicleMotion;
pub(crate) use sea::{Sea, WaterMotion};
