//! A checked routine and its arm.

use crate::codes::Code;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Deserialize;

use super::campaign::{CampaignSettings, RegressSettings};
use super::error::RoutineError;
use super::method::Method;
use super::scene::Scene;
use super::settings::{CaptureSettings, TaskSettings};
use super::step::{MoveGoal, ReachSettings, Step, TouchSettings};
use crate::robot::{self, BaseTagStd, FailedJoint, FileIssue, MapKnowledge, Robot, Vehicle};

/// A checked routine.
#[derive(Clone, Debug)]
pub struct Routine {
    /// The routine's file.
    pub file: PathBuf,
    /// Name of the routine (letters, digits, - and _); it names the output folder.
    pub name: String,
    /// Name of the operator; reports have it, recordings do not.
    pub operator: Option<String>,
    /// Folder of robot.toml, relative to the working directory.
    pub robot_folder: PathBuf,
    /// The vehicle's file, relative to the working directory.
    pub vehicle_file: PathBuf,
    /// Seed of everything random in a run: the truth, and the plan's samples.
    pub seed: u64,
    /// Method of every calibration in the script.
    pub method: Method,
    /// Seafloor and obstacles that planning knows.
    pub scene: Scene,
    /// Ids of the tags that are present; `None`: all tags of the vehicle or the robot.
    pub tags: Option<Vec<u32>>,
    /// Knowledge of the tags' poses.
    pub map: MapKnowledge,
    /// Replacements of the base tag's standard deviations.
    pub base_tag_std: BaseTagStd,
    /// Joints that are declared to have failed, by name and kind.
    pub failed_joints: Vec<FailedJointEntry>,
    /// The scene as TOML, to travel with a recording.
    pub scene_toml: String,
    /// Settings of the captures; a step may change its own.
    pub capture: CaptureSettings,
    /// Targets and tolerance.
    pub task: TaskSettings,
    /// Steps of the script, in order.
    pub steps: Vec<Step>,
    /// Settings of the simulated truth, unread.
    pub world: toml::Table,
    /// Faults that occur at the script's `fault` steps, unread.
    pub faults: Vec<toml::Table>,
    /// Settings of `armcal campaign`; a single run ignores them.
    pub campaign: CampaignSettings,
    /// Limits of `armcal regress`.
    pub regress: RegressSettings,
}

impl Routine {
    /// Reads the robot and its vehicle, with the tags that the routine states as present.
    ///
    /// # Errors
    /// [`RoutineError`] naming file, key and allowed range.
    pub fn load_arm(&self) -> Result<(Robot, Vehicle), RoutineError> {
        let mut vehicle = robot::load_vehicle(&self.vehicle_file)?;
        let mut robot = robot::load(&self.robot_folder)?.mounted_on(&vehicle)?;
        if robot.is_watched() {
            vehicle.survey = None;
        }
        if let Some(ids) = &self.tags {
            let survey = robot
                .survey()
                .only(ids)
                .map_err(|problem| FileIssue::new(Code::NameUnknown, &self.file, "site.tags", problem))?;
            robot = robot.with_survey(survey.clone());
            vehicle.survey = Some(survey);
        }
        if self.map != MapKnowledge::Known || self.base_tag_std != BaseTagStd::default() {
            let survey = robot.survey().with_knowledge(&self.map, self.base_tag_std);
            let survey =
                survey.map_err(|problem| FileIssue::new(Code::ValueInvalid, &self.file, "site.known_tags", problem))?;
            robot = robot.with_survey(survey.clone());
            vehicle.survey = Some(survey);
        }
        robot.require_planning()?;
        self.check_against(&robot, &vehicle)?;
        let failed = self.failed_of(&robot)?;
        let robot = robot.with_failed(&failed);
        Ok((robot, vehicle))
    }

    fn failed_of(&self, robot: &Robot) -> Result<Vec<FailedJoint>, RoutineError> {
        let of = |(index, entry): (usize, &FailedJointEntry)| {
            FailedJoint::of_names(&entry.joint, &entry.kind, &robot.joint_names()).map_err(|problem| {
                FileIssue::new(Code::NameUnknown, &self.file, format!("failed_joint.{index}"), problem).into()
            })
        };
        let failed = self.failed_joints.iter().enumerate().map(of).collect::<Result<Vec<_>, RoutineError>>()?;
        FailedJoint::check_kinds(&failed, &robot.joint_names())
            .map_err(|problem| FileIssue::new(Code::ValueDuplicate, &self.file, "failed_joint", problem))?;
        Ok(failed)
    }

    /// Checks that the steps fit robot and vehicle.
    ///
    /// # Errors
    /// [`RoutineError`] naming the step.
    fn check_against(&self, robot: &Robot, vehicle: &Vehicle) -> Result<(), RoutineError> {
        let joints = robot.joint_names();
        for (index, step) in self.steps.iter().enumerate() {
            let key = format!("step {} ({})", index + 1, step.name());
            let problem = match step {
                Step::Identify(_) if self.map != MapKnowledge::Known => {
                    "needs a survey: a scale is measured before there are views to map the tags from (site.map)"
                        .to_owned()
                }
                Step::Identify(settings) => match joints.iter().position(|name| *name == settings.joint) {
                    None => format!("joint `{}` is none of {joints:?}", settings.joint),
                    Some(joint) if joint >= robot.n_seen_joints() => {
                        format!("joint `{}` does not move the camera, so no view can tell its scale", settings.joint)
                    }
                    Some(_) => continue,
                },
                Step::Stops(settings) => match settings.joints.iter().find(|name| !joints.contains(name)) {
                    None => continue,
                    Some(name) => format!("joint `{name}` is none of {joints:?}"),
                },
                Step::Move(MoveGoal::Angles(angles)) if angles.len() != joints.len() => {
                    format!("to_rad has {} angles, robot `{}` has {} joints", angles.len(), robot.name, joints.len())
                }
                Step::Work(work) => {
                    let rest = match &work.rest {
                        MoveGoal::Angles(angles) => Some(angles),
                        MoveGoal::Stowed => None,
                    };
                    let mut postures = work.looks_rad.iter().chain(rest);
                    match postures.find(|angles| angles.len() != joints.len()) {
                        None => continue,
                        Some(angles) => format!(
                            "a posture has {} angles, robot `{}` has {} joints",
                            angles.len(),
                            robot.name,
                            joints.len()
                        ),
                    }
                }
                Step::Grip { .. } | Step::Reach(ReachSettings { touch: true, .. }) if robot.gripper.is_none() => {
                    format!("robot `{}` has no [gripper] in its robot.toml", robot.name)
                }
                Step::Touch(settings) => match touch_problem(settings, robot, vehicle) {
                    None => continue,
                    Some(problem) => problem,
                },
                _ => continue,
            };
            return Err(FileIssue::new(Code::ValueInvalid, &self.file, key, problem).into());
        }
        Ok(())
    }
}

/// Largest distance of a point that lies on a part's surface, m.
const ON_SURFACE_M: f64 = 0.005;

/// Reason why the arm cannot touch that plane; `None` if it can.
fn touch_problem(settings: &TouchSettings, robot: &Robot, vehicle: &Vehicle) -> Option<String> {
    let Some(radius_m) = robot.tool.tip_radius_m else {
        return Some(format!(
            "robot `{}` has no [tool] tip_radius_m in its robot.toml (0.002 .. 0.2): nobody says what touches",
            robot.name
        ));
    };
    let Some(part) = vehicle.parts.iter().find(|part| part.name == settings.part) else {
        let names: Vec<&str> = vehicle.parts.iter().map(|part| part.name.as_str()).collect();
        return Some(format!("part `{}` is none of the vehicle's: {}", settings.part, names.join(", ")));
    };
    let distance_m =
        |out_m: f64| part.placed.distance_m(&(vehicle.vehicle_from_base.isometry() * settings.point_at(out_m)));
    let (at_m, beside_m) = (distance_m(0.0), distance_m(radius_m));
    if at_m > ON_SURFACE_M {
        return Some(format!("point_m lies {at_m:.3} m off `{}`; it is a point of its surface", settings.part));
    }
    ((beside_m - radius_m).abs() > ON_SURFACE_M).then(|| {
        format!(
            "normal does not lead out of `{}`: {radius_m} m along it is {beside_m:.3} m away from it",
            settings.part
        )
    })
}

/// `[[failed_joint]]` of a routine.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FailedJointEntry {
    /// Name of the joint in the URDF.
    pub joint: String,
    /// Kind of failure: `locked`, `dead`, `stuck` or `jumps`.
    #[schemars(extend("enum" = ["locked", "dead", "stuck", "jumps"]))]
    pub kind: String,
}
