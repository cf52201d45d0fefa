//! Commands of `armcal-lab`: each measures one part, or the closed loop, against known truth, and writes tables into a
//! folder. `armcal-lab run` is `armcal run`: some studies start loops as processes of their own.

mod bound;
mod command_line;
mod detection;
mod dive;
mod dive_faults;
mod falsified;
mod paper;
mod planning;
mod poses;
mod sensitivity;
mod worlds;

pub(super) use command_line::main;
