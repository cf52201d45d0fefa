//! A calibration in file formats of drivers and other programs.
//!
//! `urdf` writes link corrections and the camera's mount into the nominal model (URDF); `urdf_text` edits its text.
//! `ros2_control` and `parameters` carry the joints' sensors; `table` converts counts to radians; `rows` has one line
//! per joint. `kalibr` and `tagslam` write camera and tags for those programs. `link_poses` writes, and reads, the
//! links of manufacturers' files; `lerobot` writes the homing offsets of hobby motors. `refused` marks a file of a
//! refused calibration.
//!
//! Convention: the joints of an exported URDF are at calibrated angles, with the nominal model's zeros and limits.
//! Gain, offset and terms of a sensor are applied once, where counts become radians.

mod kalibr;
mod lerobot;
mod link_poses;
mod parameters;
mod refused;
mod ros2_control;
mod rows;
mod table;
mod tagslam;
mod urdf;
mod urdf_text;
mod yaml_text;

pub use kalibr::camchain;
pub use lerobot::{LerobotHomings, lerobot_homings};
pub use link_poses::{CalibratedLinkPoses, LinkPoseForm, LinkPoses, calibrated_link_poses, parse_link_poses};
pub use parameters::ros_parameters;
pub use refused::{Comments, marked_as_refused};
pub use ros2_control::{joints_with_terms, ros2_control, ros2_control_offsets};
pub use rows::csv_rows;
pub use table::{MAX_POINTS, MIN_POINTS, SensorTable};
pub use tagslam::tagslam_map;
pub use urdf::{CalibratedUrdf, calibrated_urdf};
