//! The NOMINAL arm: what drawings, datasheets and surveys say, never what was built.
//!
//! `load` reads a robot folder (robot.toml and its URDF) into checked types; `Vehicle` and `Shape` are the drawings of
//! what stands around the arm, meshes as convex hulls. Everything here is known before the dive. As-built values live under `sim`, estimates
//! under `calib`.

mod camera;
mod drive;
mod error;
mod failed;
mod file;
mod gripper;
mod gripper_tag;
mod hull;
mod lamp;
mod mesh;
mod part;
mod self_collision;
mod shape;
mod survey;
mod urdf;
mod vehicle;

pub use drive::{DriveSpec, MotionSpec};
pub use error::{FileIssue, RobotError};
pub use error::{parse_toml, read_text};
pub use failed::{FailedJoint, FailedKind};
pub use file::{CameraSpec, JointSensorSpec, Robot, SensorKind, ToolSpec, load, load_without_pairs};
pub use gripper::{GripperSpec, Jaw};
pub use gripper_tag::GripperTag;
pub use hull::{Hull, HullError, MAX_HULL_POINTS};
pub use lamp::VehicleLight;
pub use part::{MAX_PARTS, Part};
pub use part::{PartFile, check_parts};
pub use self_collision::{SELF_COLLISION_FILE, SelfPair, SelfPairs};
pub use shape::{PlacedShape, Shape, parry_pose};
pub use survey::{BaseTagStd, MapKnowledge, SurveyedTag, TagSurvey};
pub use urdf::{LinkBody, MAX_COLLISION_SHAPES, UrdfModel};
pub use vehicle::{StationKeeping, Vehicle, VehicleDynamics, load_vehicle};
