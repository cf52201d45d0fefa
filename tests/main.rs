//! Integration tests: one binary, for each further one would link the viewer's SDK again.
//!
//! `oracle` compares with tools that share no code with ours, `golden` with figures that others published; `property` holds
//! for any input; `recovery` puts known errors in and gets them back; `wall` proves what belief does not know;
//! `vehicles` puts every arm on every vehicle;
//! `determinism`, `closed_loop`, `script` and `cli` run the program, `kill` ends it badly; `sim` looks at the simulated
//! world from outside.

mod cli;
mod closed_loop;
mod determinism;
mod golden;
mod kill;
mod oracle;
mod property;
mod recovery;
mod script;
mod sim;
mod support;
mod vehicles;
mod wall;
