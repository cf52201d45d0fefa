//! Views that are ready to be fitted, regardless of their source.

use armcal_core::log::{Recording, hash_messages};
use armcal_core::robot::Robot;
use armcal_core::routine::Method;

use crate::views::scale_identification::IdentifiedScale;
use crate::views::view::CaptureData;

/// Views that the verdict is based on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeldOut {
    /// Views that the recording marks; the fit never uses them.
    AsMarked,
    /// All views, each predicted from the views of the other folds; the final fit uses all.
    CrossValidation,
}

/// Views that are ready to be fitted, regardless of their source.
#[derive(Clone)]
pub struct CalibrationData {
    /// Names of the recordings, for messages.
    pub name: String,
    /// Hash of the messages that the views come from.
    pub messages_hash: String,
    /// Fitted and held-out views, task and end stops.
    pub data: CaptureData,
    /// Views that determine the camera mount, if they differ from `data`'s.
    pub gripper_tag_data: Option<CaptureData>,
    /// Views that the verdict is based on.
    pub held_out: HeldOut,
    /// Robot with the tags around it, and with the scales of `identified`.
    pub robot: Robot,
    /// Sensor scales that were measured because they were unknown; usually empty.
    pub identified: Vec<IdentifiedScale>,
}

/// Returns the indices of a recording's messages that `method` has used, ascending.
pub(crate) fn used_by(method: Method, used: &[usize], data: &CaptureData) -> Vec<usize> {
    let mut all = used.to_vec();
    if method == Method::Bundle {
        all.extend(&data.used_for_terms);
        all.sort_unstable();
        all.dedup();
    }
    all
}

pub(crate) fn hash_of(recording: &Recording, used: &[usize]) -> String {
    let messages = used.iter().map(|&idx| (recording.messages[idx].0, &recording.messages[idx].1));
    hash_messages(messages, &recording.joint_names).expect("what was read from a recording can be written to one")
}
