//! Integration tests: one binary, for each further one would link the viewer's SDK again. Only `tests/live` is another:
//! it needs a build with live arms, in which this one would have to be built again.
//!
//! `oracle` compares with tools that share no code with ours, `golden` with figures that others published; `property`
//! holds for any input; `recovery` puts known errors in and gets them back, `gripper_tag` with a tag that ties tool to
//! camera, `map` with tags that nobody surveyed, `methods` by the paper's other methods, `detections` with some that
//! are wrong, `failed` with sensors that fail, `geometry` with arms that differ from their URDF, `eye_to_hand` with a
//! camera that stands still, `slides` with joints that slide; `wall` proves what belief does not know; `vehicles` puts
//! every arm on every vehicle; `bumps` runs into things that nobody has drawn; `planning` reads plans and holds random
//! arms against them; `determinism`, `closed_loop`, `script` and `cli` run the program, `kill` ends it badly; `sim`
//! looks at the simulated world from outside; `uncalibrated` calibrates arms of which little is known; `real` reads
//! recordings of real arms, `board_corners` those of a chessboard, `bags` the same as SQLite files, `recorded_inputs`
//! their slow sensors and images, `messages` what
//! calibration cannot use as it is, `streams` those that were recorded all the time, `cameras` those of arms with two
//! cameras; `tagmap` maps tags in recordings that the test writes; `touch` feels surveyed plates with the tool;
//! `any_arm` makes robot folders for drawings of all sorts, `urdf` for URDFs that are wrong in parts; `report` reads
//! report.html; `work` works on a dive, `watch` follows recordings that grow; `repository` reads sources and pages.
//!
//! Tests that are ignored are a second tier: statistics over many seeds, routines and dives, of which the first tier
//! has a small member. `cargo test --release -- --include-ignored` runs both.

#![allow(clippy::print_stderr, reason = "figures of a test, for whoever reads its output")]

mod any_arm;
mod bags;
mod board_corners;
mod bumps;
mod cameras;
mod cases;
mod cli;
mod closed_loop;
mod codes;
mod detections;
mod determinism;
mod export;
mod eye_to_hand;
mod failed;
mod geometry;
mod golden;
mod gripper_tag;
mod kill;
mod map;
mod messages;
mod methods;
mod mutations;
mod online;
mod oracle;
mod planning;
mod pose_tables;
mod property;
mod real;
mod recorded_inputs;
mod recovery;
mod report;
mod repository;
mod script;
mod sim;
mod slides;
mod streams;
mod support;
mod tag_distances;
mod tagmap;
mod touch;
mod two_tables;
mod uncalibrated;
mod urdf;
mod vehicles;
mod wall;
mod watch;
mod work;
