//! Calibration of joint sensors of hydraulic arms, in place, with the wrist camera and a few AprilTags.
//!
//! The arm captures views of tags on its own vehicle. From the raw joint readings and the tag corners, [`calibrate`]
//! estimates gain, offset and further terms of each joint sensor, with a covariance, a predicted tool error and a
//! verdict. [`PathPlanner`] plans paths that stay clear for every arm within the sensors' error bounds. [`session`]
//! carries out a whole routine on any [`Arm`]: reach, plan, capture, calibrate, reach again. The binary `armcal` is a
//! thin command line on top.
//!
//! # Layers
//!
//! Imports go down only.
//!
//! | layer | modules | job |
//! |---|---|---|
//! | belief | [`model`], [`calib`], [`tagmap`], [`plan`], [`verify`], [`session`] | estimates, plans, acts |
//! | meeting place | [`streams`], [`log`], [`routine`], [`input`] | messages, recordings, routines |
//! | arm | [`robot`], [`sensor`], [`kinematics`], [`optics`]; `detect` (`images`) | nominal arm; tags in images |
//! | base | [`joints`], [`spatial`], [`stats`], [`time`] | units and frames as types; random streams; stamps |
//!
//! Without the default features `images`, `sim` and `viewer`, the library is the estimator and the planner alone.
//!
//! # The wall between truth and belief
//!
//! The estimator reads recorded bytes only: messages that a real arm could have sent. The simulator writes the same
//! messages, and its truth into a file that no estimator opens. Belief and truth are crates that do not depend on each
//! other, so the compiler holds the wall.
//!
//! # Examples
//!
//! Position of the tool by forward kinematics of the nominal arm:
//!
//! ```
//! use std::path::Path;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let robot = armcal::load_robot(&Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/titan4"))?;
//! let base_from_tool = robot.chain.frame(&robot.stowed, &robot.tool.mount);
//! println!("stowed, the tool is at {:.3} m", base_from_tool.translation);
//! # Ok(())
//! # }
//! ```
//!
//! A calibration from a recording:
//!
//! ```
//! use std::path::Path;
//!
//! use armcal::{Method, calibrate, load_robot, read_recording};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let root = Path::new(env!("CARGO_MANIFEST_DIR"));
//! let robot = load_robot(&root.join("robots/titan4"))?;
//! let recording = read_recording(root.join("recordings/sample/run.mcap"))?;
//! let calibration = calibrate(&recording, &robot, Method::Bundle)?;
//! println!("{:?} {}", calibration.status, calibration.refusal.as_deref().unwrap_or_default());
//! for joint in &calibration.joint {
//!     println!("{}: offset {:.4} rad, std {:.4} rad", joint.name, joint.offset_rad, joint.offset_std_rad);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! More in `examples/`: an estimator in an application of your own (`embed_estimator`), paths for an arm of your own
//! (`certify_path`), and a driver for it (`own_arm`).
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub use armcal_belief::{judge, model, plan, say, session, tagmap, verify};
pub use armcal_core::{
    codes, input, joints, kinematics, log, optics, robot, routine, sensor, spatial, stats, streams, time,
};
#[cfg(feature = "images")]
pub use armcal_detect as detect;
#[cfg(feature = "sim")]
#[doc(hidden)]
pub use armcal_sim as sim;

pub use front::{CalibrateError, Calibrator, Measurements, PoseAtRest};

pub use armcal_belief::plan::{ClearanceModel, JointErrorBounds, PathError, PathPlanner, Timing};
pub use armcal_belief::session::{Outcome, Progress, Recorder, SessionError, SessionInputs, Unwatched};
pub use armcal_core::joints::{JointAngles, JointCounts};
pub use armcal_core::log::{Recording, RecordingHeader, RecordingWriter, read_recording};
pub use armcal_core::robot::{Robot, Vehicle, load as load_robot, load_vehicle};
pub use armcal_core::routine::{Method, Routine, load as load_routine};
pub use armcal_core::sensor::ArmSensors;
pub use armcal_core::streams::{Arm, ArmError, Message, Sink, SinkError};
pub use armcal_core::time::Stamp;
pub use calib::{CalibError, CalibratedArm, Calibration, Status, calibrate, interim_estimate};

pub mod calib;

// For the command line, the tests and the benches.
#[cfg(feature = "viewer")]
#[doc(hidden)]
pub use armcal_replay as replay;
#[cfg(feature = "sim")]
#[doc(hidden)]
pub mod campaign;
#[doc(hidden)]
pub mod cli;
#[doc(hidden)]
pub mod export;
pub mod front;
#[doc(hidden)]
pub mod output;
#[cfg(feature = "images")]
pub mod recorded_images;
#[doc(hidden)]
pub mod report;
#[cfg(feature = "closed-loop")]
#[doc(hidden)]
pub mod run;
#[doc(hidden)]
pub mod score;
