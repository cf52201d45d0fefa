//! The NOMINAL arm: what drawings, datasheets and surveys say, never what was built.
//!
//! `load` reads a robot folder (robot.toml and its URDF) into checked types; `Vehicle` and `Shape` are the drawings of
//! what stands around the arm. Everything here is known before the dive. As-built values live under `sim`, estimates
//! under `calib`.

mod error;
mod file;
mod shape;
mod urdf;
mod vehicle;

pub use error::{FileIssue, RobotError};
pub(crate) use error::{parse_toml, read_text};
pub use file::{CameraSpec, JointSensorSpec, Robot, SensorKind, SurveyedTag, ToolSpec, load};
pub use shape::{PlacedShape, Shape, parry_pose};
pub use urdf::{LinkBody, MAX_COLLISION_SHAPES, UrdfModel};
pub(crate) use vehicle::PartFile;
pub use vehicle::{Part, Vehicle, load_vehicle};
