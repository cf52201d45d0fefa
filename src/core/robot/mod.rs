//! The nominal arm and vehicle: values of the URDF, datasheets and surveys.
//!
//! `load` reads a robot folder (robot.toml and its URDF) into a checked `Robot`; `load_vehicle` reads a `Vehicle`.
//! Shapes are convex, meshes are convex hulls. As-built values are in `sim`, estimates in `calib`.

mod allowed_pairs;
mod arm_chain;
mod body;
mod camera;
mod collada;
mod completeness;
mod decomposition;
mod described;
mod drive;
mod error;
mod failed;
mod file;
mod frame_tree;
pub mod geometry;
mod gripper;
mod gripper_tag;
mod hull;
mod joint_sensor;
mod light;
mod mesh;
mod new_folder;
mod nominal;
mod part;
mod self_collision;
mod self_pairs;
mod shape;
mod stated_angle;
mod survey;
mod toml_text;
mod triangles;
mod urdf;
mod urdf_file;
mod urdf_mesh;
mod vehicle;
mod xml_tree;

pub use allowed_pairs::AllowedPairs;
pub use body::{GRAVITY_M_S2, LinkBody};
pub use camera::{CameraSpec, LensPriors, MAX_FURTHER_CAMERAS};
pub use described::{Described, tag_frame_name};
pub use drive::{DriveSpec, MotionSpec};
pub use error::{FileIssue, RobotError, from_table, parse_toml, read_table, read_text, syntax_code, toml_problem};
pub use failed::{FailedJoint, FailedKind};
pub use file::{load, load_attached, load_without_pairs, robot_schema};
pub use frame_tree::{FixedFrame, FrameTree, MovingFrame};
pub use gripper::{GripperSpec, Jaw};
pub use gripper_tag::GripperTag;
pub use hull::{Hull, HullError, MAX_HULL_POINTS};
pub use joint_sensor::{JointSensorSpec, SensorKind, StatedAngle, likely_name};
pub use light::VehicleLight;
pub use new_folder::{DraftedMeshes, DraftedRobot, NewFile, NewRobot, draft_robot};
pub use nominal::{Robot, ToolSpec};
pub use part::{MAX_PARTS, Part, PartFile, check_parts};
pub use self_collision::{SELF_COLLISION_FILE, self_collision_schema};
pub use self_pairs::{SelfPair, SelfPairs};
pub use shape::{PlacedShape, Shape, parry_pose};
pub use survey::{BaseTagStd, MAX_TAGS, MapKnowledge, SurveyedTag, TagSurvey};
pub use urdf::MAX_COLLISION_SHAPES;
pub use vehicle::{StationKeeping, Vehicle, VehicleDynamics, load_vehicle, vehicle_schema};
