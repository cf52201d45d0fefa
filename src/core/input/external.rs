//! Reader of recordings of other systems, by an input map.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::error::InputError;
use super::joints::{JointReader, Reading, n_needed};
use super::map::{InputMap, Source, TagUse, Topics};
use super::table::read_table;
use super::tags::{TagFrame, TagReader};
use crate::log::{ChunkOrder, Completeness, RawMessage, for_each_raw};
use crate::robot::Robot;

/// Joint readings and detections of a recording of a real arm.
#[derive(Clone, Debug, Default)]
pub struct ExternalRecording {
    /// The recording's file, as given.
    pub path: PathBuf,
    /// In the order of their stamps.
    pub readings: Vec<Reading>,
    /// In the order of their stamps; each has a tag.
    pub frames: Vec<TagFrame>,
    /// Joints of the robot that no reading has, by index; none of them moves the camera.
    pub absent_joints: Vec<usize>,
    /// Recorded joints that the robot lacks.
    pub extra_joints: Vec<String>,
    /// Number of unused messages by reason.
    pub left_out: BTreeMap<String, u64>,
    /// Whether the file could be read to its end.
    pub completeness: Completeness,
    /// What was put right in the order of the file's chunks.
    pub chunk_order: ChunkOrder,
}

/// Readings, and images with tags, of one recording: 22 hours at 100 Hz, 1 GB. Whether the arm rested between two
/// images is seen from all readings between them, so that all are kept.
const MAX_MESSAGES: usize = 8_000_000;

/// Reads the joint readings and tags of a recording or of a table; joints are matched by name.
///
/// Joints distal to the camera may be absent, unless the robot has a tag on its gripper.
///
/// # Errors
/// [`InputError`], naming file, topic, message and field.
pub fn read_external(path: &Path, map: &InputMap, robot: &Robot) -> Result<ExternalRecording, InputError> {
    match &map.source {
        Source::Topics(topics) => read_up_to(MAX_MESSAGES, path, (map, topics), robot),
        Source::Table(layout) => read_table(path, map, layout, robot),
    }
}

fn read_up_to(
    most: usize,
    path: &Path,
    (map, wanted): (&InputMap, &Topics),
    robot: &Robot,
) -> Result<ExternalRecording, InputError> {
    let file = path.display().to_string();
    let mut topics: BTreeMap<String, String> = BTreeMap::new();
    let mut readings = JointReader::new(&file, map, &wanted.joints, robot);
    let mut tags = TagReader::new(&file, map, wanted.camera_frame.as_deref());
    let mut first_error = None;
    let summary = for_each_raw(path, |raw| {
        if !topics.contains_key(raw.topic()) {
            topics.insert(raw.topic().to_owned(), raw.schema_name().to_owned());
        }
        if first_error.is_some() {
            return;
        }
        let taken = if raw.topic() == wanted.joints {
            check_type(&file, raw, &["JointState"], "sensor_msgs/msg/JointState")
                .and_then(|()| readings.take(raw, digest(raw)))
        } else if raw.topic() == wanted.tags {
            check_tags(&file, raw, map).and_then(|()| tags.take(raw, digest(raw)))
        } else {
            Ok(())
        };
        let of_topics = [(&wanted.joints, readings.readings.len()), (&wanted.tags, tags.len())];
        first_error = taken.err().or_else(|| too_long(&file, of_topics, most));
    })?;
    if let Some(error) = first_error {
        return Err(error);
    }
    if let Some(topic) = [&wanted.joints, &wanted.tags].into_iter().find(|topic| !topics.contains_key(*topic)) {
        let found = topics.into_keys().collect();
        return Err(InputError::NoTopic { file, topic: topic.clone(), found });
    }
    if readings.readings.is_empty() {
        return Err(readings.no_reading());
    }
    for (topic, order) in [(&wanted.joints, &readings.order), (&wanted.tags, &tags.order)] {
        if let Some(disorder) = order.first_regression() {
            return Err(InputError::Disorder { file: file.clone(), topic: topic.clone(), disorder });
        }
    }
    if tags.len() == 0 {
        let (topic, problem) = (wanted.tags.clone(), tags.problem());
        return Err(InputError::NoTags { file: file.clone(), topic, problem });
    }
    let absent_joints = (n_needed(robot)..robot.n_joints()).filter(|joint| !readings.present.contains(joint)).collect();
    let extra_joints = readings.extra();
    let (mut sorted, mut left_out) = (readings.readings, readings.left_out);
    sorted.sort_by_key(|reading| reading.stamp);
    let (frames, of_tags) = tags.finish();
    left_out.extend(of_tags);
    Ok(ExternalRecording {
        path: path.to_owned(),
        readings: sorted,
        frames,
        absent_joints,
        extra_joints,
        left_out,
        completeness: summary.completeness,
        chunk_order: summary.chunk_order,
    })
}

/// The error for the first topic with more messages in memory than `most`.
fn too_long(file: &str, of_topics: [(&String, usize); 2], most: usize) -> Option<InputError> {
    let (topic, _) = of_topics.into_iter().find(|(_, n)| *n > most)?;
    Some(InputError::TooLong { file: file.to_owned(), topic: topic.clone(), most })
}

/// Hash of topic, log time and bytes.
fn digest(raw: &RawMessage<'_>) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&(raw.topic().len() as u64).to_le_bytes());
    hasher.update(raw.topic().as_bytes());
    hasher.update(&raw.log_time_nanos.to_le_bytes());
    hasher.update(raw.data);
    *hasher.finalize().as_bytes()
}

/// ROS writes package/msg/Type; some converters leave out the middle.
fn check_type(file: &str, raw: &RawMessage<'_>, types: &[&str], expected: &'static str) -> Result<(), InputError> {
    let (file, topic) = (|| file.to_owned(), || raw.topic().to_owned());
    if raw.channel.message_encoding != "cdr" {
        let found = raw.channel.message_encoding.clone();
        return Err(InputError::Encoding { file: file(), topic: topic(), found });
    }
    match raw.schema_name().rsplit('/').next() {
        Some(name) if types.contains(&name) => Ok(()),
        _ => Err(InputError::Type { file: file(), topic: topic(), found: raw.schema_name().to_owned(), expected }),
    }
}

fn check_tags(file: &str, raw: &RawMessage<'_>, map: &InputMap) -> Result<(), InputError> {
    const EXPECTED: &str = "tf2_msgs/msg/TFMessage or apriltag_msgs/msg/AprilTagDetectionArray";
    check_type(file, raw, &["TFMessage", "AprilTagDetectionArray"], EXPECTED)?;
    let is_transform = raw.schema_name().ends_with("/TFMessage");
    let (held, allowed) = match (is_transform, map.tag_use) {
        (true, TagUse::Corners) => ("transforms, which have no corners", "\"position\" or \"pose\""),
        (false, TagUse::Position | TagUse::Pose) => ("corners in the image", "\"corners\""),
        _ => return Ok(()),
    };
    Err(InputError::Use { file: file.to_owned(), topic: raw.topic().to_owned(), held, allowed })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::read_input_map;
    use crate::log::ros::JointState;
    use crate::log::{RecordingHeader, RecordingWriter, RosMessage};
    use crate::time::SIMULATION_EPOCH;

    #[test]
    fn more_readings_than_memory_is_meant_for_are_refused() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let robot = crate::robot::load(&root.join("robots/titan4")).unwrap();
        let map = read_input_map(&root.join("fuzz/corpus/input_map/positions.toml")).unwrap();
        let Source::Topics(topics) = &map.source else { panic!("topics") };
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("long.mcap");
        let mut writer = RecordingWriter::create(&path, RecordingHeader::new(robot.joint_names())).unwrap();
        for n in 0..12 {
            let recorded = |joint: &String| map.joint_names.get(joint).unwrap_or(joint).clone();
            let name: Vec<String> = robot.joint_names().iter().map(recorded).collect();
            let joints = JointState { position: vec![1.0; name.len()], name, ..JointState::default() };
            let at = SIMULATION_EPOCH.plus_s(f64::from(n));
            writer.write_ros(&topics.joints, &JointState::SCHEMA, at, &joints).unwrap();
        }
        writer.finish().unwrap();
        let problem = |most| read_up_to(most, &path, (&map, topics), &robot).unwrap_err();
        assert!(matches!(problem(11), InputError::TooLong { most: 11, topic, .. } if topic == topics.joints));
        assert!(matches!(problem(12), InputError::NoTopic { .. }));
    }
}
