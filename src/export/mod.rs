//! A calibration in the forms that drivers and other programs read.
//!
//! `urdf` writes link corrections and the camera's mount into the robot's drawing (`urdf_text` edits its text);
//! `ros2_control` and `parameters` carry the joints' sensors; `table` is counts to radians; `rows` is one line a joint;
//! `kalibr` and `tagslam` are the camera and the tags as those programs read them; `link_poses` the links of
//! manufacturers' files, read as well; `lerobot` the homing offsets of hobby motors.
//!
//! Convention: the joints of an exported URDF are at calibrated angles, with the drawing's zeros and limits. Gain,
//! offset and terms of a sensor are applied once, where counts become radians.

mod kalibr;
mod lerobot;
mod link_poses;
mod parameters;
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
pub use ros2_control::{joints_with_terms, ros2_control, ros2_control_offsets};
pub use rows::csv_rows;
pub use table::{MAX_POINTS, MIN_POINTS, SensorTable};
pub use tagslam::tagslam_map;
pub use urdf::{CalibratedUrdf, calibrated_urdf};
