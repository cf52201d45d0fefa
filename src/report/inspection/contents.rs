//! Contents of a recording, its completeness, and what could be calibrated from it.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use crate::report::inspection::arm::is_capture;
use crate::report::inspection::observable_parameters::observable_parameters;
use crate::report::inspection::tracking_error::Motions;
use crate::report::inspection::{ArmContents, ObservableParameters, TopicContents, TrackingError, arm, topics};
use armcal_core::log::topics as log_topics;
use armcal_core::log::{Completeness, FileContents, LogError, ROS1_ADVICE, RawSummary, TopicMap, scan_recording};
use armcal_core::robot::Robot;
use armcal_core::streams::Message;

/// Description of one recording; field names have units, because programs read them too.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspection {
    pub version: u32,
    pub recording: String,
    pub bytes: u64,
    /// Profile of the MCAP file: `ros2`, `ros1`, empty or another.
    pub profile: String,
    /// Name of the program that wrote the file.
    pub library: String,
    pub completeness: CompletenessReport,
    /// Number of readable messages.
    pub messages: u64,
    /// Log time of the first and the last, nanoseconds since the Unix epoch; `None` without messages.
    pub time_nanos: Option<[u64; 2]>,
    pub duration_s: Option<f64>,
    /// Number of times that log time went backwards in the order of the file.
    pub non_monotonic: u64,
    /// Number of chunks stored after later ones; `chunk_copies` counts exact copies. Chunks are read in the order of
    /// time, copies once.
    pub chunks_moved: u64,
    pub chunk_copies: u64,
    /// Number of unusable messages on armcal's topics, by "topic: reason".
    pub rejected: BTreeMap<String, u64>,
    pub compression: Vec<Compression>,
    pub topics: Vec<TopicContents>,
    pub attachments: Vec<Attachment>,
    pub metadata: Vec<Metadata>,
    pub arm: ArmContents,
    /// Parameters that a robot's calibration could take from the recording; `None` where no robot was named.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub observable: Option<ObservableParameters>,
    /// Tracking error of the joints against their set-points; `None` where no robot was named or nothing was driven.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracking_error: Option<TrackingError>,
    /// Advice for the user: obstacles to a calibration, and possible next steps.
    pub hints: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CompletenessReport {
    pub state: State,
    /// The first damage or the cut, with its offset in the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    pub lost_chunks: u64,
    pub lost_bytes: u64,
    /// Number of lost messages; `None` where the file's own count is lost too.
    pub lost_messages: Option<u64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    Whole,
    Cut,
    Damaged,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Compression {
    /// Name of the compression: `zstd`, `lz4`, `none`.
    pub name: String,
    pub chunks: u64,
    pub compressed_bytes: u64,
    pub uncompressed_bytes: u64,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Attachment {
    pub name: String,
    pub media_type: String,
    pub bytes: u64,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Metadata {
    pub name: String,
    pub entries: BTreeMap<String, String>,
}

/// Inspects a recording.
///
/// # Errors
/// [`LogError`] when the file is no recording or cannot be read. Cuts and damage are no errors.
pub fn inspect(path: &Path, robot: Option<&Robot>) -> Result<Inspection, LogError> {
    let mut topics = topics::Collector::default();
    let mut arm = arm::Collector::default();
    let mut motions = Motions::default();
    let (recording, summary) = scan_recording(
        path,
        &TopicMap::default(),
        |raw| topics.take(raw),
        |_, message| {
            arm.take(message);
            if robot.is_some() {
                motions.take(message);
            }
            matches!(message, Message::Task(_)) || is_capture(message)
        },
    )?;
    let determined = robot.map(|robot| observable_parameters(path, robot, &recording)).transpose()?;
    let time_nanos = topics.time_nanos();
    // Readings of other joints say nothing about this robot.
    let tracked = robot.filter(|robot| robot.joint_names() == recording.joint_names);
    let arm = arm.finish(&recording);
    let mut topics = topics.finish();
    if arm.joint_readings == 0 {
        // Without raw readings, /joint_states is not armcal's own: every ROS arm has a topic of that name.
        topics.iter_mut().filter(|t| t.topic == log_topics::JOINT_STATES).for_each(|t| t.known_as = None);
    }
    if topics.iter().any(|t| t.topic == log_topics::SCENE) {
        // Every ROS arm has a topic /tf; it is armcal's own if the recording has another topic of armcal's.
        let known_as = Some("estimated arm, for viewers");
        topics.iter_mut().filter(|t| t.topic == log_topics::TF).for_each(|t| t.known_as = known_as);
    }
    let mut inspection = Inspection {
        version: 1,
        recording: path.display().to_string(),
        bytes: summary.contents.bytes,
        profile: summary.contents.profile.clone(),
        library: summary.contents.library.clone(),
        completeness: completeness(&summary),
        messages: summary.readable_messages,
        time_nanos,
        duration_s: time_nanos.map(|[first, last]| (last - first) as f64 * 1e-9),
        non_monotonic: recording.non_monotonic,
        chunks_moved: summary.chunk_order.moved,
        chunk_copies: summary.chunk_order.copies,
        rejected: recording.rejected.clone(),
        compression: compression(&summary.contents),
        topics,
        attachments: attachments(&summary.contents),
        metadata: metadata(&summary.contents),
        arm,
        observable: determined,
        tracking_error: tracked.and_then(|robot| motions.finish(robot)),
        hints: Vec::new(),
    };
    inspection.hints = hints(&inspection);
    Ok(inspection)
}

fn completeness(summary: &RawSummary) -> CompletenessReport {
    let whole =
        CompletenessReport { state: State::Whole, reason: None, lost_chunks: 0, lost_bytes: 0, lost_messages: Some(0) };
    match &summary.completeness {
        Completeness::Whole => whole,
        Completeness::Cut { reason, .. } => {
            CompletenessReport { state: State::Cut, reason: Some(reason.clone()), lost_messages: None, ..whole }
        }
        Completeness::Damaged { reason, lost_chunks, lost_bytes, lost_messages, .. } => CompletenessReport {
            state: State::Damaged,
            reason: Some(reason.clone()),
            lost_chunks: *lost_chunks,
            lost_bytes: *lost_bytes,
            lost_messages: *lost_messages,
        },
    }
}

fn compression(contents: &FileContents) -> Vec<Compression> {
    let one = |(name, totals): (&&str, &armcal_core::log::ChunkTotals)| Compression {
        name: if name.is_empty() { "none".to_owned() } else { (*name).to_owned() },
        chunks: totals.chunks,
        compressed_bytes: totals.compressed_bytes,
        uncompressed_bytes: totals.uncompressed_bytes,
    };
    contents.chunks.iter().map(one).collect()
}

fn attachments(contents: &FileContents) -> Vec<Attachment> {
    let one = |info: &armcal_core::log::AttachmentInfo| Attachment {
        name: info.name.clone(),
        media_type: info.media_type.clone(),
        bytes: info.bytes,
    };
    contents.attachments.iter().map(one).collect()
}

fn metadata(contents: &FileContents) -> Vec<Metadata> {
    contents.metadata.iter().map(|(name, entries)| Metadata { name: name.clone(), entries: entries.clone() }).collect()
}

/// Obstacles between the recording and a calibration, and possible remedies.
fn hints(inspection: &Inspection) -> Vec<String> {
    let mut hints = Vec::new();
    let mut hint = |text: &str| hints.push(text.to_owned());
    let arm = &inspection.arm;
    if inspection.messages == 0 {
        hint("no message is readable");
        return hints;
    }
    if inspection.topics.iter().any(|topic| topic.topic.starts_with("/truth/")) {
        hint("this is the truth of a simulation; calibrate the run.mcap in the same folder");
        return hints;
    }
    match inspection.completeness.state {
        State::Whole => {}
        State::Cut => hint("cut: all commands use the readable part; views captured before the cut are valid"),
        State::Damaged => hint("damaged: all commands use the readable chunks"),
    }
    if inspection.topics.iter().any(|topic| topic.encoding == "ros1") {
        hint(&format!(
            "armcal reads no ROS 1 messages; start from the ROS 1 bag (.bag) that it was made from: {ROS1_ADVICE}"
        ));
    }
    if arm.joint_readings == 0 {
        hint("no joint readings on /joint_sensors, the topic of raw counts for `armcal calibrate`");
    }
    if arm.detection_frames == 0 {
        hint("no tag detections on /camera/wrist/detections, the topic that `armcal calibrate` reads");
    }
    if arm.views_fit == 0 {
        hint("no captured views: no mark `capture_fit` on /marks says when the arm rested for a view");
    }
    for topic in &inspection.topics {
        if let Some(what) = topic.may_be.as_deref().filter(|_| topic.known_as.is_none()) {
            hint(&format!("{} may be {what}", topic.topic));
        }
        if let Some(what) = &topic.two_senders {
            hint(&format!("{} {what}", topic.topic));
        }
    }
    hints
}
