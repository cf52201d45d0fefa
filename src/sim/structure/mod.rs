//! Compliance and loads of an arm: shafts that twist behind the joint sensors, the mount on the vehicle, a payload in
//! the gripper, a hose.
//!
//! A joint's shaft is a massless spring in series with its drive (`joint_shaft`): the equations of motion have the
//! link's angle, and the sensor reads the shaft's. The mount follows the arm's wrench (`mount`). A payload is part of
//! its link's body; a hose is a force on a link.

mod flexible_arm;
mod hose;
mod joint_shaft;
mod mount;
mod payload;

pub(crate) use flexible_arm::{ArmState, Balance, FlexibleArm};
pub(crate) use payload::payload;

#[cfg(test)]
mod tests;
