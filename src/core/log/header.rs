//! Joint and frame names of a recording.

use crate::optics::TagFamily;

/// The frame of the arm's base in our recordings.
pub(super) const BASE_FRAME: &str = "base_link";

/// Names that all messages of a recording share. They are written into the messages, not next to them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingHeader {
    /// Names of the joints in the order of the chain, base first.
    pub joint_names: Vec<String>,
    /// `frame_id` of the task.
    pub base_frame: String,
    /// `frame_id` of the detections.
    pub camera_frame: String,
    /// `frame_id` of temperatures, pressure and attitude.
    pub vehicle_frame: String,
    /// AprilTag family of the detections.
    pub tag_family: String,
}

impl RecordingHeader {
    /// Builds the header of these joints, with frames `base_link`, `camera_wrist`, `vehicle` and tags of tag36h11.
    #[must_use]
    pub fn new(joint_names: Vec<String>) -> Self {
        Self {
            joint_names,
            base_frame: BASE_FRAME.into(),
            camera_frame: "camera_wrist".into(),
            vehicle_frame: "vehicle".into(),
            tag_family: TagFamily::default().long_name().into(),
        }
    }

    /// Returns the header with tags of another family.
    #[must_use]
    pub fn with_tags_of(mut self, family: TagFamily) -> Self {
        family.long_name().clone_into(&mut self.tag_family);
        self
    }
}
