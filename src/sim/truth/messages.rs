//! Topics of truth.mcap and the messages that ROS has no type for.

use serde::{Deserialize, Serialize};

use armcal_core::log::ros::Header;
use armcal_core::log::{RosMessage, RosSchema};

/// The header as TOML (robot, vehicle, seed, as-built values, `[world]`), once at the start.
pub const WORLD: &str = "/truth/world";
/// True angles (rad), rates (rad/s) and torques of the oil columns (N m).
pub const JOINT_STATES: &str = "/truth/joint_states";
/// `base_from_tool`.
pub const TOOL_POSE: &str = "/truth/tool_pose";
/// `base_from_camera`.
pub const CAMERA_POSE: &str = "/truth/camera_pose";
/// `world_from_vehicle`.
pub const VEHICLE_POSE: &str = "/truth/vehicle_pose";
/// True oil temperature, degrees Celsius.
pub const OIL_TEMPERATURE: &str = "/truth/oil_temperature";
/// True water temperature, degrees Celsius.
pub const WATER_TEMPERATURE: &str = "/truth/water_temperature";
/// The nearest two watched parts and their distance.
pub const CLEARANCE: &str = "/truth/clearance";
/// Two parts when they begin to touch.
pub const CONTACTS: &str = "/truth/contacts";
/// A fault when it happens.
pub const FAULTS: &str = "/truth/faults";

/// armcal_msgs/msg/Contact: two parts began to touch.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Contact {
    /// Time of the contact; the frame is the base.
    pub header: Header,
    /// Name of a link or of something around the arm.
    pub part_a: String,
    /// The other part.
    pub part_b: String,
}

/// armcal_msgs/msg/Clearance: the nearest two parts and their distance.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Clearance {
    /// Time of the state; the frame is the base.
    pub header: Header,
    /// Not above 0 where they touch.
    pub distance_m: f64,
    /// Name of a link or of something around the arm.
    pub part_a: String,
    /// The other part.
    pub part_b: String,
}

/// armcal_msgs/msg/Fault: what broke, with `details` as the routine has them.
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
