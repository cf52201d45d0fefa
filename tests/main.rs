//! Integration tests: one binary, for each further one would link the viewer's SDK again.
//!
//! `oracle` compares with tools that share no code with ours, `golden` with figures that others published; `property` holds
//! for any input; `recovery` puts known errors in and gets them back; `wall` proves what belief does not know;
//! `determinism`, `closed_loop` and `cli` run the program; `sim` looks at the simulated world from outside.

mod cli;
mod closed_loop;
mod determinism;
mod golden;
mod oracle;
mod property;
mod recovery;
mod sim;
mod support;
mod wall;
