//! Warnings on stderr about unusable data of a recording.

use armcal_core::codes::Code;
use std::path::Path;

use crate::cli::stdout::warn;
use armcal_core::input::ExternalRecording;
use armcal_core::log::{ChunkOrder, Completeness, Recording};
use armcal_core::robot::Robot;

pub(super) fn describe(completeness: &Completeness) -> String {
    match completeness {
        Completeness::Whole => "whole".to_owned(),
        Completeness::Cut { reason, readable_messages } => format!("cut: {reason}; {readable_messages} messages read"),
        Completeness::Damaged { reason, lost_bytes, readable_messages, .. } => {
            format!("damaged: {reason}; {lost_bytes} bytes lost, {readable_messages} messages read")
        }
    }
}

/// Warns about a recording's lost data; returns true if there is any.
pub(super) fn warn_of_losses(recording: &Recording) -> bool {
    let file = recording.path.display();
    let whole = recording.completeness == Completeness::Whole;
    if !whole {
        warn(
            Code::RecordingDamaged,
            format_args!("{file}: {}; what could be read is used", describe(&recording.completeness)),
        );
    }
    for (what, n) in &recording.rejected {
        warn(Code::MessagesRejected, format_args!("{file}: {n} messages rejected on {what}"));
    }
    warn_of_order(&recording.path, recording.chunk_order);
    if recording.non_monotonic > 0 {
        warn(Code::StampsDisordered, format_args!("{file}: log time went backwards {} times", recording.non_monotonic));
    }
    !whole || !recording.rejected.is_empty()
}

/// Warns about corrections to the order of a file's chunks.
fn warn_of_order(file: &Path, order: ChunkOrder) {
    let file = file.display();
    if order.moved > 0 {
        warn(Code::ChunksDisordered, format_args!("{file}: {} chunks are out of order; they were sorted", order.moved));
    }
    if order.copies > 0 {
        warn(
            Code::ChunksDisordered,
            format_args!("{file}: {} chunks are exact copies; they were skipped", order.copies),
        );
    }
}

/// Warns about the unused data of a real arm's recording; returns true if data was lost.
pub(super) fn warn_of_external(recording: &ExternalRecording, robot: &Robot) -> bool {
    let file = recording.path.display();
    let is_whole = recording.completeness == Completeness::Whole;
    if !is_whole {
        warn(
            Code::RecordingDamaged,
            format_args!("{file}: {}; what could be read is used", describe(&recording.completeness)),
        );
    }
    warn_of_order(&recording.path, recording.chunk_order);
    if let Some(doubt) = &recording.unit_doubt {
        warn(Code::InputUnitDoubtful, format_args!("{file}: {doubt}"));
    }
    for (what, n) in &recording.left_out {
        warn(Code::MessagesRejected, format_args!("{file}: {n} {what} left out"));
    }
    for (what, n) in &recording.skipped {
        warn(Code::MessagesRejected, format_args!("{file}: {n} {what} skipped"));
    }
    if recording.rows_sorted > 0 {
        let n = recording.rows_sorted;
        warn(
            Code::StampsDisordered,
            format_args!("{file}: {n} rows have earlier times than the row before; all were sorted"),
        );
    }
    for note in &recording.notes {
        warn(Code::StampsReplaced, format_args!("{file}: {note}"));
    }
    if !recording.extra_joints.is_empty() {
        let names = recording.extra_joints.join(", ");
        warn(Code::JointsIgnored, format_args!("{file}: joints that the robot lacks are ignored: {names}"));
    }
    for &joint in &recording.absent_joints {
        let name = &robot.sensors[joint].joint;
        let assumed = "it lies beyond the camera, and is assumed to stand mid-range";
        warn(Code::JointAssumed, format_args!("{file}: has no readings of {name}; {assumed}"));
    }
    !is_whole || !recording.left_out.is_empty()
}
