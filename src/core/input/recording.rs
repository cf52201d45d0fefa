//! Output of the readers of external recordings.

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
    /// Joint readings in the order of their stamps.
    pub readings: Vec<Reading>,
    /// Frames of the first camera in the order of their stamps; each has a tag.
    pub frames: Vec<TagFrame>,
    /// Frames of each further camera of the robot; empty if the input map does not name it.
    pub further_frames: Vec<Vec<TagFrame>>,
    /// Readings of slow sensors, in the order of the file.
    pub conditions: Vec<ConditionReading>,
    /// Attitudes of the arm's carrier, in the order of their stamps.
    pub attitudes: Vec<AttitudeReading>,
    /// Joints of the robot that no reading has, by index; none of them moves the camera.
    pub absent_joints: Vec<usize>,
    /// Recorded joints that the robot lacks.
    pub extra_joints: Vec<String>,
    /// Evidence that the joints' numbers are in another unit than the input map states.
    pub unit_doubt: Option<String>,
    /// Sentence on clocks so different that most frames have no joint reading.
    pub clock_doubt: Option<String>,
    /// Sentences on data that were not read as the messages state.
    pub notes: Vec<String>,
    /// Number of rows of a table that were earlier than the row before; the rows were then sorted.
    pub rows_sorted: u64,
    /// Number of messages without usable data, by reason.
    pub skipped: BTreeMap<String, u64>,
    /// Number of unused messages by reason.
    pub left_out: BTreeMap<String, u64>,
    /// Completeness of the file: read to its end or not.
    pub completeness: Completeness,
    /// Corrections to the order of the file's chunks.
    pub chunk_order: ChunkOrder,
}
