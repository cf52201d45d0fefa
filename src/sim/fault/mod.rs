//! Faults of the simulated arm: their kinds, their times, and their form in a routine.
//!
//! `kinds` has the faults, `list` reads their tables, `robot_check` checks them against a robot, `timeline` orders the
//! timed ones. `world::faults` carries them out.

mod impulse;
mod kinds;
mod list;
mod robot_check;
mod timeline;

pub(crate) use impulse::Impulse;
pub(crate) use kinds::LATEST_FAULT_S;
pub use kinds::{Fault, ScheduledFault};
pub(crate) use list::{list_key, read_list, read_one};
pub(crate) use robot_check::RobotCheck;
pub(crate) use timeline::Timeline;

#[cfg(test)]
mod tests;
