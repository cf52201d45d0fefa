//! Measurements of an arm: recordings, or joint readings and tags in memory.

use std::path::{Path, PathBuf};

use armcal_belief::calib::read_marked;
use armcal_core::input::{
    ConditionKind, ConditionReading, ExternalDetection, ExternalRecording, InputError, InputMap, MAX_ROWS, MIN_APART_S,
    RawMeasurement, Reading, Source, TagFrame, parse_input_map, read_camera_info, read_input_map,
};
use armcal_core::joints::JointCounts;
use armcal_core::log::Recording;
use armcal_core::optics::CameraModel;
use armcal_core::robot::Robot;
use armcal_core::streams::{Mark, MarkKind, Message};
use armcal_core::time::Stamp;

use crate::front::CalibrateError;

/// Largest time of a pose, s: Unix times until the year 2096.
const MAX_TIME_S: f64 = 4e9;
/// Largest oil temperature, deg C.
pub const MAX_OIL_C: f64 = 200.0;

/// Measurements of one arm.
#[derive(Clone, Debug)]
pub enum Measurements {
    /// Recordings that armcal made; they mark their views.
    Marked(Vec<Recording>),
    /// Recordings of a real arm, read by an input map, or poses in memory.
    External {
        /// Recordings, in the order in which they were given.
        recordings: Vec<ExternalRecording>,
        /// Input map that was used to read them.
        map: Box<InputMap>,
        /// The input map's file, for messages.
        map_file: PathBuf,
        /// The lens that the recordings state, where robot.toml has none.
        lens: Option<Box<CameraModel>>,
    },
}

/// A resting arm and the tags that its camera saw.
#[derive(Clone, Debug)]
pub struct PoseAtRest {
    /// Time since any moment, s; the same origin for all poses. Poses without a time count as 1 s apart.
    pub t_s: Option<f64>,
    /// Raw reading of each joint, base first.
    pub counts: JointCounts,
    /// Temperature of the oil, deg C.
    pub oil_c: Option<f64>,
    /// Tags by their number, each at most once.
    pub tags: Vec<(u32, RawMeasurement)>,
}

impl Measurements {
    /// Reads recordings that armcal made, or with an input map those of a real arm.
    ///
    /// # Errors
    /// [`CalibrateError`], naming the file and what to do.
    pub fn read(recordings: &[PathBuf], robot: &Robot, input: Option<&Path>) -> Result<Self, CalibrateError> {
        let Some(map_file) = input else {
            return Ok(Self::Marked(recordings.iter().map(|path| read_marked(path)).collect::<Result<_, _>>()?));
        };
        let map = read_input_map(map_file)?;
        map.check_robot(map_file, robot)?;
        let mut robot = robot.clone();
        if map.tag_use.needs_lens() {
            add_lens(&mut robot, recordings, &map, &mut |_, _| ())?;
        }
        let read = |path: &PathBuf| read_external(path, &map, &robot);
        let recordings = recordings.iter().map(read).collect::<Result<_, _>>()?;
        let lens = robot.camera.lens.is_known().then(|| Box::new(robot.camera.lens));
        Ok(Self::External { recordings, map: Box::new(map), map_file: map_file.to_owned(), lens })
    }

    /// Measurements from poses in memory, in the order of time; all tags have the same kind of measurement.
    ///
    /// # Errors
    /// [`CalibrateError::Value`] for readings of another number of joints, values that are not finite, a tag twice in
    /// one pose, and times that are not apart.
    pub fn at_rest(robot: &Robot, poses: &[PoseAtRest]) -> Result<Self, CalibrateError> {
        if poses.len() > MAX_ROWS {
            let n = poses.len();
            return Err(CalibrateError::Value(format!("there are {n} poses; give at most {MAX_ROWS} at once")));
        }
        let Some((_, like)) = poses.iter().flat_map(|pose| &pose.tags).next() else {
            return Err(CalibrateError::Value("no pose has a tag: give at least three with tags".to_owned()));
        };
        let Some(map) = map_of(like) else {
            return Err(CalibrateError::Value("corners of boards are read from files only".to_owned()));
        };
        let file = Path::new("poses in memory");
        let map = parse_input_map(file, &map)?;
        let mut recording =
            ExternalRecording { path: PathBuf::from("poses in memory"), ..ExternalRecording::default() };
        for (k, pose) in poses.iter().enumerate() {
            add_pose(&mut recording, robot, (k, pose), like)
                .map_err(|problem| CalibrateError::Value(format!("pose {k}: {problem}")))?;
        }
        Ok(Self::External { recordings: vec![recording], map: Box::new(map), map_file: file.to_owned(), lens: None })
    }

    /// Number of images with tags, or of captured views where the recordings mark them.
    #[must_use]
    pub fn n_frames(&self) -> usize {
        match self {
            Self::Marked(recordings) => {
                let captured = |(_, message): &&(Stamp, Message)| {
                    matches!(message, Message::Mark(Mark { kind: MarkKind::Capture { .. }, .. }))
                };
                recordings.iter().map(|recording| recording.messages.iter().filter(captured).count()).sum()
            }
            Self::External { recordings, .. } => recordings
                .iter()
                .map(|recording| recording.frames.len() + recording.further_frames.iter().map(Vec::len).sum::<usize>())
                .sum(),
        }
    }
}

/// Input map of poses in memory: raw readings, and tags as the following lines define.
const MAP: &str = "version = 1\nkind = \"input\"\n[table]\n[joint_sensors]\nunit = \"counts\"\n[tags]\n";
const CORNERS: &str = "use = \"corners\"\n[tags.columns]\nid = \"id\"\n\
                       corners = [\"u0\", \"v0\", \"u1\", \"v1\", \"u2\", \"v2\", \"u3\", \"v3\"]\n";
const POSE: &str = "[tags.columns]\nid = \"id\"\ndirection = \"camera_from_tag\"\nposition = [\"x\", \"y\", \"z\"]\n";
const ROTATION: &str = "rotation = [\"qw\", \"qx\", \"qy\", \"qz\"]\nrotation_form = \"quaternion_wxyz\"\n";

/// The input map for poses with such tags; `None` for corners of boards, which are read only from files.
fn map_of(seen: &RawMeasurement) -> Option<String> {
    Some(match seen {
        RawMeasurement::Corners(_) => format!("{MAP}{CORNERS}"),
        RawMeasurement::Position(_) => format!("{MAP}use = \"position\"\n{POSE}"),
        RawMeasurement::Pose(_) => format!("{MAP}use = \"pose\"\n{POSE}{ROTATION}"),
        RawMeasurement::BoardCorner { .. } => return None,
    })
}

fn numbers(seen: &RawMeasurement) -> Vec<f64> {
    match seen {
        RawMeasurement::Corners(corners_px) => corners_px.as_flattened().to_vec(),
        RawMeasurement::Position(position) => position.iter().copied().collect(),
        RawMeasurement::Pose(pose) => {
            pose.translation.vector.iter().chain(pose.rotation.coords.iter()).copied().collect()
        }
        RawMeasurement::BoardCorner { pixel, .. } => pixel.to_vec(),
    }
}

/// Adds the pose `k`; its tags have the kind of measurement of `like`.
fn add_pose(
    recording: &mut ExternalRecording,
    robot: &Robot,
    (k, pose): (usize, &PoseAtRest),
    like: &RawMeasurement,
) -> Result<(), String> {
    if pose.counts.len() != robot.n_joints() {
        let joints = robot.joint_names();
        return Err(format!("has {} joint readings; the robot has the joints {joints:?}", pose.counts.len()));
    }
    let t_s = pose.t_s.unwrap_or(k as f64);
    if !t_s.is_finite() || t_s.abs() > MAX_TIME_S {
        return Err(format!("its time is {t_s} s; give seconds within {MAX_TIME_S:e}"));
    }
    // Stamps begin at zero, but times may be negative.
    let stamp = Stamp::default().plus_s(MAX_TIME_S).plus_s(t_s);
    let apart_s = recording.readings.last().map_or(f64::INFINITY, |last| stamp.since_s(last.stamp));
    if apart_s < MIN_APART_S {
        return Err(format!(
            "is {apart_s:.3} s after the pose before; poses at rest are at least {MIN_APART_S} s apart, in the order \
             of time. Give no times where they say something else"
        ));
    }
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"armcal pose in memory 1");
    let mut add = |value: f64| {
        hasher.update(&value.to_le_bytes());
        value.is_finite()
    };
    add(t_s);
    if !pose.counts.iter().all(|count| add(*count)) {
        return Err("a joint reading is not finite; leave such poses out".to_owned());
    }
    let mut tags: Vec<ExternalDetection> = Vec::new();
    for (id, seen) in &pose.tags {
        if std::mem::discriminant(seen) != std::mem::discriminant(like) {
            return Err(format!("tag {id} is measured in another way than the first tag; give one kind"));
        }
        add(f64::from(*id));
        if !numbers(seen).into_iter().all(&mut add) {
            return Err(format!("tag {id} has a value that is not finite; leave such tags out"));
        }
        tags.push(ExternalDetection { id: Some(*id), seen: *seen });
    }
    tags.sort_by_key(|tag| tag.id);
    if let Some(pair) = tags.windows(2).find(|pair| pair[0].id == pair[1].id) {
        return Err(format!("tag {} is given twice", pair[0].id.unwrap_or_default()));
    }
    if let Some(oil_c) = pose.oil_c {
        add(oil_c);
        if !oil_c.is_finite() || oil_c.abs() > MAX_OIL_C {
            return Err(format!("its oil temperature is {oil_c} deg C; give a value within {MAX_OIL_C}, or none"));
        }
    }
    let digest = *hasher.finalize().as_bytes();
    if let Some(value) = pose.oil_c {
        recording.conditions.push(ConditionReading { stamp, kind: ConditionKind::OilTemperature, value, digest });
    }
    recording.readings.push(Reading { stamp, counts: pose.counts, digest });
    if !tags.is_empty() {
        recording.frames.push(TagFrame { stamp, tags, digests: vec![digest] });
    }
    Ok(())
}

/// Reads a recording, and searches its images for tags where the build has the detector.
#[cfg(feature = "images")]
fn read_external(path: &Path, map: &InputMap, robot: &Robot) -> Result<ExternalRecording, InputError> {
    let family = map.tag_family.unwrap_or(robot.tag_family);
    let lenses = robot.cameras().map(|camera| &camera.lens);
    let mut detector = crate::recorded_images::RecordedImageDetector::new(lenses, family);
    armcal_core::input::read_external_images(path, map, robot, &mut detector)
}

#[cfg(not(feature = "images"))]
fn read_external(path: &Path, map: &InputMap, robot: &Robot) -> Result<ExternalRecording, InputError> {
    armcal_core::input::read_external(path, map, robot)
}

/// Gives a robot without a lens that of the recordings, where the input map names one. `hear` receives further notes on
/// these messages, with their file.
pub(crate) fn add_lens(
    robot: &mut Robot,
    recordings: &[PathBuf],
    map: &InputMap,
    hear: &mut dyn FnMut(&Path, &str),
) -> Result<(), CalibrateError> {
    let Source::Topics(topics) = &map.source else { return Ok(robot.require_lens()?) };
    let Some(topic) = topics.camera_info.as_deref().filter(|_| !robot.camera.lens.is_known()) else {
        return Ok(robot.require_lens()?);
    };
    for path in recordings {
        let found = read_camera_info(path, topic)?;
        let rectified = found.rectified_note(&topics.tags, topic);
        found.notes.iter().chain(&rectified).for_each(|note| hear(path, note));
        if robot.camera.lens.is_known() && robot.camera.lens != found.lens {
            let problem = format!("{}: the lens on {topic} is not that of the others", path.display());
            return Err(CalibrateError::Usage(problem));
        }
        robot.camera.lens = found.lens;
    }
    Ok(())
}
