//! Robot, tags, task and prior, and the calibration by measurements of that arm.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::calib::{
    Calibration, CalibrationData, ExternalContext, PlainLandmark, calibrate, calibrate_data, calibrate_with_survey,
    prepare_external, prepare_pooled,
};
use armcal_belief::tagmap::files::{LandmarkFile, NamedSurvey};
use armcal_core::codes::Code;
use armcal_core::input::{ChildFrame, ExternalRecording, InputMap, TagUse};
use armcal_core::robot::{FileIssue, Robot};
use armcal_core::routine::Method;
use armcal_core::streams::{Message, ReachTask};

use crate::front::{CalibrateError, Measurements};

/// Inputs of a calibration other than the measurements.
///
/// ```
/// use std::path::Path;
///
/// use armcal::{Calibrator, Measurements, load_robot};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let root = Path::new(env!("CARGO_MANIFEST_DIR"));
/// let robot = load_robot(&root.join("robots/titan4"))?;
/// let measurements = Measurements::read(&[root.join("recordings/sample/run.mcap")], &robot, None)?;
/// let calibration = Calibrator::new(&robot).calibrate(&measurements)?;
/// println!("{:?}, within {:.4} m", calibration.status, calibration.u95.max_m.unwrap_or(f64::NAN));
/// let arm = calibration.arm(&robot)?;
/// let (counts, conditions) = (armcal::JointCounts::from_slice(&[32768.0; 6]), arm.sensors().reference);
/// println!("the tool is at {:.3} m", arm.tool_pose(&counts, &conditions).translation);
/// println!("with the covariance {:.2e} m^2", arm.tool_covariance_m2(&counts, &conditions));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Calibrator<'a> {
    robot: &'a Robot,
    tags: Option<(PathBuf, LandmarkFile)>,
    task: Option<ReachTask>,
    prior: Option<&'a Calibration>,
    method: Method,
}

impl<'a> Calibrator<'a> {
    /// A calibrator without tags, task and prior: it uses those of recording and robot, and begins at the datasheet.
    #[must_use]
    pub fn new(robot: &'a Robot) -> Self {
        Self { robot, tags: None, task: None, prior: None, method: Method::Bundle }
    }

    /// Sets tags that replace those of the recording or the robot's folder; messages name their `file`.
    #[must_use]
    pub fn tags(self, file: &Path, tags: LandmarkFile) -> Self {
        Self { tags: Some((file.to_owned(), tags)), ..self }
    }

    /// Sets targets and tolerance, for recordings without them.
    #[must_use]
    pub fn task(self, task: ReachTask) -> Self {
        Self { task: Some(task), ..self }
    }

    /// Sets an accepted calibration of this arm as prior.
    #[must_use]
    pub fn prior(self, prior: &'a Calibration) -> Self {
        Self { prior: Some(prior), ..self }
    }

    /// Sets another method than the bundle.
    #[must_use]
    pub fn method(self, method: Method) -> Self {
        Self { method, ..self }
    }

    /// Calibrates the joint sensors; the result is accepted or refused.
    ///
    /// # Errors
    /// [`CalibrateError`]: tags or measurements of another arm, or too few for a fit.
    pub fn calibrate(&self, measurements: &Measurements) -> Result<Calibration, CalibrateError> {
        if let Some(prior) = self.prior {
            prior.check_robot(Path::new("calibration.toml"), self.robot)?;
            prior.sensors(self.robot)?;
        }
        match measurements {
            Measurements::Marked(recordings) => self.of_marked(&mut recordings.clone()),
            Measurements::External { recordings, map, map_file, lens } => {
                let mut robot = self.robot.clone();
                if let Some(lens) = lens {
                    robot.camera.lens = **lens;
                }
                let arm = self.surveyed((map, map_file), robot)?;
                let mut prepared = self.of_external(recordings, map, arm)?;
                if self.method != Method::Bundle {
                    prepared.data.keep_first_camera();
                }
                Ok(calibrate_data(prepared, self.method, self.prior)?)
            }
        }
    }

    /// Calibrates from recordings that armcal made: they mark their views.
    pub(crate) fn of_marked(
        &self,
        recordings: &mut [armcal_core::log::Recording],
    ) -> Result<Calibration, CalibrateError> {
        self.robot.require_lens()?;
        let named = self.tags.as_ref().map(|(file, map)| map.survey(file, self.robot, TagUse::Corners)).transpose()?;
        let survey = named.map(|named| named.survey);
        if let ([recording], None) = (&mut *recordings, self.prior) {
            // The recording's own marks give the purpose of each view.
            let names_task = recording.messages.iter().any(|(_, message)| matches!(message, Message::Task(_)));
            if let Some(task) = self.task.clone().filter(|_| !names_task) {
                recording.messages.push((task.stamp, Message::Task(task)));
            }
            return Ok(match survey {
                Some(survey) => calibrate_with_survey(recording, &self.robot.clone().with_survey(survey), self.method)?,
                None => calibrate(recording, self.robot, self.method)?,
            });
        }
        let prepared = prepare_pooled(recordings, self.robot, survey.as_ref(), self.task.as_ref(), self.method)?;
        Ok(calibrate_data(prepared, self.method, self.prior)?)
    }

    /// The arm with the tags that an input map names, before recordings are read; `robot` has its lens.
    pub(crate) fn surveyed(
        &self,
        (map, map_file): (&InputMap, &Path),
        robot: Robot,
    ) -> Result<SurveyedArm, CalibrateError> {
        if map.tag_use.needs_lens() {
            robot.require_lens()?;
            map.further().iter().try_for_each(|further| robot.require_further_lens(&further.camera))?;
        }
        let named = match &self.tags {
            Some((file, landmarks)) => landmarks.survey(file, &robot, map.tag_use)?,
            None => {
                let (names, boards) = Default::default();
                NamedSurvey { survey: self.robot.survey(), names, boards }
            }
        };
        if let (None, Some(ChildFrame::Plain(name))) = (&self.tags, &map.child_frame)
            && (named.survey.tags.len() != 1 || map.tag_use == TagUse::BoardCorners)
        {
            let problem = format!("is the landmark `{name}`: name the tag map that has it with --tag-map");
            return Err(FileIssue::new(Code::NameUnknown, map_file, "tags.child_frame", problem).into());
        }
        let plain = plain_landmark(map_file, map, &named)?;
        let robot = robot.with_survey(named.survey);
        if robot.tags.is_empty() {
            let problem = "name the landmarks with --tag-map: the robot has no tags of its own";
            return Err(CalibrateError::Usage(problem.to_owned()));
        }
        Ok(SurveyedArm { robot, landmark_names: named.names, plain })
    }

    /// The views of a real arm's recordings, read by an input map.
    pub(crate) fn of_external(
        &self,
        recordings: &[ExternalRecording],
        map: &InputMap,
        arm: SurveyedArm,
    ) -> Result<CalibrationData, CalibrateError> {
        let SurveyedArm { robot, landmark_names, plain } = arm;
        let context = ExternalContext { task: self.task.clone(), landmark_names, plain };
        Ok(prepare_external(recordings, map, &robot, context)?)
    }
}

/// An arm with the tags around it.
pub(crate) struct SurveyedArm {
    pub robot: Robot,
    landmark_names: BTreeMap<u32, String>,
    plain: PlainLandmark,
}

/// The landmark for a plain `child_frame`: the one of that name, or the only one, if it has no name.
fn plain_landmark(file: &Path, map: &InputMap, named: &NamedSurvey) -> Result<PlainLandmark, FileIssue> {
    let Some(ChildFrame::Plain(name)) = &map.child_frame else { return Ok(PlainLandmark::default()) };
    if let Some((id, _)) = named.names.iter().find(|(_, known)| *known == name) {
        let board = named.boards.get(id).copied().filter(|_| map.tag_use == TagUse::BoardCorners);
        if board.is_none() && map.tag_use == TagUse::BoardCorners {
            let problem = format!("is `{name}`, whose `squares` and `square_m` the tag map does not give");
            return Err(FileIssue::new(Code::KeyMissing, file, "tags.child_frame", problem));
        }
        return Ok(PlainLandmark { id: Some(*id), board });
    }
    match &named.survey.tags[..] {
        [only] if named.names.is_empty() && map.tag_use != TagUse::BoardCorners => {
            Ok(PlainLandmark { id: Some(only.id), board: None })
        }
        tags => {
            let ids = tags.iter().map(|tag| named.names.get(&tag.id).cloned().unwrap_or_else(|| tag.id.to_string()));
            let problem = format!("no landmark `{name}` in the tag map; it has {:?}", ids.collect::<Vec<_>>());
            Err(FileIssue::new(Code::NameUnknown, file, "tags.child_frame", problem))
        }
    }
}
