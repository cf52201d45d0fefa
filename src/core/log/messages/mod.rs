//! The messages of a recording: one file per kind with its ROS types, their schema, encoder and decoder.
//!
//! Fields are in the order of the ROS definition. `to_ros` and `from_ros` convert between these types and `streams`;
//! every number that `from_ros` returns is finite. The table `message_codec::Stream` lists them by topic.

pub(super) mod attitude;
mod basic;
mod checks;
pub(super) mod detections;
mod foxglove;
pub(super) mod images;
mod isaac;
pub(super) mod joints;
pub(super) mod log_line;
pub(super) mod marks;
pub(super) mod pressure;
pub(super) mod rejects;
pub(super) mod survey;
pub(super) mod task;
pub(super) mod temperatures;
pub(super) mod touch;
mod viewers;

pub use attitude::Imu;
pub use basic::{Header, PixelPoint, Point, Pose, Quaternion, Time, Transform, Vector3};
pub use detections::{AprilTagDetection, AprilTagDetectionArray};
pub use foxglove::{
    Color, ImageAnnotations, NoneOfThem, PointsAnnotation, SceneEntity, SceneUpdate, SizedPrimitive, TextAnnotation,
    TextPrimitive, TriangleListPrimitive,
};
pub use images::{CompressedImage, Image};
pub use isaac::{IsaacDetection, IsaacDetectionArray, PoseWithCovarianceStamped, decode_detections};
pub use joints::JointState;
pub use log_line::Log;
pub use marks::Mark;
pub use pressure::FluidPressure;
pub use rejects::{DetectionReject, DetectionRejects};
pub use survey::{SurveyedTag, TagSurvey};
pub use task::ReachTask;
pub use temperatures::Temperature;
pub use touch::Touch;
pub use viewers::{CameraInfo, PoseStamped, RegionOfInterest, StringMessage, TfMessage, TransformStamped};
