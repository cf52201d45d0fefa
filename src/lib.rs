//! Calibrates the joint sensors of hydraulic arms in place, with the wrist camera and a few AprilTags.
//!
//! Layers, imports go down only: `cli` > `campaign` > `run` > `score`, `report`, `replay` > belief (`calib`, `plan`,
//! `verify`, `session`) and truth (`sim`), which do not know each other > `streams`, `log`, `routine`, `input` > `robot`, `sensor`,
//! `kinematics`, `optics` > `joints`, `spatial`, `stats`, `time`. docs/architecture.md has the map and the invariants.
#![forbid(unsafe_code)]

pub mod calib;
#[cfg(feature = "sim")]
pub mod campaign;
pub mod cli;
#[cfg(feature = "detect")]
pub mod detect;
pub mod input;
pub mod joints;
pub mod kinematics;
pub mod log;
pub mod optics;
pub mod output;
pub mod plan;
#[cfg(feature = "viewer")]
pub mod replay;
pub mod report;
pub mod robot;
pub mod routine;
#[cfg(feature = "sim")]
pub mod run;
#[cfg(feature = "sim")]
pub mod score;
pub mod sensor;
pub mod session;
#[cfg(feature = "sim")]
pub mod sim;
pub mod spatial;
pub mod stats;
pub mod streams;
#[cfg(feature = "sim")]
pub mod study;
pub mod tagmap;
pub mod time;
pub mod verify;
