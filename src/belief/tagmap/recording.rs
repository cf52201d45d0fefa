//! Views from recordings, in our format and others.

use crate::tagmap::constants::recording::{MAX_GAP_S, UNIT_TOLERANCE};
use armcal_core::codes::{Code, Coded};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use nalgebra::{Quaternion, UnitQuaternion};

use crate::tagmap::files::{NamedCamera, TagFile};
use crate::tagmap::types::{MapDetection, MapView};
use armcal_core::log::{Completeness, LogError, RawMessage, decode, for_each_raw, ros, topics};
use armcal_core::time::Stamp;

/// Views of a recording, and counts of skipped messages and detections.
#[derive(Clone, Debug)]
pub struct RecordedViews {
    /// Views, sorted by camera, then in the order of the file.
    pub views: Vec<MapView>,
    /// Topic of each camera that has one in the recording: (index of the camera, topic).
    pub topics: Vec<(usize, String)>,
    /// Tells if the file could be read to its end.
    pub completeness: Completeness,
    /// Number of skipped messages and detections, by reason.
    pub left_out: BTreeMap<&'static str, usize>,
    /// Number of messages of `left_out` that could not be read; rules excluded the others.
    pub n_unreadable: usize,
}

/// Reason why a recording yields no views.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum ViewsError {
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(
        "{}: no topic with detections (AprilTagDetectionArray of apriltag_msgs or isaac_ros_apriltag_interfaces) \
         of the cameras; wanted: {wanted:?}, in the recording: {found:?}; name one with --topic",
        path.display()
    )]
    NoTopic { path: PathBuf, wanted: Vec<String>, found: Vec<String> },
}

/// Contents of a recording that a map uses.
#[derive(Default)]
struct Contents {
    arrays: BTreeMap<String, Vec<(Stamp, Option<ros::AprilTagDetectionArray>)>>,
    attitudes: Vec<(Stamp, UnitQuaternion<f64>)>,
}

/// Reads the detections of `cameras`. Each camera has the topic that its file names, if the recording has it. Otherwise
/// the first camera has `topic`, or the only one in the recording. `rules` states the detections that are skipped or
/// stand for others.
///
/// # Errors
/// [`ViewsError`].
pub fn read_views(
    path: &Path,
    cameras: &[NamedCamera],
    topic: Option<&str>,
    rules: &TagFile,
) -> Result<RecordedViews, ViewsError> {
    let mut contents = Contents::default();
    let summary = for_each_raw(path, |message| contents.take(message))?;
    let topics = choose_topics(path, cameras, topic, &contents)?;
    contents.attitudes.sort_by_key(|(stamp, _)| *stamp);
    let mut out = RecordedViews {
        views: Vec::new(),
        topics,
        completeness: summary.completeness,
        left_out: BTreeMap::new(),
        n_unreadable: 0,
    };
    for (camera, topic) in out.topics.clone() {
        for (log_time, array) in contents.arrays.remove(&topic).unwrap_or_default() {
            let Some(array) = array else {
                out.n_unreadable += 1;
                *out.left_out.entry("messages that cannot be decoded").or_default() += 1;
                continue;
            };
            let stamp = Stamp::try_from(array.header.stamp).ok().filter(|stamp| stamp.nanos != 0).unwrap_or(log_time);
            let tags = array.detections.iter().filter_map(|d| seen(d, stamp, &cameras[camera].name, rules, &mut out));
            let tags: Vec<MapDetection> = tags.collect();
            let attitude = attitude_at(&contents.attitudes, stamp);
            out.views.push(MapView { camera, stamp, tags, attitude });
        }
    }
    Ok(out)
}

impl Contents {
    fn take(&mut self, message: &RawMessage<'_>) {
        if let Some(array) = ros::decode_detections(message.schema_name(), message.data) {
            let array = array.ok();
            self.arrays.entry(message.topic().to_owned()).or_default().push((message.log_time(), array));
        } else if message.topic() == topics::VEHICLE_IMU
            && let Ok(imu) = decode::<ros::Imu>(message.data)
            && let Ok(stamp) = Stamp::try_from(imu.header.stamp)
            && imu.orientation_covariance[0] >= 0.0
        {
            let [w, x, y, z] = imu.orientation.wxyz();
            let quaternion = Quaternion::new(w, x, y, z);
            if (quaternion.norm() - 1.0).abs() < UNIT_TOLERANCE {
                self.attitudes.push((stamp, UnitQuaternion::from_quaternion(quaternion)));
            }
        }
    }
}

fn choose_topics(
    path: &Path,
    cameras: &[NamedCamera],
    topic: Option<&str>,
    contents: &Contents,
) -> Result<Vec<(usize, String)>, ViewsError> {
    let found: BTreeSet<&String> = contents.arrays.keys().collect();
    let named = |camera: &NamedCamera| camera.tag_topic.clone().filter(|topic| found.contains(topic));
    if let Some(wanted) = topic.map(str::to_owned) {
        if !found.contains(&wanted) {
            return Err(no_topic(path, vec![wanted], &found));
        }
        let camera = cameras.iter().position(|camera| camera.tag_topic.as_ref() == Some(&wanted)).unwrap_or(0);
        return Ok(vec![(camera, wanted)]);
    }
    let by_name: Vec<(usize, String)> =
        cameras.iter().enumerate().filter_map(|(idx, camera)| named(camera).map(|topic| (idx, topic))).collect();
    match (by_name.is_empty(), found.iter().next()) {
        (false, _) => Ok(by_name),
        (true, Some(only)) if found.len() == 1 => Ok(vec![(0, (*only).clone())]),
        _ => Err(no_topic(path, cameras.iter().filter_map(|camera| camera.tag_topic.clone()).collect(), &found)),
    }
}

fn no_topic(path: &Path, wanted: Vec<String>, found: &BTreeSet<&String>) -> ViewsError {
    ViewsError::NoTopic { path: path.to_owned(), wanted, found: found.iter().map(|topic| (*topic).clone()).collect() }
}

fn seen(
    detection: &ros::AprilTagDetection,
    stamp: Stamp,
    camera: &str,
    rules: &TagFile,
    out: &mut RecordedViews,
) -> Option<MapDetection> {
    let corners_px = detection.corners.map(|corner| [corner.x, corner.y]);
    let mut left_out = |reason: &'static str| *out.left_out.entry(reason).or_default() += 1;
    let Ok(mut id) = u32::try_from(detection.id) else {
        left_out("detections with a negative id");
        out.n_unreadable += 1;
        return None;
    };
    if corners_px.iter().flatten().any(|value| !value.is_finite()) {
        left_out("detections whose corners are not numbers");
        out.n_unreadable += 1;
        return None;
    }
    if rules.max_hamming.is_some_and(|most| detection.hamming > most) {
        left_out("detections above max_hamming_distance");
        return None;
    }
    let remap = rules.remaps.iter().find(|remap| {
        remap.id == id
            && remap.camera.as_ref().is_none_or(|name| name == camera)
            && (remap.from..=remap.to).contains(&stamp)
    });
    if let Some(remap) = remap {
        id = remap.as_id;
    }
    if rules.ignored.contains(&id) {
        left_out("detections of ignore_tags");
        return None;
    }
    if rules.squashed.iter().any(|(at, ids)| *at == stamp && ids.contains(&id)) {
        left_out("detections squashed");
        return None;
    }
    Some(MapDetection { id, corners_px, covariance_px2: None })
}

/// Attitude at `stamp`, interpolated between the two neighbours in time.
fn attitude_at(attitudes: &[(Stamp, UnitQuaternion<f64>)], stamp: Stamp) -> Option<UnitQuaternion<f64>> {
    let after = attitudes.partition_point(|(at, _)| *at < stamp);
    let (later, later_turn) = attitudes.get(after)?;
    let Some((earlier, turn)) = after.checked_sub(1).map(|idx| &attitudes[idx]) else {
        return (*later == stamp).then_some(*later_turn);
    };
    let span_s = later.since_s(*earlier);
    (span_s <= MAX_GAP_S).then(|| turn.slerp(later_turn, stamp.since_s(*earlier) / span_s.max(1e-9)))
}

impl Coded for ViewsError {
    fn code(&self) -> Code {
        match self {
            Self::Log(error) => error.code(),
            Self::NoTopic { .. } => Code::TopicMissing,
        }
    }
}
