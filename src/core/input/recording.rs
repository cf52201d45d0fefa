//! What the readers of external recordings hand on.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::attitude::AttitudeReading;
use super::conditions::ConditionReading;
use super::joints::Reading;
use super::tags::TagFrame;
use crate::log::{ChunkOrder, Completeness};

/// Joint readings and detections of a recording of a real arm.
#[derive(Clone, Debug, Default)]
pub struct ExternalRecording {
    /// The recording's file, as given.
    pub path: PathBuf,
    /// In the order of their stamps.
    pub readings: Vec<Reading>,
    /// What the first camera saw, in the order of their stamps; each has a tag.
    pub frames: Vec<TagFrame>,
    /// The same of each further camera of the robot; empty where the input map does not name it.
    pub further_frames: Vec<Vec<TagFrame>>,
    /// Readings of slow sensors, in the order of the file.
    pub conditions: Vec<ConditionReading>,
    /// Attitudes of what carries the arm, in the order of their stamps.
    pub attitudes: Vec<AttitudeReading>,
    /// Joints of the robot that no reading has, by index; none of them moves the camera.
    pub absent_joints: Vec<usize>,
    /// Recorded joints that the robot lacks.
    pub extra_joints: Vec<String>,
    /// What speaks for another unit of the joints' numbers than the input map says.
    pub unit_doubt: Option<String>,
    /// A sentence where clocks that differ keep most frames from a joint reading.
    pub clock_doubt: Option<String>,
    /// Sentences on what was read in another way than the messages say.
    pub notes: Vec<String>,
    /// Times that were earlier than the row before in a table, whose rows were sorted.
    pub rows_sorted: u64,
    /// Number of messages that hold no data of use, by reason.
    pub skipped: BTreeMap<String, u64>,
    /// Number of unused messages by reason.
    pub left_out: BTreeMap<String, u64>,
    /// Whether the file could be read to its end.
    pub completeness: Completeness,
    /// What was put right in the order of the file's chunks.
    pub chunk_order: ChunkOrder,
}
