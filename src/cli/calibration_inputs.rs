//! Inputs of `armcal calibrate`: recordings and their companion files, as the estimator takes them.

use armcal_core::codes::Code;
use armcal_core::kind::Kind;
#[cfg(feature = "images")]
use std::collections::BTreeMap;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::calib::{
    Calibration, CalibrationData, Status, View, calibrate_data, check_joints, prepare_pooled, read_marked,
};
use crate::cli::exit::UsageError;
use crate::cli::file_kind::{FileKind, expect_kind, expect_no_truth, expect_option, expect_recording};
use crate::cli::losses::{warn_of_external, warn_of_losses};
use crate::cli::stdout::warn;
use crate::cli::waiting::Waiting;
use crate::front::Calibrator;
use crate::front::measurements::add_lens;
use armcal_belief::calib::online::{Batch, Follower, OnlineEvent, OnlineSettings};
use armcal_belief::tagmap::files::{LandmarkFile, read_landmarks};
#[cfg(not(feature = "images"))]
use armcal_core::input::read_external;
use armcal_core::input::{ExternalRecording, InputMap, TagUse, read_input_map, read_task};
#[cfg(feature = "images")]
use armcal_core::input::{
    ImageDetector, ImageProblem, RecordedImage, Source, TagCorners, Topics, read_external_images,
};
#[cfg(feature = "images")]
use armcal_core::log::for_each_raw;
use armcal_core::log::{Recording, TopicMap, scan_recording};
#[cfg(feature = "images")]
use armcal_core::optics::TagFamily;
use armcal_core::robot::{self, FailedJoint, Robot, SELF_COLLISION_FILE, TagSurvey};
use armcal_core::routine::Method;
use armcal_core::streams::{Message, ReachTask};
use armcal_core::text::counted;
use armcal_core::time::Stamp;

/// Name of the online estimator in messages.
const ONLINE: &str = "the belief kept up online";

/// Inputs of a calibration from files.
pub(super) struct CalibrationInputs<'a> {
    pub recordings: &'a [PathBuf],
    pub robot: &'a Robot,
    pub method: Method,
    pub input: Option<&'a Path>,
    pub tag_map: Option<&'a Path>,
    pub prior: Option<&'a Path>,
    pub task: Option<&'a Path>,
}

/// Result of a calibration from files.
pub(super) struct Calibrated {
    pub calibration: Calibration,
    /// True if a recording had lost data.
    pub lost: bool,
    /// Views of a real arm's recordings, and the arm with the tags around it.
    pub external: Option<(Vec<View>, Robot)>,
}

impl CalibrationInputs<'_> {
    /// Refuses files that are known to be of another kind.
    pub fn check_kinds(&self) -> Result<()> {
        self.recordings.iter().try_for_each(|path| expect_recording(path))?;
        let is_own = |path: &&PathBuf| FileKind::of(path) == Some(FileKind::Bag);
        if let Some(bag) = self.recordings.iter().find(is_own).filter(|_| self.input.is_none()) {
            let file = bag.display();
            return Err(UsageError::new(
                Code::UsageInvalid,
                format!(
                    "{file}: is a ROS bag, which needs an input map: `armcal inspect {file} --write-input MAP.toml` \
                 proposes one, then give --input MAP.toml"
                ),
            )
            .into());
        }
        expect_option(self.input, Kind::Input)?;
        expect_option(self.tag_map, Kind::TagMap)?;
        expect_option(self.prior, Kind::Calibration)?;
        expect_option(self.task, Kind::Task)
    }

    pub fn calibrate(&self) -> Result<Calibrated> {
        let prior = self.prior.map(|file| read_prior(file, self.robot)).transpose()?;
        let task = self.task()?;
        let landmarks = self.landmarks()?;
        match self.input {
            Some(file) => self.of_external(file, landmarks, task, prior.as_ref()),
            None => {
                let (calibration, lost) = self.of_own(landmarks, task, prior.as_ref())?;
                Ok(Calibrated { calibration, lost, external: None })
            }
        }
    }

    /// The calibrator with robot, tags and task.
    fn calibrator(&self, landmarks: Option<(&Path, LandmarkFile)>, task: Option<ReachTask>) -> Calibrator<'_> {
        let calibrator = Calibrator::new(self.robot).method(self.method);
        let calibrator = match landmarks {
            Some((file, landmarks)) => calibrator.tags(file, landmarks),
            None => calibrator,
        };
        match task {
            Some(task) => calibrator.task(task),
            None => calibrator,
        }
    }

    /// Calibrates from recordings that armcal made: they mark their views.
    fn of_own(
        &self,
        landmarks: Option<(&Path, LandmarkFile)>,
        task: Option<ReachTask>,
        prior: Option<&Calibration>,
    ) -> Result<(Calibration, bool)> {
        let (mut recordings, lost) = self.marked()?;
        let _waiting = Waiting::on(&format!("calibrating by {}", counted(recordings.len(), "recording")));
        let calibrator = self.calibrator(landmarks, task);
        let calibrator = prior.into_iter().fold(calibrator, Calibrator::prior);
        Ok((calibrator.of_marked(&mut recordings)?, lost))
    }

    /// Calibrates from recordings of a real arm, by an input map.
    fn of_external(
        &self,
        file: &Path,
        landmarks: Option<(&Path, LandmarkFile)>,
        task: Option<ReachTask>,
        prior: Option<&Calibration>,
    ) -> Result<Calibrated> {
        let (prepared, lost) = match self.method {
            Method::Bundle => self.external_views(file, landmarks, task)?,
            _ => self.views_of_first_camera(file, "this method", (landmarks, task))?,
        };
        let external = Some((prepared.data.fit.clone(), prepared.robot.clone()));
        let _waiting = Waiting::on(&format!("calibrating by {}", counted(prepared.data.fit.len(), "view")));
        Ok(Calibrated { calibration: calibrate_data(prepared, self.method, prior)?, lost, external })
    }

    /// An online estimator without any message yet, for an arm whose recordings armcal makes.
    pub fn listener(&self, settings: OnlineSettings) -> Result<Listener> {
        self.robot.require_turning(ONLINE)?;
        let survey = self.survey(self.landmarks()?)?;
        self.robot.require_lens()?;
        let has_map = survey.is_some();
        let robot = survey.map(|survey| self.robot.clone().with_survey(survey));
        let mut follower = Follower::new(robot.unwrap_or_else(|| self.robot.clone()), settings);
        self.task()?.iter().for_each(|task| follower.set_task(task));
        Ok(Listener { follower, has_map })
    }

    fn task(&self) -> Result<Option<ReachTask>> {
        let read = |file: &Path| {
            let task = read_task(file)?;
            task.check_poses(file, self.robot)?;
            Ok(task.for_robot(file, self.robot)?)
        };
        self.task.map(read).transpose()
    }

    /// Passes the recordings to an online estimator, message by message; calls `hear` after each of them. Returns true
    /// if a recording had lost data.
    pub fn follow(
        &self,
        settings: OnlineSettings,
        hear: &mut dyn FnMut(&Follower, Vec<OnlineEvent>),
    ) -> Result<(Follower, bool)> {
        self.robot.require_turning(ONLINE)?;
        if let Some(file) = self.input {
            let (prepared, lost) = self.views_of_first_camera(file, ONLINE, (self.landmarks()?, self.task()?))?;
            let mut follower = Follower::new(prepared.robot.clone(), settings);
            prepared.data.task.iter().for_each(|task| follower.set_task(task));
            for view in prepared.data.fit {
                let events = follower.add(vec![view]);
                hear(&follower, events);
            }
            return Ok((follower, lost));
        }
        let mut listener = self.listener(settings)?;
        let mut lost = false;
        for path in self.recordings {
            let take = |log_time, message: &Message| {
                listener.push(log_time, message, hear);
                false
            };
            let (rest, _) = scan_recording(path, &TopicMap::default(), |_| {}, take)?;
            lost |= warn_of_losses(&rest);
            check_joints(&rest, self.robot)?;
        }
        Ok((listener.finish(hear), lost))
    }

    /// The batch of all marked views, and true if a recording had lost data.
    pub fn batch(&self) -> Result<(Batch, bool)> {
        self.robot.require_turning(ONLINE)?;
        let (task, landmarks) = (self.task()?, self.landmarks()?);
        let (prepared, lost) = match self.input {
            Some(file) => self.views_of_first_camera(file, ONLINE, (landmarks, task))?,
            None => {
                let (recordings, lost) = self.marked()?;
                let survey = self.survey(landmarks)?;
                (prepare_pooled(&recordings, self.robot, survey.as_ref(), task.as_ref(), self.method)?, lost)
            }
        };
        Ok((Batch::of(prepared)?, lost))
    }

    fn landmarks(&self) -> Result<Option<(&Path, LandmarkFile)>> {
        self.tag_map.map(|file| Ok((file, read_landmarks(file)?))).transpose()
    }

    fn survey(&self, landmarks: Option<(&Path, LandmarkFile)>) -> Result<Option<TagSurvey>> {
        let named = landmarks.map(|(file, map)| map.survey(file, self.robot, TagUse::Corners)).transpose()?;
        Ok(named.map(|named| named.survey))
    }

    /// Recordings that armcal made, and true if one had lost data.
    fn marked(&self) -> Result<(Vec<Recording>, bool)> {
        let mut recordings = Vec::new();
        let mut lost = false;
        for path in self.recordings {
            let recording = read_marked(path)?;
            if recording.joint_names.is_empty() {
                expect_no_truth(path)?;
            }
            lost |= warn_of_losses(&recording);
            // A missing input map comes before a missing lens: the map may name the lens.
            check_joints(&recording, self.robot)?;
            tracing::info!("{}: {} messages about its marks", path.display(), recording.messages.len());
            recordings.push(recording);
        }
        self.robot.require_lens()?;
        Ok((recordings, lost))
    }

    /// The views without further cameras, which the command `what` does not support.
    fn views_of_first_camera(
        &self,
        file: &Path,
        what: &str,
        (landmarks, task): (Option<(&Path, LandmarkFile)>, Option<ReachTask>),
    ) -> Result<(CalibrationData, bool)> {
        let (mut prepared, lost) = self.external_views(file, landmarks, task)?;
        let n = prepared.data.keep_first_camera();
        if n > 0 {
            warn(
                Code::ViewsLeftOut,
                format_args!("{what} uses one camera; left out: {} of others", counted(n, "view")),
            );
        }
        Ok((prepared, lost))
    }

    /// Views of recordings of a real arm, and true if one had lost data.
    fn external_views(
        &self,
        file: &Path,
        landmarks: Option<(&Path, LandmarkFile)>,
        task: Option<ReachTask>,
    ) -> Result<(CalibrationData, bool)> {
        let map = read_input_map(file)?;
        map.check_robot(file, self.robot)?;
        let mut robot = self.robot.clone();
        if map.tag_use.needs_lens() {
            add_lens(&mut robot, self.recordings, &map, &mut |path, note| {
                warn(Code::CameraInfoInvalid, format_args!("{}: {note}", path.display()));
            })?;
        }
        let needs_task = task.is_none();
        let calibrator = self.calibrator(landmarks, task);
        let arm = calibrator.surveyed((&map, file), robot)?;
        let robot = &arm.robot;
        let mut recordings = Vec::new();
        let mut lost = false;
        for path in self.recordings {
            let recording = read_with_images(path, &map, robot)?;
            let of_further: usize = recording.further_frames.iter().map(Vec::len).sum();
            let (readings, frames) = (recording.readings.len(), recording.frames.len() + of_further);
            tracing::info!("{}: {readings} joint readings, {frames} frames with tags", path.display());
            lost |= warn_of_external(&recording, robot);
            recordings.push(recording);
        }
        if needs_task {
            warn(Code::TaskMissing, "no task is named (--task), so that no tool error is predicted");
        }
        let prepared = calibrator.of_external(&recordings, &map, arm)?;
        for recording in &recordings {
            if let Some(doubt) = &recording.clock_doubt {
                warn(Code::ClocksDiffer, format_args!("{}: {doubt}", recording.path.display()));
            }
        }
        Ok((prepared, lost))
    }
}

/// Reads a recording, and searches its images for tags one at a time.
#[cfg(feature = "images")]
fn read_with_images(path: &Path, map: &InputMap, robot: &Robot) -> Result<ExternalRecording> {
    let family = map.tag_family.unwrap_or(robot.tag_family);
    let detector =
        crate::recorded_images::RecordedImageDetector::new(robot.cameras().map(|camera| &camera.lens), family);
    let waiting = match &map.source {
        Source::Topics(topics) => watched_images(path, topics)?,
        Source::Table(_) => None,
    };
    Ok(read_external_images(path, map, robot, &mut Watched { detector, waiting })?)
}

/// Progress display for recordings whose tags are in images. A separate pass counts the images, which takes almost no
/// time compared with the search.
#[cfg(feature = "images")]
fn watched_images(path: &Path, topics: &Topics) -> Result<Option<Waiting>> {
    if !Waiting::on("looking for images").is_seen() {
        return Ok(None);
    }
    // Time from which the next image of each topic is searched.
    let names = std::iter::once(&topics.tags).chain(topics.further.iter().map(|further| &further.topic));
    let mut next_nanos: BTreeMap<&str, u64> = names.map(|topic| (topic.as_str(), 0)).collect();
    let mut n = 0;
    for_each_raw(path, |raw| {
        let next_nanos = next_nanos.get_mut(raw.topic()).filter(|_| raw.schema_name().ends_with("Image"));
        if let Some(next_nanos) = next_nanos.filter(|next_nanos| raw.log_time_nanos >= **next_nanos) {
            *next_nanos = raw.log_time_nanos.saturating_add((1e9 * topics.image_period_s) as u64);
            n += 1;
        }
    })?;
    Ok((n > 0).then(|| Waiting::for_each_of(n, "searching images for tags")))
}

/// An image search that reports its progress.
#[cfg(feature = "images")]
struct Watched {
    detector: crate::recorded_images::RecordedImageDetector,
    waiting: Option<Waiting>,
}

#[cfg(feature = "images")]
impl ImageDetector for Watched {
    fn family(&self) -> TagFamily {
        self.detector.family()
    }

    fn detect(&mut self, camera: usize, image: &RecordedImage) -> Result<Vec<TagCorners>, ImageProblem> {
        self.waiting.iter().for_each(Waiting::one_more);
        self.detector.detect(camera, image)
    }
}

#[cfg(not(feature = "images"))]
fn read_with_images(path: &Path, map: &InputMap, robot: &Robot) -> Result<ExternalRecording> {
    Ok(read_external(path, map, robot)?)
}

/// An online estimator that takes messages.
pub(super) struct Listener {
    pub follower: Follower,
    /// True if a map was given, which replaces the recording's.
    has_map: bool,
}

impl Listener {
    pub fn push(&mut self, log_time: Stamp, message: &Message, hear: &mut dyn FnMut(&Follower, Vec<OnlineEvent>)) {
        if self.has_map && matches!(message, Message::Survey(_)) {
            return;
        }
        let events = self.follower.push(log_time, message);
        hear(&self.follower, events);
    }

    /// Finishes after the last message.
    pub fn finish(mut self, hear: &mut dyn FnMut(&Follower, Vec<OnlineEvent>)) -> Follower {
        let events = self.follower.finish();
        hear(&self.follower, events);
        self.follower
    }
}

/// Loads a robot folder, with the joints that are declared as failed, such as `wrist_pitch=dead`.
pub(super) fn load_robot(folder: &Path, failed: &[String]) -> Result<Robot> {
    expect_kind(folder, &[FileKind::RobotFolder])?;
    let robot = robot::load(folder)?;
    // An outdated file does not matter here; commands that plan paths refuse it.
    if let Some(stale) = robot.planning_issues.iter().find(|issue| issue.key == SELF_COLLISION_FILE) {
        warn(Code::FileOutdated, format_args!("{}: {}", stale.file.display(), stale.problem));
    }
    let failed_joint = |text: &String| {
        let (joint, kind) = text.split_once('=').unwrap_or((text, ""));
        FailedJoint::of_names(joint, kind, &robot.joint_names())
            .map_err(|problem| UsageError::new(Code::UsageInvalid, format!("--failed {text}: {problem}")))
    };
    let failed = failed.iter().map(failed_joint).collect::<Result<Vec<FailedJoint>, _>>()?;
    FailedJoint::check_kinds(&failed, &robot.joint_names())
        .map_err(|problem| UsageError::new(Code::UsageInvalid, format!("--failed: {problem}")))?;
    warn_of_unseen(&robot, &failed);
    Ok(robot.with_failed(&failed))
}

/// Warns of declared joints that do not move the camera.
fn warn_of_unseen(robot: &Robot, failed: &[FailedJoint]) {
    let unseen: BTreeSet<usize> =
        failed.iter().map(|failed| failed.joint).filter(|joint| *joint >= robot.n_seen_joints()).collect();
    let names: Vec<&str> = unseen.iter().map(|&joint| robot.sensors[joint].joint.as_str()).collect();
    if !names.is_empty() {
        let names = names.join(", ");
        let why = "beyond the camera, so that the calibration has no part of it";
        warn(Code::KeyIgnored, format_args!("--failed has no effect on {names}: {why}"));
    }
}

/// Reads an accepted calibration of this robot.
pub(super) fn read_prior(file: &Path, robot: &Robot) -> Result<Calibration> {
    let prior = Calibration::read(file)?;
    if prior.status == Status::Refused {
        let why = prior.refusal.unwrap_or_default();
        return Err(UsageError::new(
            Code::PriorUnusable,
            format!("{}: was refused itself ({why}); it is no prior", file.display()),
        )
        .into());
    }
    prior.check_robot(file, robot)?;
    prior.sensors(robot)?;
    Ok(prior)
}
