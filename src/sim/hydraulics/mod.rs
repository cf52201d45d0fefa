//! Valves, pump and oil columns: from the controller's command to the load about each joint.
//!
//! A `valve`'s spool lags behind its command and opens beyond a deadband; the valves share one pump. Their oil moves
//! each `actuator`'s piston, which meets the joint through a column of oil that is a spring; a relief valve lets it
//! yield. `friction` holds the joint below its breakaway torque, and an `end_stop` at the ends of its range.

mod actuator;
mod actuator_input;
mod end_stop;
mod friction;
mod system;
mod valve;

pub(crate) use actuator_input::actuator_inputs;
pub(crate) use system::Hydraulics;

#[cfg(test)]
mod tests;
