//! Integration tests in one binary, because each further one would link the viewer's SDK again. Only `tests/live` is
//! separate: it needs a build with live arms, for which this one would have to be built again.
//!
//! `oracle` compares with tools that share no code with ours, `golden` with published figures; `property` holds for any
//! input. `recovery` applies known errors and estimates them, `gripper_tag` with a tag that relates tool to camera,
//! `map` with unsurveyed tags, `methods` by the paper's other methods. `detections` adds wrong detections, `failed`
//! sensors that fail. `geometry` has arms that differ from their URDF, `eye_to_hand` a stationary camera, `slides`
//! joints that slide. `wall` proves that the estimator has no access to the truth; `vehicles` puts every arm on every
//! vehicle; `bumps` has obstacles in no description. `planning` reads plans and tests them with random arms.
//! `determinism`, `closed_loop`, `script` and `cli` run the program, `kill` interrupts it; `sim` tests the simulated
//! world from outside. `uncalibrated` calibrates arms with poor datasheets. `real` reads recordings of real arms,
//! `board_corners` those of a chessboard, `bags` the same as SQLite files, `recorded_inputs` their slow sensors and
//! images. `messages` has messages that calibration cannot use directly, `streams` continuous recordings, `cameras`
//! arms with two cameras. `tagmap` maps tags in recordings that the test writes; `touch` touches surveyed plates with
//! the tool. `any_arm` makes robot folders for URDFs of all sorts, `urdf` for URDFs that are wrong in parts. `report`
//! reads report.html; `work` works on a dive, `watch` follows recordings that grow; `repository` reads sources and
//! pages.
//!
//! Ignored tests are a second tier: statistics over many seeds, routines and dives, of which the first tier has a small
//! sample. `cargo test --release -- --include-ignored` runs both.

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
