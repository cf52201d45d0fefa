//! Reader of `--task` files: the task of an arm, if no recording states it.
//!
//! ```toml
//! version = 1
//! kind = "task"
//! tolerance_m = 0.02
//! targets_m = [[0.5, 1.6, 0.3]]           # tool positions in the frame of the arm's base
//! # or the arm's joint angles there, base first, instead:
//! # poses_rad = [[-1.3, -0.3, -0.4, 0.3, -0.6, 0.0]]
//! ```

use crate::codes::Code;
use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::document::parse_file;
use crate::joints::JointAngles;
use crate::kind::Kind;
use crate::kinematics::{ChainJoint, JointKind};
use crate::robot::{FileIssue, Robot, RobotError, read_text};
use crate::schema::schema_of;
use crate::streams::ReachTask;
use crate::time::Stamp;

/// A checked task file.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskFile {
    /// Largest distance between tool and target that counts as a hit.
    pub tolerance_m: f64,
    /// Tool positions in the base frame, m.
    pub targets_m: Vec<[f64; 3]>,
    /// Joint angles of the tool targets, rad.
    pub poses_rad: Vec<Vec<f64>>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TaskToml {
    #[serde(rename = "version")]
    _version: u32,
    #[serde(rename = "kind")]
    _kind: Option<Kind>,
    /// Largest distance between tool and target that counts as a hit.
    #[schemars(range(min = 1e-6, max = 1.0))]
    tolerance_m: f64,
    /// Tool positions in the base frame.
    #[serde(default)]
    #[schemars(inner(inner(range(min = -100.0, max = 100.0))))]
    targets_m: Vec<[f64; 3]>,
    /// Joint angles of the tool targets, base first (m for slides).
    #[serde(default)]
    #[schemars(inner(inner(range(min = -100.0, max = 100.0))))]
    poses_rad: Vec<Vec<f64>>,
}

/// Returns the schema of a task.
#[must_use]
pub fn task_schema() -> serde_json::Value {
    schema_of::<TaskToml>(Kind::Task)
}

/// Limit beyond the reach of any arm, m.
const MAX_TARGET_M: f64 = 100.0;

/// Reads a task file.
///
/// # Errors
/// [`RobotError`] with file, key and allowed range.
pub fn read_task(file: &Path) -> Result<TaskFile, RobotError> {
    parse_task(file, &read_text(file)?)
}

/// Parses the text of a task file; `file` names it in errors.
///
/// # Errors
/// The errors of [`read_task`].
pub fn parse_task(file: &Path, text: &str) -> Result<TaskFile, RobotError> {
    let raw: TaskToml = parse_file(Kind::Task, file, text)?;
    FileIssue::check_range(file, "tolerance_m", raw.tolerance_m, 1e-6..=1.0)?;
    for (k, target) in raw.targets_m.iter().enumerate() {
        for value in target {
            FileIssue::check_range(file, &format!("targets_m[{k}]"), *value, -MAX_TARGET_M..=MAX_TARGET_M)?;
        }
    }
    for (k, pose) in raw.poses_rad.iter().enumerate() {
        for value in pose {
            FileIssue::check_range(file, &format!("poses_rad[{k}]"), *value, -100.0..=100.0)?;
        }
    }
    if raw.targets_m.is_empty() && raw.poses_rad.is_empty() {
        return Err(
            FileIssue::new(Code::ValueCount, file, "targets_m", "is empty; give targets_m, poses_rad or both").into()
        );
    }
    Ok(TaskFile { tolerance_m: raw.tolerance_m, targets_m: raw.targets_m, poses_rad: raw.poses_rad })
}

impl TaskFile {
    /// Checks that each pose lies within the joints' limits.
    ///
    /// # Errors
    /// [`FileIssue`] naming `file`, the pose, the joint and its limits; it also says if the pose is in degrees.
    pub fn check_poses(&self, file: &Path, robot: &Robot) -> Result<(), FileIssue> {
        self.for_robot(file, robot)?;
        let is_within = |joint: &ChainJoint, angle: f64| {
            joint.limits.is_none_or(|limits| (limits.lower_rad..=limits.upper_rad).contains(&angle))
        };
        for (k, pose) in self.poses_rad.iter().enumerate() {
            let joints = || robot.chain.joints().iter().zip(pose.iter().copied());
            let Some((joint, angle)) = joints().find(|(joint, angle)| !is_within(joint, *angle)) else { continue };
            let Some(limits) = joint.limits else { continue };
            let (lower, upper, unit) = (limits.lower_rad, limits.upper_rad, joint.kind.si());
            let mut problem =
                format!("{angle} {unit} of joint `{}` is beyond its limits of {lower} to {upper} {unit}", joint.name);
            let in_degrees = joints().map(|(joint, angle)| match joint.kind {
                JointKind::Revolute => (joint, angle.to_radians()),
                JointKind::Prismatic => (joint, angle),
            });
            let in_degrees: Vec<(&ChainJoint, f64)> = in_degrees.collect();
            let has_turned = pose.iter().any(|angle| angle.abs() > std::f64::consts::TAU);
            if has_turned && in_degrees.iter().all(|(joint, angle)| is_within(joint, *angle)) {
                let angles: Vec<String> = in_degrees.iter().map(|(_, angle)| format!("{angle:.4}")).collect();
                problem += &format!(". The pose looks like degrees; write it in rad: [{}]", angles.join(", "));
            } else {
                problem += ". Give an angle within the limits, or correct the limits in the URDF";
            }
            return Err(FileIssue::new(Code::JointLimit, file, format!("poses_rad[{k}]"), problem));
        }
        Ok(())
    }

    /// Returns the task for `robot`: the targets, then the positions of its tool at the poses by the nominal model.
    ///
    /// # Errors
    /// [`FileIssue`] naming `file` if a pose does not have one angle per joint of the robot.
    pub fn for_robot(&self, file: &Path, robot: &Robot) -> Result<ReachTask, FileIssue> {
        let (mut targets_m, mut poses) = (self.targets_m.clone(), Vec::new());
        for (k, pose) in self.poses_rad.iter().enumerate() {
            if pose.len() != robot.n_joints() {
                let problem = format!("has {} angles; the robot has the joints {:?}", pose.len(), robot.joint_names());
                return Err(FileIssue::new(Code::ValueCount, file, format!("poses_rad[{k}]"), problem));
            }
            let pose = JointAngles::from_slice(pose);
            let tool = robot.chain.link_poses(&pose).frame(&robot.tool.mount);
            targets_m.push(tool.translation.vector.into());
            poses.push(pose);
        }
        Ok(ReachTask { stamp: Stamp::default(), targets_m, tolerance_m: self.tolerance_m, poses })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_named_with_file_and_key() {
        let good = "version = 1\nkind = \"task\"\ntolerance_m = 0.02\ntargets_m = [[0.5, 1.6, 0.3]]\n";
        let parse = |text: &str| parse_task(Path::new("task.toml"), text).map_err(|error| error.to_string());
        assert_eq!(parse(good).expect("good").targets_m, [[0.5, 1.6, 0.3]]);
        let faults = [
            ("version = 1", "version = 3"),
            ("0.02", "0.0"),
            ("1.6", "nan"),
            ("[[0.5, 1.6, 0.3]]", "[]"),
            ("[0.5, 1.6, 0.3]", "[0.5, 1.6]"),
            ("targets_m", "target_m"),
        ];
        let told = faults.map(|(from, to)| {
            let problem = parse(&good.replacen(from, to, 1)).expect_err(to);
            format!("{from:?} -> {to:?}\n  {problem}\n")
        });
        insta::assert_snapshot!("task", told.concat());
    }
}
