//! Reader of detections from transforms (`tf2_msgs/msg/TFMessage`), corners (`AprilTagDetectionArray` of
//! `apriltag_msgs` or `isaac_ros_apriltag_interfaces`) or images.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::error::{BadPlace, InputError};
use super::images::{ImageDetector, ImageProblem, RecordedImage};
use super::map::{FurtherTopic, InputMap, NotFinite, QUATERNION_LENGTH_TOLERANCE, TagUse, Topics, without_slash};
use super::stamp::TopicClock;
use crate::log::ros::{AprilTagDetectionArray, TfMessage, Time, TransformStamped, decode_detections};
use crate::log::{CdrError, RawMessage, StampOrder, decode};
use crate::optics::TagFamily;
use crate::time::Stamp;

/// Detection of one landmark in one image.
#[derive(Clone, Debug, PartialEq)]
pub struct ExternalDetection {
    /// Id of the landmark; `None` for the single landmark of a plain `child_frame`.
    pub id: Option<u32>,
    /// Measurement of the landmark, in the form that the input map requires.
    pub seen: RawMeasurement,
}

impl ExternalDetection {
    /// Key that is unique within a frame: the landmark's id, and the corner's number on a board.
    #[must_use]
    pub fn key(&self) -> (Option<u32>, Option<u32>) {
        match self.seen {
            RawMeasurement::BoardCorner { number, .. } => (self.id, Some(number)),
            _ => (self.id, None),
        }
    }
}

/// Measurement of a landmark in one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RawMeasurement {
    /// Raw pixels: bottom left, bottom right, top right, top left as printed.
    Corners([[f64; 2]; 4]),
    /// Position in the camera frame, m.
    Position(Vector3<f64>),
    /// `camera_from_tag`.
    Pose(Isometry3<f64>),
    /// An inner corner of a board.
    BoardCorner {
        /// Number of the corner on the board.
        number: u32,
        /// Raw pixel.
        pixel: [f64; 2],
    },
}

/// Measurements of a camera at one stamp.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TagFrame {
    /// The header's stamp, or the log time if the header has none.
    pub stamp: Stamp,
    /// Detections sorted by id, each once; never empty.
    pub tags: Vec<ExternalDetection>,
    /// Hashes of the messages that the frame comes from.
    pub digests: Vec<[u8; 32]>,
}

/// Smallest distance of a landmark from the lens, m; a smaller one is a transform that was not filled in.
pub(super) const MIN_DISTANCE_M: f64 = 1e-6;
/// Names of frames that an error lists.
const MAX_LISTED: usize = 20;

/// Reader of one camera's detections.
pub(super) struct TagReader<'a> {
    file: &'a str,
    map: &'a InputMap,
    pub topic: &'a str,
    /// Number of the robot's camera.
    pub camera: usize,
    camera_frame: Option<&'a str>,
    /// Minimum time between two images that are searched, s.
    image_period_s: f64,
    /// Family of the tags that are searched for in images.
    family: TagFamily,
    last_image: Option<Stamp>,
    frames: BTreeMap<Stamp, TagFrame>,
    pub clock: TopicClock,
    /// Log time of each frame's first message, by the frame's stamp.
    log_times: BTreeMap<Stamp, Stamp>,
    pub order: StampOrder,
    pub left_out: BTreeMap<String, u64>,
    /// `parent -> child` of transforms, or frames of detections, that the map does not name.
    others: BTreeSet<String>,
    messages: u64,
}

impl<'a> TagReader<'a> {
    /// Builds the reader of the first camera.
    pub fn new(file: &'a str, map: &'a InputMap, topics: &'a Topics) -> Self {
        Self {
            file,
            map,
            topic: &topics.tags,
            camera: 0,
            camera_frame: topics.camera_frame.as_deref(),
            image_period_s: topics.image_period_s,
            family: TagFamily::default(),
            last_image: None,
            frames: BTreeMap::new(),
            clock: TopicClock::new(map.stamps).with_offset(topics.clock_offset_s),
            log_times: BTreeMap::new(),
            order: StampOrder::default(),
            left_out: BTreeMap::new(),
            others: BTreeSet::new(),
            messages: 0,
        }
    }

    /// Turns the reader into that of the further camera number `camera`.
    pub fn of_further(self, camera: usize, further: &'a FurtherTopic) -> Self {
        Self { camera, topic: &further.topic, camera_frame: further.camera_frame.as_deref(), ..self }
    }

    pub fn take(
        &mut self,
        raw: &RawMessage<'_>,
        digest: [u8; 32],
        detector: &mut Option<&mut dyn ImageDetector>,
    ) -> Result<(), InputError> {
        self.messages += 1;
        let place = BadPlace::Message { topic: raw.topic().to_owned(), message: self.messages };
        let undecodable = |error| InputError::Undecodable { file: self.file.to_owned(), place: place.clone(), error };
        if raw.schema_name().ends_with("/TFMessage") {
            let message: TfMessage = decode(raw.data).map_err(undecodable)?;
            for transform in &message.transforms {
                self.transform(transform, raw.log_time(), &place, digest)?;
            }
        } else if raw.schema_name().ends_with("Image") {
            let image = RecordedImage::of(raw).map_err(undecodable)?;
            self.image(&image, raw.log_time(), (&place, digest), detector)?;
        } else {
            let message = decode_detections(raw.schema_name(), raw.data).unwrap_or(Err(CdrError::Type));
            let message = message.map_err(undecodable)?;
            self.detections(&message, raw.log_time(), &place, digest)?;
        }
        Ok(())
    }

    fn transform(
        &mut self,
        transform: &TransformStamped,
        log_time: Stamp,
        place: &BadPlace,
        digest: [u8; 32],
    ) -> Result<(), InputError> {
        let (parent, child) = (without_slash(&transform.header.frame_id), without_slash(&transform.child_frame_id));
        let camera = self.camera_frame;
        let id_of = |frame: &str| self.map.child_frame.as_ref()?.id_of(frame);
        let (id, of, is_inverse) = match (id_of(child), id_of(parent)) {
            (Some(id), _) if Some(parent) == camera => (id, child, false),
            (_, Some(id)) if Some(child) == camera => (id, parent, true),
            _ => {
                self.others.insert(format!("{parent} -> {child}"));
                return Ok(());
            }
        };
        let stamp = self.stamp(transform.header.stamp, log_time);
        self.order.add_of(self.messages, stamp);
        let position: [f64; 3] = transform.transform.translation.into();
        let [w, x, y, z] = transform.transform.rotation.wxyz();
        if let Some(value) = position.into_iter().find(|value| !value.is_finite()) {
            return self.not_finite(place, "translation", of, value);
        }
        let quaternion = Quaternion::new(w, x, y, z);
        let needs_rotation = is_inverse || self.map.tag_use == TagUse::Pose;
        if needs_rotation && let Some(value) = [w, x, y, z].into_iter().find(|value| !value.is_finite()) {
            return self.not_finite(place, "rotation", of, value);
        }
        let is_unit = (quaternion.norm() - 1.0).abs() <= QUATERNION_LENGTH_TOLERANCE;
        if needs_rotation && !is_unit {
            self.count("transforms whose quaternion's length differs from 1 by more than 1 %");
            return Ok(());
        }
        let position = Vector3::from(position);
        if position.norm() < MIN_DISTANCE_M {
            self.count("transforms that put a landmark into the camera itself");
            return Ok(());
        }
        let rotation = if is_unit { UnitQuaternion::from_quaternion(quaternion) } else { UnitQuaternion::identity() };
        let given = Isometry3::from_parts(Translation3::from(position), rotation);
        let camera_from_tag = if is_inverse { given.inverse() } else { given };
        let seen = match self.map.tag_use {
            TagUse::Pose => RawMeasurement::Pose(camera_from_tag),
            _ => RawMeasurement::Position(camera_from_tag.translation.vector),
        };
        self.add(stamp, digest, Some(id), seen);
        Ok(())
    }

    fn detections(
        &mut self,
        message: &AprilTagDetectionArray,
        log_time: Stamp,
        place: &BadPlace,
        digest: [u8; 32],
    ) -> Result<(), InputError> {
        let frame = without_slash(&message.header.frame_id);
        if self.camera_frame.is_some_and(|camera| !frame.is_empty() && frame != camera) {
            self.others.insert(frame.to_owned());
            return Ok(());
        }
        let stamp = self.stamp(message.header.stamp, log_time);
        self.order.add_of(self.messages, stamp);
        for tag in &message.detections {
            let Ok(id) = u32::try_from(tag.id) else {
                self.count("detections with a negative id");
                continue;
            };
            if self.map.tag_use == TagUse::BoardCorners {
                let pixel = [tag.centre.x, tag.centre.y];
                if let Some(value) = pixel.into_iter().find(|value| !value.is_finite()) {
                    self.not_finite(place, "centre", &format!("corner {id}"), value)?;
                    continue;
                }
                self.add(stamp, digest, None, RawMeasurement::BoardCorner { number: id, pixel });
                continue;
            }
            // Both orders are their own inverse.
            let corner = |number: usize| tag.corners[self.map.corner_order.place(number)];
            let corners_px = [0, 1, 2, 3].map(corner).map(|corner| [corner.x, corner.y]);
            if let Some(value) = corners_px.iter().flatten().find(|value| !value.is_finite()) {
                self.not_finite(place, "corners", &format!("tag {id}"), *value)?;
                continue;
            }
            self.add(stamp, digest, Some(id), RawMeasurement::Corners(corners_px));
        }
        Ok(())
    }

    fn image(
        &mut self,
        image: &RecordedImage,
        log_time: Stamp,
        (place, digest): (&BadPlace, [u8; 32]),
        detector: &mut Option<&mut dyn ImageDetector>,
    ) -> Result<(), InputError> {
        let header = match image {
            RecordedImage::Raw(image) => &image.header,
            RecordedImage::Compressed(image) => &image.header,
        };
        let frame = without_slash(&header.frame_id);
        if self.camera_frame.is_some_and(|camera| !frame.is_empty() && frame != camera) {
            self.others.insert(frame.to_owned());
            return Ok(());
        }
        let stamp = self.stamp(header.stamp, log_time);
        self.order.add_of(self.messages, stamp);
        if self.last_image.is_some_and(|last| stamp.since_s(last).abs() < self.image_period_s) {
            return Ok(());
        }
        self.last_image = Some(stamp);
        let problem =
            |problem: String| Err(InputError::Row { file: self.file.to_owned(), place: place.clone(), problem });
        let Some(detector) = detector else {
            return problem("is an image; this armcal is built without its detector (feature `sim`)".to_owned());
        };
        self.family = detector.family();
        match detector.detect(self.camera, image) {
            Ok(tags) => tags
                .into_iter()
                .for_each(|(id, corners)| self.add(stamp, digest, Some(id), RawMeasurement::Corners(corners))),
            Err(ImageProblem::Damaged) => self.count("images that cannot be decoded"),
            Err(ImageProblem::TooFewBytes) => self.count("images of too few bytes for their pixels"),
            Err(ImageProblem::Unusable(why)) => return problem(why),
        }
        Ok(())
    }

    fn stamp(&mut self, stamp: Time, log_time: Stamp) -> Stamp {
        let stamp = self.clock.read(stamp, log_time);
        self.log_times.entry(stamp).or_insert(log_time);
        stamp
    }

    /// Stamps and log times of the frames.
    pub fn times(&self) -> impl Iterator<Item = (Stamp, Stamp)> {
        self.frames.keys().filter_map(|stamp| Some((*stamp, *self.log_times.get(stamp)?)))
    }

    fn not_finite(&mut self, place: &BadPlace, field: &'static str, of: &str, value: f64) -> Result<(), InputError> {
        if self.map.not_finite == NotFinite::LeaveOut {
            self.count("tags with a number that is not finite");
            return Ok(());
        }
        let (file, of) = (self.file.to_owned(), of.to_owned());
        Err(InputError::NotFinite { file, place: place.clone(), field, of, value })
    }

    fn add(&mut self, stamp: Stamp, digest: [u8; 32], id: Option<u32>, seen: RawMeasurement) {
        let id = match self.map.child_frame {
            Some(super::map::ChildFrame::Plain(_)) if !matches!(seen, RawMeasurement::Corners(_)) => None,
            _ => id,
        };
        let frame = self.frames.entry(stamp).or_default();
        frame.stamp = stamp;
        frame.tags.push(ExternalDetection { id, seen });
        if frame.digests.last() != Some(&digest) {
            frame.digests.push(digest);
        }
    }

    fn count(&mut self, what: &str) {
        *self.left_out.entry(what.to_owned()).or_default() += 1;
    }

    /// Returns the frames in the order of time, and the number of unused messages by reason. A frame drops a tag that
    /// occurs twice in it at different positions.
    pub fn finish(mut self) -> (Vec<TagFrame>, BTreeMap<String, u64>) {
        let mut frames: Vec<TagFrame> = std::mem::take(&mut self.frames).into_values().collect();
        for frame in &mut frames {
            let mut once: BTreeMap<_, ExternalDetection> = BTreeMap::new();
            let mut twice = BTreeSet::new();
            for observation in std::mem::take(&mut frame.tags) {
                match once.get(&observation.key()) {
                    Some(other) if other.seen == observation.seen => {}
                    Some(_) => drop(twice.insert(observation.key())),
                    None => drop(once.insert(observation.key(), observation)),
                }
            }
            once.retain(|key, _| !twice.contains(key));
            frame.tags = once.into_values().collect();
            for _ in &twice {
                self.count("tags seen at two places at one time");
            }
        }
        frames.retain(|frame| !frame.tags.is_empty());
        (frames, self.left_out)
    }

    /// Number of images.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Reason why no message of the topic could be used.
    pub fn problem(&self) -> String {
        let others: Vec<&String> = self.others.iter().take(MAX_LISTED).collect();
        let left_out: Vec<String> = self.left_out.iter().map(|(what, n)| format!("{n} {what}")).collect();
        match (others.is_empty(), left_out.is_empty()) {
            (false, _) => format!(
                "the input map wants `{}` seen from `{}`; in its {} messages are {others:?}",
                self.map.child_frame.as_ref().map_or_else(|| "any tag".to_owned(), super::map::ChildFrame::text),
                self.camera_frame.unwrap_or("any camera"),
                self.messages
            ),
            (true, false) => left_out.join(", "),
            (true, true) if self.last_image.is_some() => format!(
                "no tag of family {} was found in its {} images; `family` in [tags] of the input map names another",
                self.family, self.messages
            ),
            (true, true) => format!("its {} messages are empty", self.messages),
        }
    }
}
