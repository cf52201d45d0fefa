//! Topics of truth.mcap, and messages for which ROS has no type.

use serde::{Deserialize, Serialize};

use armcal_core::log::ros::Header;
use armcal_core::log::{RosMessage, RosSchema};

/// Header as TOML (robot, vehicle, seed, as-built values, `[world]`), once at the start.
pub const WORLD: &str = "/truth/world";
/// True angles (rad), rates (rad/s) and torques of the oil columns (N m).
pub const JOINT_STATES: &str = "/truth/joint_states";
/// Pose of the tool, `base_from_tool`.
pub const TOOL_POSE: &str = "/truth/tool_pose";
/// Pose of the camera, `base_from_camera`.
pub const CAMERA_POSE: &str = "/truth/camera_pose";
/// Pose of the vehicle, `world_from_vehicle`.
pub const VEHICLE_POSE: &str = "/truth/vehicle_pose";
/// True oil temperature, degrees Celsius.
pub const OIL_TEMPERATURE: &str = "/truth/oil_temperature";
/// True water temperature, degrees Celsius.
pub const WATER_TEMPERATURE: &str = "/truth/water_temperature";
/// Nearest two watched parts and their distance.
pub const CLEARANCE: &str = "/truth/clearance";
/// Two parts when they begin to touch.
pub const CONTACTS: &str = "/truth/contacts";
/// A fault when it happens.
pub const FAULTS: &str = "/truth/faults";

/// Message armcal_msgs/msg/Contact: two parts began to touch.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Contact {
    /// Time of the contact; the frame is the base.
    pub header: Header,
    /// Name of a link or of a part around the arm.
    pub part_a: String,
    /// Name of the other part.
    pub part_b: String,
}

/// Message armcal_msgs/msg/Clearance: the nearest two parts and their distance.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Clearance {
    /// Time of the state; the frame is the base.
    pub header: Header,
    /// Distance of the parts, at most 0 if they touch.
    pub distance_m: f64,
    /// Name of a link or of a part around the arm.
    pub part_a: String,
    /// Name of the other part.
    pub part_b: String,
}

/// Message armcal_msgs/msg/Fault: a fault, with `details` as in the routine.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FaultMessage {
    pub header: Header,
    pub kind: String,
    pub details: String,
}

macro_rules! with_header {
    ($fields:literal) => {
        concat!(
            "std_msgs/Header header\n",
            $fields,
            "================================================================================\n",
            "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n",
            "================================================================================\n",
            "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n",
        )
    };
}

impl RosMessage for Contact {
    const SCHEMA: RosSchema =
        RosSchema { name: "armcal_msgs/msg/Contact", text: with_header!("string part_a\nstring part_b\n") };
}

impl RosMessage for FaultMessage {
    const SCHEMA: RosSchema =
        RosSchema { name: "armcal_msgs/msg/Fault", text: with_header!("string kind\nstring details\n") };
}

impl RosMessage for Clearance {
    const SCHEMA: RosSchema = RosSchema {
        name: "armcal_msgs/msg/Clearance",
        text: with_header!("float64 distance_m\nstring part_a\nstring part_b\n"),
    };
}
