//! Reader of recordings of other systems, by an input map.

use std::collections::BTreeSet;
use std::path::Path;

use super::attitude::AttitudeReader;
use super::clocks::{StreamTimes, compare_clocks};
use super::conditions::ConditionReader;
use super::error::InputError;
use super::images::ImageDetector;
use super::joint_unit::check_unit;
use super::joints::{JointReader, n_needed};
use super::map::{ConditionKind, FurtherTopic, InputMap, Source, StampSource, TagUse, Topics};
use super::message_type::check_type;
use super::recording::ExternalRecording;
use super::table::read_table;
use super::tags::TagReader;
use super::two_senders::check_senders;
use crate::log::ros::{
    AprilTagDetectionArray, CompressedImage, FluidPressure, Image, Imu, IsaacDetectionArray, JointState, Temperature,
    TfMessage,
};
use crate::log::{RawMessage, RosMessage, RosSchema, for_each_raw};
use crate::robot::Robot;

/// Maximum number of readings, and of images with tags, of one recording: 22 hours at 100 Hz, 1 GB. All readings are
/// kept, because those between two images show whether the arm rested.
const MAX_MESSAGES: usize = 8_000_000;

/// Reads the joint readings and tags of a recording or of a table; joints are matched by name.
///
/// Joints distal to the camera may be absent, unless the robot has a tag on its gripper.
///
/// # Errors
/// [`InputError`], naming file, topic, message and field; images are refused.
pub fn read_external(path: &Path, map: &InputMap, robot: &Robot) -> Result<ExternalRecording, InputError> {
    read_up_to(MAX_MESSAGES, path, map, (robot, None))
}

/// Reads a recording as [`read_external`] does, with a detector of tags in images.
///
/// # Errors
/// The errors of [`read_external`], and an error if images cannot be used.
pub fn read_external_images(
    path: &Path,
    map: &InputMap,
    robot: &Robot,
    detector: &mut dyn ImageDetector,
) -> Result<ExternalRecording, InputError> {
    read_up_to(MAX_MESSAGES, path, map, (robot, Some(detector)))
}

fn read_up_to<'a>(
    most: usize,
    path: &Path,
    map: &'a InputMap,
    (robot, detector): (&'a Robot, Option<&'a mut dyn ImageDetector>),
) -> Result<ExternalRecording, InputError> {
    let topics = match &map.source {
        Source::Topics(topics) => topics,
        Source::Table(layout) => return read_table(path, map, layout, robot),
    };
    let file = path.display().to_string();
    let mut reader = MessageReader {
        file: &file,
        map,
        topics,
        most,
        seen: BTreeSet::new(),
        joints: JointReader::new(&file, map, &topics.joints, robot),
        tags: TagReader::new(&file, map, topics),
        further: further_readers(&file, map, topics, robot),
        detector: detector.map(|detector| detector as &mut dyn ImageDetector),
        conditions: ConditionReader::new(&file, map, &topics.conditions),
        attitudes: AttitudeReader::new(&file, map, topics),
    };
    let mut first_error = None;
    let summary = for_each_raw(path, |raw| {
        if first_error.is_none() {
            first_error = reader.take(raw).err();
        }
    })?;
    if let Some(error) = first_error {
        return Err(error);
    }
    reader.check()?;
    let mut recording = reader.finish(robot);
    recording.path = path.to_owned();
    recording.unit_doubt = check_unit(&file, map, robot, &recording.readings)?;
    check_senders((&file, &topics.joints), map, robot, &recording)?;
    (recording.completeness, recording.chunk_order) = (summary.completeness, summary.chunk_order);
    Ok(recording)
}

/// Readers of the further cameras that both the map and the robot have.
fn further_readers<'a>(file: &'a str, map: &'a InputMap, topics: &'a Topics, robot: &Robot) -> Vec<TagReader<'a>> {
    let reader = |further: &'a FurtherTopic| {
        let camera = robot.cameras().skip(1).position(|camera| camera.name == further.camera)?;
        Some(TagReader::new(file, map, topics).of_further(camera + 1, further))
    };
    topics.further.iter().filter_map(reader).collect()
}

/// Reads all messages of a recording.
struct MessageReader<'a> {
    file: &'a str,
    map: &'a InputMap,
    topics: &'a Topics,
    /// Maximum number of messages of a topic that may stay in memory.
    most: usize,
    seen: BTreeSet<String>,
    joints: JointReader<'a>,
    tags: TagReader<'a>,
    /// Readers of the further cameras that the map names, in its order.
    further: Vec<TagReader<'a>>,
    /// Detector of tags in images; `None` if images are not searched.
    detector: Option<&'a mut dyn ImageDetector>,
    conditions: ConditionReader<'a>,
    attitudes: AttitudeReader<'a>,
}

impl MessageReader<'_> {
    fn take(&mut self, raw: &RawMessage<'_>) -> Result<(), InputError> {
        if !self.seen.contains(raw.topic()) {
            self.seen.insert(raw.topic().to_owned());
        }
        let n_kept = if raw.topic() == self.topics.joints {
            check_type(self.file, raw, &[JointState::SCHEMA])?;
            self.joints.take(raw, digest(raw))?;
            self.joints.readings.len()
        } else if self.cameras().any(|reader| reader.topic == raw.topic()) {
            check_tags(self.file, raw, self.map)?;
            let readers = std::iter::once(&mut self.tags).chain(&mut self.further);
            let mut most = 0;
            for reader in readers.filter(|reader| reader.topic == raw.topic()) {
                reader.take(raw, digest(raw), &mut self.detector)?;
                most = most.max(reader.len());
            }
            most
        } else if let Some(kind) = self.conditions.kind_of(raw.topic()) {
            match kind {
                ConditionKind::OilTemperature => check_type(self.file, raw, &[Temperature::SCHEMA])?,
                ConditionKind::Pressure => check_type(self.file, raw, &[FluidPressure::SCHEMA])?,
            }
            self.conditions.take(raw, kind, digest(raw))?;
            self.conditions.readings.len()
        } else if self.topics.conditions.attitude.as_deref() == Some(raw.topic()) {
            check_type(self.file, raw, &[Imu::SCHEMA])?;
            self.attitudes.take(raw, digest(raw))?;
            self.attitudes.readings.len()
        } else {
            0
        };
        if n_kept > self.most {
            let (file, topic) = (self.file.to_owned(), raw.topic().to_owned());
            return Err(InputError::TooLong { file, topic, most: self.most });
        }
        Ok(())
    }

    fn cameras(&self) -> impl Iterator<Item = &TagReader<'_>> {
        std::iter::once(&self.tags).chain(&self.further)
    }

    /// Checks that all required data are present, in the order of time.
    fn check(&self) -> Result<(), InputError> {
        let file = || self.file.to_owned();
        let conditions =
            self.topics.conditions.named().into_iter().map(|(topic, _)| topic).chain(&self.topics.conditions.attitude);
        let tags = self.cameras().map(|reader| reader.topic);
        let mut wanted = [self.topics.joints.as_str()].into_iter().chain(tags).chain(conditions.map(String::as_str));
        if let Some(topic) = wanted.find(|topic| !self.seen.contains(*topic)) {
            let found = self.seen.iter().cloned().collect();
            return Err(InputError::NoTopic { file: file(), topic: topic.to_owned(), found });
        }
        if self.joints.readings.is_empty() {
            return Err(self.joints.no_reading());
        }
        let of_tags = self.cameras().map(|reader| (reader.topic, &reader.order));
        for (topic, order) in std::iter::once((self.topics.joints.as_str(), &self.joints.order)).chain(of_tags) {
            if let Some(disorder) = order.first_regression() {
                return Err(InputError::Disorder { file: file(), topic: topic.to_owned(), disorder });
            }
        }
        match self.cameras().find(|reader| reader.len() == 0) {
            Some(reader) => {
                let (topic, problem) = (reader.topic.to_owned(), reader.problem());
                Err(InputError::NoTags { file: file(), topic, problem })
            }
            None => Ok(()),
        }
    }

    /// Sentences on messages whose stamps were replaced, by topic.
    fn notes(&self) -> Vec<String> {
        let joints = self.joints.clock.note(&self.topics.joints);
        joints.into_iter().chain(self.cameras().filter_map(|reader| reader.clock.note(reader.topic))).collect()
    }

    /// Sentence on clocks so different that most frames have no joint reading; `None` if they agree.
    fn clock_doubt(&self) -> Option<String> {
        if self.map.stamps == StampSource::LogTime {
            return None;
        }
        let joints = StreamTimes {
            topic: self.topics.joints.clone(),
            stamps: self.joints.readings.iter().map(|reading| reading.stamp).collect(),
            log_times: self.joints.log_times.clone(),
        };
        let (stamps, log_times) = self.cameras().flat_map(TagReader::times).unzip();
        let tags = StreamTimes { topic: self.topics.tags.clone(), stamps, log_times };
        compare_clocks(self.map.max_gap_s, joints, tags).map(|doubt| doubt.text)
    }

    fn finish(self, robot: &Robot) -> ExternalRecording {
        let absent_joints =
            (n_needed(robot)..robot.n_joints()).filter(|joint| !self.joints.present.contains(joint)).collect();
        let extra_joints = self.joints.extra();
        let (notes, clock_doubt) = (self.notes(), self.clock_doubt());
        let (skipped, left_out) = (self.joints.skipped(), self.joints.left_out());
        let (mut readings, mut left_out) = (self.joints.readings, left_out);
        readings.sort_by_key(|reading| reading.stamp);
        let (frames, of_tags) = self.tags.finish();
        left_out.extend(of_tags);
        let mut further_frames = vec![Vec::new(); robot.further_cameras.len()];
        for reader in self.further {
            let camera = reader.camera;
            let (frames, of_tags) = reader.finish();
            of_tags.into_iter().for_each(|(why, n)| *left_out.entry(why).or_default() += n);
            further_frames[camera - 1] = frames;
        }
        if self.conditions.left_out > 0 {
            left_out.insert("temperatures or pressures that are not finite".to_owned(), self.conditions.left_out);
        }
        let (attitudes, not_finite) = self.attitudes.finish();
        if not_finite > 0 {
            left_out.insert("attitudes that are not finite".to_owned(), not_finite);
        }
        let conditions = self.conditions.readings;
        ExternalRecording {
            readings,
            frames,
            further_frames,
            conditions,
            attitudes,
            absent_joints,
            extra_joints,
            skipped,
            left_out,
            notes,
            clock_doubt,
            ..ExternalRecording::default()
        }
    }
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

fn check_tags(file: &str, raw: &RawMessage<'_>, map: &InputMap) -> Result<(), InputError> {
    const TYPES: [RosSchema; 5] = [
        TfMessage::SCHEMA,
        AprilTagDetectionArray::SCHEMA,
        IsaacDetectionArray::SCHEMA,
        Image::SCHEMA,
        CompressedImage::SCHEMA,
    ];
    check_type(file, raw, &TYPES)?;
    let is_transform = raw.schema_name().ends_with("/TFMessage");
    let is_image = raw.schema_name().ends_with("Image");
    let (held, allowed) = match map.tag_use {
        TagUse::Corners | TagUse::BoardCorners if is_transform => {
            ("transforms, which have no corners", "\"position\" or \"pose\"")
        }
        TagUse::Position | TagUse::Pose if !is_transform => ("corners in the image", "\"corners\""),
        TagUse::BoardCorners if is_image => {
            ("images, in which armcal looks for tags, not for boards", "\"corners\"; name a topic with the corners")
        }
        _ => return Ok(()),
    };
    Err(InputError::Use { file: file.to_owned(), topic: raw.topic().to_owned(), held, allowed })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::{RawMeasurement, parse_input_map, read_input_map};
    use crate::log::ros::{AprilTagDetection, JointState, PixelPoint};
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
        let problem = |most| read_up_to(most, &path, &map, (&robot, None)).unwrap_err();
        assert!(matches!(problem(11), InputError::TooLong { most: 11, topic, .. } if topic == topics.joints));
        assert!(matches!(problem(12), InputError::NoTopic { .. }));
    }

    /// Returns the corners of the tag in a recording of one joint message and one detection.
    fn corners_read(keys: &str, recorded_px: [[f64; 2]; 4]) -> RawMeasurement {
        let robot = crate::robot::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/titan4")).unwrap();
        let text = format!(
            "version = 1\nkind = \"input\"\n[joint_sensors]\ntopic = \"/j\"\n[tags]\ntopic = \"/t\"\n\
             use = \"corners\"\n{keys}\n"
        );
        let map = parse_input_map(Path::new("map.toml"), &text).unwrap();
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("run.mcap");
        let mut writer = RecordingWriter::create(&path, RecordingHeader::new(robot.joint_names())).unwrap();
        let name = robot.joint_names();
        let joints = JointState { position: vec![1.0; name.len()], name, ..JointState::default() };
        writer.write_ros("/j", &JointState::SCHEMA, SIMULATION_EPOCH, &joints).unwrap();
        let corners = recorded_px.map(|[x, y]| PixelPoint { x, y });
        let detections = vec![AprilTagDetection { id: 3, corners, ..AprilTagDetection::default() }];
        let tags = AprilTagDetectionArray { detections, ..AprilTagDetectionArray::default() };
        writer.write_ros("/t", &AprilTagDetectionArray::SCHEMA, SIMULATION_EPOCH, &tags).unwrap();
        writer.finish().unwrap();
        read_external(&path, &map, &robot).unwrap().frames[0].tags[0].seen
    }

    #[test]
    fn corners_of_detections_are_taken_in_the_stated_order() {
        let apriltag_px = [[100.0, 200.0], [200.0, 201.0], [199.0, 101.0], [101.0, 99.0]];
        let [bottom_left, bottom_right, top_right, top_left] = apriltag_px;
        let opencv_px = [top_left, top_right, bottom_right, bottom_left];
        let expected = RawMeasurement::Corners(apriltag_px);
        assert_eq!(corners_read("", apriltag_px), expected);
        assert_eq!(corners_read("corner_order = \"apriltag\"", apriltag_px), expected);
        assert_eq!(corners_read("corner_order = \"opencv\"", opencv_px), expected);
        assert_ne!(corners_read("", opencv_px), expected);
    }
}
