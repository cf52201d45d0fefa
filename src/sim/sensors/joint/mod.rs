//! Joint sensor: from the true angle to raw counts.
//!
//! In stages: backlash between joint and shaft; the sensing element by its kind (`potentiometer`, `encoder`,
//! `resolver`); a slip on the shaft; gears; and the `quantizer`: nominal scale, noise, resolution, wrap, and the words
//! of a broken wire.

mod encoder;
mod joint_sensor;
mod potentiometer;
mod quantizer;
mod resolver;

pub(crate) use joint_sensor::{JointInput, JointSensor};

#[cfg(test)]
mod random_tests;
#[cfg(test)]
mod tests;
