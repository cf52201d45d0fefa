//! Views that are ready to be fitted, wherever they come from.

use armcal_core::log::{Recording, hash_messages};
use armcal_core::robot::Robot;
use armcal_core::routine::Method;

use crate::views::scale_identification::IdentifiedScale;
use crate::views::view::CaptureData;

/// Which views the verdict rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeldOut {
    /// Those that the recording marks; the fit never sees them.
    AsMarked,
    /// All, each by what was learnt from the views of other folds; the answer is fitted to all.
    CrossValidation,
}

/// Views that are ready to be fitted, wherever they come from.
#[derive(Clone)]
pub struct CalibrationData {
    /// The recording or recordings, for messages.
    pub name: String,
    /// Of the messages that the views come from.
    pub messages_hash: String,
    /// Fitted and held-out views, task and end stops.
    pub data: CaptureData,
    /// The views that tell of the camera's mount, where they are others than `data`'s.
    pub gripper_tag_data: Option<CaptureData>,
    /// Which views the verdict rests on.
    pub held_out: HeldOut,
    /// With the tags that were around it, and the scales of `identified`.
    pub robot: Robot,
    /// Scales that were measured because nobody knew them; empty as a rule.
    pub identified: Vec<IdentifiedScale>,
}

/// What `method` has used of a recording, ascending.
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
