//! A joint sensor: true angle to raw counts.
//!
//! In stages: the play between joint and shaft; what the element makes of the shaft's angle, by its kind (`pot`,
//! `encoder`, `resolver`); a slip on the shaft; gears; and the word (`word`): the datasheet's scale, noise, the
//! converter's step, the wrap, and words that say nothing.

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
