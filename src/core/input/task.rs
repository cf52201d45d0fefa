//! `--task` files: what an arm is calibrated for, where no recording says it.
//!
//! ```toml
//! version = 1
//! tolerance_m = 0.02
//! targets_m = [[0.5, 1.6, 0.3]]           # tool positions in the frame of the arm's base
//! # or the arm's joint angles there, base first, instead:
//! # poses_rad = [[-1.3, -0.3, -0.4, 0.3, -0.6, 0.0]]
//! ```

use crate::codes::Code;
use std::path::Path;

use serde::Deserialize;

use crate::joints::JointAngles;
use crate::robot::{FileIssue, Robot, RobotError, parse_toml, read_text};
use crate::streams::ReachTask;
use crate::time::Stamp;

/// A checked task file.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskFile {
    /// Largest distance between tool and target that counts as a hit.
    pub tolerance_m: f64,
    /// Tool positions in the base frame, m.
    pub targets_m: Vec<[f64; 3]>,
    /// Joint angles at which the tool shall be, rad.
    pub poses_rad: Vec<Vec<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TaskToml {
    version: u32,
    tolerance_m: f64,
    #[serde(default)]
    targets_m: Vec<[f64; 3]>,
    #[serde(default)]
    poses_rad: Vec<Vec<f64>>,
}

/// Farther than any arm reaches, m.
const MAX_TARGET_M: f64 = 100.0;

/// Reads a task file.
///
/// # Errors
/// [`RobotError`] with file, key and allowed range.
pub fn read_task(file: &Path) -> Result<TaskFile, RobotError> {
    parse_task(file, &read_text(file)?)
}

/// The same from a text; `file` names it in errors.
///
/// # Errors
/// As [`read_task`].
pub fn parse_task(file: &Path, text: &str) -> Result<TaskFile, RobotError> {
    let raw: TaskToml = parse_toml(file, text)?;
    FileIssue::check_range(file, "version", f64::from(raw.version), 1.0..=1.0)?;
    FileIssue::check_range(file, "tolerance_m", raw.tolerance_m, 1e-6..=10.0)?;
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
    /// The task for `robot`: the targets, and where its tool is at the poses by the drawing.
    ///
    /// # Errors
    /// [`FileIssue`] naming `file` where a pose has not as many angles as the robot has joints.
    pub fn for_robot(&self, file: &Path, robot: &Robot) -> Result<ReachTask, FileIssue> {
        let mut targets_m = self.targets_m.clone();
        for (k, pose) in self.poses_rad.iter().enumerate() {
            if pose.len() != robot.n_joints() {
                let problem = format!("has {} angles; the robot has the joints {:?}", pose.len(), robot.joint_names());
                return Err(FileIssue::new(Code::ValueCount, file, format!("poses_rad[{k}]"), problem));
            }
            let tool = robot.chain.link_poses(&JointAngles::from_slice(pose)).frame(&robot.tool.mount);
            targets_m.push(tool.translation.vector.into());
        }
        Ok(ReachTask { stamp: Stamp::default(), targets_m, tolerance_m: self.tolerance_m })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_named_with_file_and_key() {
        let good = "version = 1\ntolerance_m = 0.02\ntargets_m = [[0.5, 1.6, 0.3]]\n";
        let parse = |text: &str| parse_task(Path::new("task.toml"), text).map_err(|error| error.to_string());
        assert_eq!(parse(good).expect("good").targets_m, [[0.5, 1.6, 0.3]]);
        let faults: [(&str, &str, &[&str]); 6] = [
            ("version = 1", "version = 3", &["version", "1 .. 1"]),
            ("0.02", "0.0", &["tolerance_m", "10"]),
            ("1.6", "nan", &["targets_m[0]", "NaN"]),
            ("[[0.5, 1.6, 0.3]]", "[]", &["targets_m", "poses_rad"]),
            ("[0.5, 1.6, 0.3]", "[0.5, 1.6]", &["targets_m"]),
            ("targets_m", "target_m", &["target_m", "unknown field"]),
        ];
        for (from, to, words) in faults {
            let problem = parse(&good.replacen(from, to, 1)).expect_err(to);
            for word in words.iter().chain(&["task.toml"]) {
                assert!(problem.contains(word), "{to}: no `{word}` in {problem}");
            }
        }
    }
}
