//! Calibrates the joint sensors of hydraulic arms in place, with the wrist camera and a few AprilTags.
//!
//! Layers, imports go down only: `cli` > `campaign` > `run` > `score`, `report`, `replay` > belief (`calib`, `plan`,
//! `verify`, `session`) and truth (`sim`), which do not know each other > `streams`, `log`, `routine`, `input` > `robot`, `sensor`,
//! `kinematics`, `optics` > `joints`, `spatial`, `stats`, `time`. docs/architecture.md has the map and the invariants.
#![forbid(unsafe_code)]

pub use armcal_belief::{calib, plan, session, tagmap, verify};
pub use armcal_core::{input, joints, kinematics, log, optics, robot, routine, sensor, spatial, stats, streams, time};
#[cfg(feature = "sim")]
pub use armcal_detect as detect;
#[cfg(feature = "viewer")]
pub use armcal_replay as replay;
#[cfg(feature = "sim")]
pub use armcal_sim as sim;
#[cfg(feature = "sim")]
pub use armcal_study as study;

#[cfg(feature = "sim")]
pub mod campaign;
pub mod cli;
pub mod output;
pub mod report;
#[cfg(feature = "sim")]
pub mod run;
pub mod score;
