//! Integration tests: one binary, for each further one would link the viewer's SDK again.
//!
//! `oracle` compares with tools that share no code with ours, `golden` with figures that others published; `property` holds
//! for any input; `recovery` puts known errors in and gets them back, `gripper_tag` with a tag that ties tool to camera,
//! `map` with tags that nobody surveyed, `detections` with some that are wrong; `wall` proves what belief does not know;
//! `vehicles` puts every arm on every vehicle;
//! `determinism`, `closed_loop`, `script` and `cli` run the program, `kill` ends it badly; `sim` looks at the simulated
//! world from outside; `tagmap` maps tags in recordings that the test writes.

mod cli;
mod closed_loop;
mod detections;
mod determinism;
mod golden;
mod gripper_tag;
mod kill;
mod map;
mod oracle;
mod property;
mod recovery;
mod script;
mod sim;
mod support;
mod tagmap;
mod vehicles;
mod wall;
