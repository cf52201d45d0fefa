//! Topics of a recording and their content.

/// Raw readings of the joint sensors, counts in `position`.
pub const JOINT_SENSORS: &str = "/joint_sensors";
/// Joint angles under the estimate of the moment, rad.
pub const JOINT_STATES: &str = "/joint_states";
/// Set-points, counts.
pub const JOINT_COMMANDS: &str = "/joint_commands";
/// AprilTags of each image, `apriltag_msgs/msg/AprilTagDetectionArray`, raw pixels.
pub const DETECTIONS: &str = "/camera/wrist/detections";
/// Candidates that the detector rejected.
pub const REJECTS: &str = "/camera/wrist/rejects";
/// Images of the wrist camera as JPEG, `sensor_msgs/msg/CompressedImage`.
pub const IMAGES: &str = "/camera/wrist/image/compressed";
/// Oil temperature, `sensor_msgs/msg/Temperature`, degrees Celsius.
pub const OIL_TEMPERATURE: &str = "/temperature/oil";
/// Water temperature, `sensor_msgs/msg/Temperature`, degrees Celsius.
pub const WATER_TEMPERATURE: &str = "/temperature/water";
/// Absolute pressure at the depth sensor, `sensor_msgs/msg/FluidPressure`, Pa.
pub const DEPTH_PRESSURE: &str = "/depth_pressure";
/// Attitude, body rates and specific force of the vehicle, `sensor_msgs/msg/Imu`.
pub const VEHICLE_IMU: &str = "/vehicle/imu";
/// The gap between the jaws, m in `position`.
pub const GRIPPER_STATE: &str = "/gripper_state";
/// Set-point of the gap between the jaws, m in `position`.
pub const GRIPPER_COMMAND: &str = "/gripper_command";
/// Targets of the tool, `armcal_msgs/msg/ReachTask`, base frame.
pub const TASK: &str = "/task";
/// Surveyed tags, `armcal_msgs/msg/TagSurvey`, base frame.
pub const TAG_SURVEY: &str = "/tag_survey";
/// Contacts of the tool with surveyed surfaces.
pub const TOUCH: &str = "/touch";
/// Spans of the recording by kind, `armcal_msgs/msg/Mark`.
pub const MARKS: &str = "/marks";
/// Text for people, `rcl_interfaces/msg/Log`.
pub const LOG: &str = "/log";

/// The URDF as text with vehicle and tags, written once at the start.
pub const ROBOT_DESCRIPTION: &str = "/robot_description";
/// The nominal lens, written once at the start, `sensor_msgs/msg/CameraInfo`.
pub const CAMERA_INFO: &str = "/camera/wrist/camera_info";
/// Frames that are fixed relative to each other, written once at the start, `tf2_msgs/msg/TFMessage`.
pub const TF_STATIC: &str = "/tf_static";
/// Transforms, `tf2_msgs/msg/TFMessage`. Our recordings have the estimated arm, for viewers; recordings of other
/// systems are read.
pub const TF: &str = "/tf";

/// Tags, targets and meshes as solids, written once at the start, `foxglove_msgs/msg/SceneUpdate`.
pub const SCENE: &str = "/scene";
/// Tags found in an image, only with images, `foxglove_msgs/msg/ImageAnnotations`.
pub const IMAGE_MARKS: &str = "/camera/wrist/image/annotations";

/// Topics for viewers; they yield no messages.
pub const VIEWER_TOPICS: [&str; 6] = [ROBOT_DESCRIPTION, CAMERA_INFO, TF_STATIC, TF, SCENE, IMAGE_MARKS];
