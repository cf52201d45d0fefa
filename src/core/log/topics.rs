//! Topics of a recording, and what is on each.

/// Raw readings of the joint sensors, counts in `position`.
pub const JOINT_SENSORS: &str = "/joint_sensors";
/// Joint angles under the belief of the moment, rad.
pub const JOINT_STATES: &str = "/joint_states";
/// Set-points, counts.
pub const JOINT_COMMANDS: &str = "/joint_commands";
pub const DETECTIONS: &str = "/camera/wrist/detections";
/// Candidates that the detector rejected.
pub const REJECTS: &str = "/camera/wrist/rejects";
pub const IMAGES: &str = "/camera/wrist/image/compressed";
pub const OIL_TEMPERATURE: &str = "/temperature/oil";
pub const WATER_TEMPERATURE: &str = "/temperature/water";
pub const DEPTH_PRESSURE: &str = "/depth_pressure";
pub const VEHICLE_IMU: &str = "/vehicle/imu";
/// The gap between the jaws, m in `position`.
pub const GRIPPER_STATE: &str = "/gripper_state";
/// Set-point of the gap between the jaws, m in `position`.
pub const GRIPPER_COMMAND: &str = "/gripper_command";
pub const TASK: &str = "/task";
pub const TAG_SURVEY: &str = "/tag_survey";
/// The tool against surveyed surfaces.
pub const TOUCH: &str = "/touch";
pub const MARKS: &str = "/marks";
pub const LOG: &str = "/log";

/// The URDF as text, written once at the start.
pub const ROBOT_DESCRIPTION: &str = "/robot_description";
pub const CAMERA_INFO: &str = "/camera/wrist/camera_info";
pub const TF_STATIC: &str = "/tf_static";
pub const TF: &str = "/tf";

/// Topics for viewers; no message comes from them.
pub const VIEWER_TOPICS: [&str; 4] = [ROBOT_DESCRIPTION, CAMERA_INFO, TF_STATIC, TF];
