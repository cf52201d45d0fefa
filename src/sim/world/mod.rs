//! World of arm, vehicle, water and sensors in step.
//!
//! `setup` has the input and the initial values, `simulation` the parts and their step, `arm` the interface for a
//! session. `readings`, `images` and `jaws` make the messages, `idle` lets time pass, `faults` executes faults, and
//! `truth_output` writes the truth's stream. `from_routine` reads a routine's `[world]`.

mod arm;
mod faults;
mod from_routine;
mod idle;
mod images;
mod jaws;
mod readings;
mod setup;
mod simulation;
mod truth_output;

pub use setup::WorldInput;
pub use simulation::World;

#[cfg(test)]
mod tests;
